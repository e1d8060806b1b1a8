"""Machines with one joint: a hinge with a weight by torque, a slide with a screw, a servo by voltage, a free swing."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .hide import Scale, hidden, imperfect
from .law import Law
from .moves import cycles, follow, growing, play, sines, steps
from .record import Logger, spoiled, write_session
from .steps import Drive, Track, one_joint

HINGE = """<mujoco model="bench"><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
<worldbody><body name="arm"><joint name="hinge" type="hinge" axis="0 -1 0" {joint}/>
<inertial pos="0 0 {z:.5g}" mass="{mass:.5g}" diaginertia="{own:.4g} {own:.4g} {own:.4g}"/></body></worldbody>
{actuator}</mujoco>
"""
SLIDE = """<mujoco model="bench"><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
<worldbody><body name="carriage"><joint name="slide" type="slide" axis="1 0 0" {joint}/>
<inertial pos="0 0 0" mass="{mass:.5g}" diaginertia="1 1 1"/></body></worldbody>
<actuator><general name="motor" joint="slide" gainprm="1" biastype="affine" biasprm="0 0 0"/></actuator></mujoco>
"""


@dataclass(frozen=True)
class Made:
    """What a machine hides, for the answers: its law, the channel's delay, and whatever scoring needs."""

    law: dict[str, Any]
    late_s: float = 0.0
    extra: dict[str, Any] | None = None


def _logger(
    random: np.random.Generator, rates: tuple[float, ...], counts: float, effort: float, late_s: float = 0.0
) -> Logger:
    rate = float(random.choice(rates))
    jitter = float(random.choice([0.0, 0.0, 0.05, 0.3]))
    return Logger(
        rate,
        jitter,
        float(random.choice([0.0, 0.0, 0.05])),
        float(random.choice([0.0, random.uniform(0, 2e4)])),
        counts,
        effort * random.uniform(0.003, 0.02),
        effort * random.uniform(0.0005, 0.01),
        late_s,
    )


def _wrong(random: np.random.Generator, value: float, by: float = 2.0) -> float:
    return value * float(np.exp(random.uniform(-np.log(by), np.log(by))))


def _declared(random: np.random.Generator, **values: float) -> str:
    return " ".join(f'{k}="{_wrong(random, v, 4.0):.3g}"' for k, v in values.items())


def _delay(effects: tuple[str, ...], name: str, random: np.random.Generator) -> float:
    return float(random.uniform(0.004, 0.015)) if name in effects else 0.0


def hinge(folder: Path, effects: tuple[str, ...], fault: str, random: np.random.Generator) -> Made:
    """A weight on a hinge, torque recorded, several controllers."""
    weight, length = random.uniform(0.3, 4.0), random.uniform(0.1, 0.5)
    mass = weight / 9.81 / length
    speed, reach = random.uniform(1.5, 4.0), random.uniform(0.5, 1.4)
    law = Law(
        mass * length**2 + 0.002 * weight,
        weight,
        viscous=0.02 * weight * random.uniform(0.2, 1),
        coulomb=0.05 * weight * random.uniform(0.4, 1.2),
    )
    scale = Scale(0.6 * weight, speed, 2 * reach)
    for effect in effects:
        law = hidden(law, effect, scale, random)
    law = imperfect(law, scale, random)
    logger = _logger(
        random,
        (200, 333, 500, 1000),
        random.choice([4096, 16384, 65536]) / 2 / np.pi,
        0.6 * weight,
        _delay(effects, "late_channel", random),
    )
    logs, count, rate = [], int(random.integers(3, 9)), speed / 2 / np.pi / reach
    for k in range(count + max(1, count // 3)):
        seconds = random.uniform(6, 16)
        kinds = (
            sines(seconds, reach, rate, random),
            steps(seconds, reach, random),
            growing(seconds, 0.7 * reach, 1.3 * rate),
        )
        target = kinds[int(random.choice(3, p=[0.6, 0.25, 0.15]))]
        bandwidth = 2 * np.pi * random.uniform(2.5, 6)
        control = follow(target, law.inertia * bandwidth**2, 1.4 * law.inertia * bandwidth, 6 * weight)
        if fault == "command" or random.uniform() < 0.15:
            t = np.arange(0, seconds + 1, 1e-3)
            control = play(weight * random.uniform(0.3, 0.6) * np.sin(2 * np.pi * random.uniform(0.4, 1.0) * t))
        drive = Drive(gain=0.85 if fault == "command" else 1.0, lag_s=0.008 if fault == "command" else 0.0)
        track = one_joint(law, drive, control, seconds, (0.0, 0.0), random)
        logs.append((_columns(track, logger, seconds, random, "torque", fault), k >= count, {}))
    joint = _declared(random, armature=0.002 * weight, damping=law.viscous, frictionloss=law.coulomb)
    xml = HINGE.format(
        joint=joint,
        z=-length,
        mass=_wrong(random, mass),
        own=0.05 * mass * length**2,
        actuator='<actuator><motor name="motor" joint="hinge"/></actuator>',
    )
    write_session(
        folder, folder.name, xml, {"position": "joint:hinge:position", "torque": "actuator:motor:force"}, logs
    )
    return Made(asdict(law), logger.effort_late_s)


def _columns(
    track: Track, logger: Logger, seconds: float, random: np.random.Generator, channel: str, fault: str
) -> dict[str, np.ndarray]:
    at, stamps = logger.times(seconds, random)
    effort = logger.effort(at, track.time_s, track.effort[:, 0], random)
    command = np.interp(at, track.time_s, track.input[:, 0])
    limit = 0.5 * float(np.abs(effort).max())
    return {
        "time": stamps,
        "position": logger.position(at, track.time_s, track.position[:, 0]),
        channel: spoiled(fault, effort, command, at, limit),
    }


def slide(folder: Path, effects: tuple[str, ...], fault: str, random: np.random.Generator) -> Made:
    """A carriage on a screw, position loop closed, one trajectory of several cycles and its repetition."""
    mass, coulomb, period, stroke = (
        random.uniform(20, 150),
        random.uniform(10, 40),
        random.uniform(2.5, 6),
        random.uniform(0.1, 0.4),
    )
    speed = 2.5 * stroke / period
    effort = coulomb + random.uniform(0.5, 1.5) * coulomb + 6 * mass * stroke / period**2
    law = Law(mass, viscous=random.uniform(0.5, 1.5) * coulomb / speed, coulomb=coulomb)
    scale = Scale(effort, speed, stroke, stroke / 2)
    for effect in effects:
        law = hidden(law, effect, scale, random)
    law = replace(imperfect(law, scale, random), tilt=0.0)
    logger = _logger(
        random, (250, 500, 1000), random.choice([1e5, 1e6]), effort, _delay(effects, "late_channel", random)
    )
    logs = []
    count = int(random.integers(1, 4))
    for k in range(count + 1):
        seconds = 4 * period
        faster = 1.0 if count == 1 else random.uniform(0.7, 1.5)
        target = cycles(seconds, 0.0, stroke, period / faster, 0.25)
        bandwidth = 2 * np.pi * 12
        track = one_joint(
            law,
            Drive(),
            follow(target, mass * bandwidth**2, 1.2 * mass * bandwidth, 30 * effort),
            seconds,
            (0.0, 0.0),
            random,
        )
        logs.append((_columns(track, logger, seconds, random, "force", fault), k >= count, {}))
    xml = SLIDE.format(joint=_declared(random, damping=law.viscous, frictionloss=coulomb), mass=_wrong(random, mass))
    write_session(folder, folder.name, xml, {"position": "joint:slide:position", "force": "actuator:motor:force"}, logs)
    return Made(asdict(law), logger.effort_late_s)


def servo(folder: Path, effects: tuple[str, ...], fault: str, random: np.random.Generator) -> Made:
    """A hobby servo with a weight: only its voltage is recorded; gains and motions vary, one gain validates, some drops
    are open."""
    weight, length = random.uniform(0.2, 1.2), random.uniform(0.08, 0.2)
    stall, top, volts = weight * random.uniform(2.0, 3.0), random.uniform(6, 12), float(random.choice([7.4, 12.0]))
    gain, back = stall / volts, stall / top
    law = Law(
        weight * length / 9.81 + 0.004 * weight,
        weight,
        viscous=0.01 * stall,
        coulomb=0.06 * weight * random.uniform(0.5, 1.2),
    )
    scale = Scale(0.5 * weight, 0.35 * top, 2.5)
    for effect in effects:
        law = hidden(law, effect, scale, random)
    law = imperfect(law, scale, random)
    sag = random.uniform(0.15, 0.3) if "drive_sag" in effects else 0.0
    late = _delay(effects, "late_drive", random)
    drive = Drive(gain, back, late, 0.0, sag / volts)
    logger = _logger(random, (100, 190, 300), 4096 / 2 / np.pi, 1.0)
    gains = random.permutation([1.0, 2.0, 4.0])
    logs, starts = [], []
    for g in (*gains[1:], gains[0]):
        for kind in range(4):
            seconds = random.uniform(3.5, 6)
            targets = (sines(seconds, 1.2, 0.5, random), steps(seconds, 1.4, random), growing(seconds, 0.8, 1.0), None)
            if targets[kind] is None:  # leads open: it falls freely
                own, start, now = (
                    {"actuator:motor:gear": [0, 0, 0, 0, 0, 0]},
                    (random.uniform(0.8, 1.5), 0.0),
                    Drive(0.0),
                )
                control = play(np.zeros(10000))
            else:
                own, start, now = {}, (0.0, 0.0), drive
                control = follow(targets[kind], g * 2.0 * volts, 0.0, volts)
            track = one_joint(law, now, control, seconds, start, random, tick_s=2e-3)
            at, stamps = logger.times(seconds, random)
            logs.append(
                (
                    {
                        "time": stamps,
                        "position": logger.position(at, track.time_s, track.position[:, 0]),
                        "voltage": np.round(track.input[np.searchsorted(track.time_s, at), 0] / volts * 885)
                        * volts
                        / 885,
                    },
                    g == gains[0],
                    own,
                )
            )
            starts.append(start)
    resistance = random.uniform(2, 5)
    constant = f"{_wrong(random, gain * resistance, 1.3):.3g}"
    joint = _declared(random, armature=0.004 * weight, damping=0.01 * stall, frictionloss=law.coulomb)
    motor = (
        f'<actuator><dcmotor name="motor" joint="hinge" motorconst="{constant} {constant}" '
        f'resistance="{resistance:.3g}"/></actuator>'
    )
    xml = HINGE.format(joint=joint, z=-length, mass=weight / 9.81 / length, own=1e-5, actuator=motor)
    write_session(
        folder, folder.name, xml, {"position": "joint:hinge:position", "voltage": "actuator:motor:ctrl"}, logs
    )
    return Made(asdict(law), late, {"starts": starts, "gain": gain, "back_emf": back, "sag": sag / volts})


def swing(folder: Path, effects: tuple[str, ...], fault: str, random: np.random.Generator) -> Made:
    """A free pendulum with an encoder alone, from large and small angles; the halves of a run go to both sides."""
    length, mass = random.uniform(0.1, 0.4), random.uniform(0.1, 0.5)
    weight = mass * 9.81 * length
    inertia = mass * length**2 * random.uniform(1.1, 1.5)
    rate = np.sqrt(weight / inertia)
    law = Law(
        inertia,
        weight,
        viscous=weight / rate * random.uniform(0.002, 0.008),
        coulomb=weight * random.uniform(0.0005, 0.002),
    )
    # Of what damps a swing, not of its weight.
    scale = Scale(0.1 * weight, 1.2 * rate, 2.5)
    for effect in effects:
        law = hidden(law, effect, scale, random)
        if effect == "stribeck_friction":
            law = replace(law, stribeck=law.coulomb * random.uniform(0.8, 1.5))
        if effect == "quadratic_damping":
            law = replace(law, drag=law.drag * random.uniform(0.4, 1.0))
    law = replace(law, tilt=random.normal(0, 0.003), ripple=(weight * 2e-5, 0.3, 0.0))
    logger = _logger(random, (200, 500, 1000), random.choice([4096, 16384]) / 2 / np.pi, 1.0)
    logs, starts = [], []
    for angle in random.uniform([1.2, 0.5, 0.1, 0.9], [1.8, 0.8, 0.3, 1.4])[: int(random.integers(2, 5))]:
        seconds = random.uniform(16, 24)
        track = one_joint(law, Drive(0.0), play(np.zeros(40000)), seconds, (float(angle), 0.0), random)
        at, stamps = logger.times(seconds, random)
        q = logger.position(at, track.time_s, track.position[:, 0])
        half = len(at) // 2
        for part, held in ((slice(0, half), False), (slice(half, None), True)):
            logs.append(({"time": stamps[part], "position": q[part]}, held, {}))
            k = min(np.searchsorted(track.time_s, at[part][0]), len(track.time_s) - 1)
            starts.append((float(track.position[k, 0]), float(track.velocity[k, 0])))
    xml = HINGE.format(
        joint=_declared(random, damping=law.viscous, frictionloss=law.coulomb),
        z=-length,
        mass=mass,
        own=0.2 * mass * length**2,
        actuator="",
    )
    write_session(folder, folder.name, xml, {"position": "joint:hinge:position"}, logs)
    return Made(asdict(law), 0.0, {"starts": starts})
