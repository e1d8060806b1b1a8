"""Machines with more than one joint or station: a two-joint arm, a drive with an encoder behind each stage, a band
brake."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from .hide import Scale, hidden, imperfect
from .law import Law
from .machines import Made, _declared, _logger, _wrong
from .moves import TICK_S, follow, sines
from .record import spoiled, write_session
from .steps import Arm, two_joints

ARM = """<mujoco model="arm"><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
<default><joint type="hinge" axis="0 -1 0" {joint}/></default>
<worldbody><body name="upper"><joint name="shoulder"/><inertial pos="0 0 {z1:.4g}" mass="{m1:.4g}" diaginertia="{i1:.4g} {i1:.4g} 1e-4"/>
<body name="lower" pos="0 0 {l1:.4g}"><joint name="elbow"/><inertial pos="0 0 {z2:.4g}" mass="{m2:.4g}" diaginertia="{i2:.4g} {i2:.4g} 1e-4"/></body></body></worldbody>
<actuator><motor name="shoulder" joint="shoulder"/><motor name="elbow" joint="elbow"/></actuator></mujoco>
"""
STAGES = """<mujoco model="stages"><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/><worldbody>
<body name="motor"><joint name="motor" type="hinge" axis="0 0 1"/><inertial pos="0 0 0" mass="0.01" diaginertia="1e-9 1e-9 1e-9"/></body>
<body name="output"><joint name="output" type="hinge" axis="0 0 1" {joint}/><inertial pos="0 0 0" mass="0.01" diaginertia="{own:.3g} {own:.3g} {own:.3g}"/></body>
<body name="jaw"><joint name="jaw" type="hinge" axis="0 0 1"/><inertial pos="0 0 0" mass="0.01" diaginertia="1e-9 1e-9 1e-9"/></body>
</worldbody><equality><joint name="gear" joint1="motor" joint2="output" polycoef="0 {ratio:.3g} 0 0 0"/>
<joint name="cable" joint1="jaw" joint2="output" polycoef="0 1 0 0 0"/></equality>
<actuator><motor name="output" joint="output"/><motor name="load" joint="jaw"/></actuator></mujoco>
"""
BRAKE = """<mujoco model="brake"><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
<worldbody><body name="slide"><joint name="slide" type="slide" axis="1 0 0" damping="{damping:.3g}" frictionloss="{friction:.3g}"/>
<inertial pos="0 0 0" mass="{mass:.3g}" diaginertia="1 1 1"/></body></worldbody><actuator><motor name="pusher" joint="slide"/></actuator></mujoco>
"""


def arm(folder: Path, effects: tuple[str, ...], fault: str, random: np.random.Generator) -> Made:
    """Two torque drives, two links, encoders and torques of both; the effects sit at one joint."""
    l1, m1, m2 = random.uniform(0.2, 0.4), random.uniform(0.3, 1.0), random.uniform(0.3, 1.0)
    c1, c2 = l1 * random.uniform(0.5, 0.9), random.uniform(0.1, 0.2)
    i1, i2, rotor = 0.1 * m1 * l1**2, 0.2 * m2 * c2**2, 0.002
    body = Arm(
        (m1 * c1**2 + i1, m2 * c2**2 + i2),
        (rotor, rotor),
        m2 * l1 * c2,
        m2 * l1**2,
        (9.81 * (m1 * c1 + m2 * l1), 9.81 * m2 * c2),
    )
    at, laws = int(random.integers(2)), []
    for j in (0, 1):
        law = Law(1.0, viscous=0.015 * body.weights[j], coulomb=0.04 * body.weights[j] * random.uniform(0.5, 1.5))
        scale = Scale(0.6 * body.weights[j], 3.0, 1.8)
        for effect in effects if j == at else ():
            law = hidden(law, effect, scale, random)
        laws.append(replace(imperfect(law, scale, random), tilt=0.0))
    loggers = [_logger(random, (200, 400, 600), 16384 / 2 / np.pi, 0.5 * w) for w in body.weights]
    logs, count = [], int(random.integers(3, 7))
    for k in range(count + max(1, count // 3)):
        seconds = random.uniform(6, 12)
        paths = [sines(seconds, random.uniform(0.6, 1.1), random.uniform(0.3, 0.7), random) for _ in (0, 1)]
        each = [follow(p, 8 * w, 1.2 * w, 3 * w) for p, w in zip(paths, body.weights, strict=True)]
        track = two_joints(body, laws, lambda n, q, v, c=each: (c[0](n, q[0], v[0]), c[1](n, q[1], v[1])), seconds)
        instants, stamps = loggers[0].times(seconds, random)
        columns = {"time": stamps}
        for j, name in enumerate(("shoulder", "elbow")):
            effort = loggers[j].effort(instants, track.time_s, track.effort[:, j], random)
            columns[f"{name}_position"] = loggers[j].position(instants, track.time_s, track.position[:, j])
            columns[f"{name}_torque"] = spoiled(
                fault if j == at else "", effort, 0.9 * effort, instants, 0.5 * float(np.abs(effort).max())
            )
        logs.append((columns, k >= count, {}))
    xml = ARM.format(
        joint=_declared(random, armature=rotor, damping=0.02, frictionloss=0.05),
        z1=-c1,
        m1=_wrong(random, m1, 1.4),
        i1=i1,
        l1=-l1,
        z2=-c2,
        m2=_wrong(random, m2, 1.4),
        i2=i2,
    )
    signals = {
        f"{n}_{s}": f"{'joint' if s == 'position' else 'actuator'}:{n}:{'position' if s == 'position' else 'force'}"
        for n in ("shoulder", "elbow")
        for s in ("position", "torque")
    }
    write_session(folder, folder.name, xml, signals, logs)
    return Made(asdict(laws[at]), 0.0, {"joint": at, "l1": l1})


def _held_back(path: np.ndarray, gap: float) -> np.ndarray:
    """Position (n,) of what a path drags along across a play."""
    out = np.empty(len(path))
    at = path[0]
    for k, x in enumerate(path):
        at = min(max(at, x - gap / 2), x + gap / 2)
        out[k] = at
    return out


def stages(folder: Path, effects: tuple[str, ...], fault: str, random: np.random.Generator) -> Made:
    """Motor, gear with an encoder on both sides, a load that the laboratory sets; slow motions. Efforts by the true
    balance."""
    ratio, level = random.uniform(5, 40), random.uniform(0.3, 1.5)
    law = Law(random.uniform(1e-4, 1e-3) * level, viscous=0.05 * level, coulomb=random.uniform(0.05, 0.15) * level)
    scale = Scale(0.5 * level, 2.0, 2.0)
    for effect in effects:
        law = hidden(law, effect, scale, random)
    gap = random.uniform(0.02, 0.06) if "drive_backlash" in effects else 0.0
    give = random.uniform(0.05, 0.15) / level if "series_elasticity" in effects else 0.0
    logger = _logger(random, (250, 500, 1000), random.choice([4096, 16384]) / 2 / np.pi, 0.5 * level)
    logs, count = [], int(random.integers(4, 9))
    for k in range(count + max(1, count // 3)):
        seconds = random.uniform(8, 15)
        q = sines(seconds, 1.0, random.uniform(0.1, 0.5), random, 2)
        t, stiffness = np.arange(len(q)) * TICK_S, level * random.uniform(0.1, 1.0)
        v = np.gradient(q, TICK_S)
        load = stiffness * q + 0.1 * level * np.sin(2 * np.pi * random.uniform(0.2, 0.6) * t)
        plastic, friction = 0.0, np.zeros(len(q))
        carried = load + law.inertia * np.gradient(v, TICK_S)
        for n in range(len(q)):
            plastic = min(max(plastic + TICK_S * v[n] / law.stop[1], -1.0), 1.0)
            bound = law.dry(q[n], v[n], carried[n], carried[n] + friction[n - 1], 0.0)
            friction[n] = law.smooth(q[n], v[n]) + np.tanh(v[n] / 5e-3) * bound + law.stop[0] * plastic
        effort = carried + friction
        motor = ratio * _held_back(q, gap) if not gap else ratio * (2 * q - _held_back(q, gap))
        motor = motor + ratio * give * effort + ratio * 0.002 * np.sin(2 * np.pi * q / 0.7)
        at, stamps = logger.times(seconds, random)
        logs.append(
            (
                {
                    "time": stamps,
                    "motor_position": np.round(np.interp(at, t, motor) * 300) / 300,
                    "output_position": logger.position(at, t, q),
                    "jaw_position": logger.position(at, t, 0.9 * q - 0.01 * load / level),
                    "torque": logger.effort(at, t, effort, random),
                    "load_torque": logger.effort(at, t, -load / 0.9, random),
                },
                k >= count,
                {},
            )
        )
    xml = STAGES.format(
        joint=_declared(random, damping=law.viscous, frictionloss=law.coulomb),
        own=_wrong(random, law.inertia, 3),
        ratio=_wrong(random, ratio, 1.1),
    )
    write_session(
        folder,
        folder.name,
        xml,
        {
            "motor_position": "joint:motor:position",
            "output_position": "joint:output:position",
            "jaw_position": "joint:jaw:position",
            "torque": "actuator:output:force",
            "load_torque": "actuator:load:force",
        },
        logs,
    )
    return Made(asdict(law), 0.0, {"gap": gap, "give": give, "ratio": ratio})


def brake(folder: Path, effects: tuple[str, ...], fault: str, random: np.random.Generator) -> Made:
    """A band holds a drum whose motion is imposed; the laboratory sets the tension, and so the level of friction, of
    each trial."""
    levels = np.sort(random.uniform(500, 5000, 2)) * np.array([1.0, 2.0])
    law = Law(random.uniform(5, 40), viscous=0.03 * levels.mean() / 0.1)
    reach = random.uniform(1e-3, 4e-3) if "elastoplastic_hysteresis" in effects else 0.0
    scale = Scale(float(levels.mean()), 0.1, 0.06)
    for effect in effects:
        law = (
            law
            if effect == "elastoplastic_hysteresis"
            else hidden(replace(law, coulomb=float(levels.mean())), effect, scale, random)
        )
    logger = _logger(random, (500, 1024), 1e5, float(levels.mean()))
    logs = []
    for k, (level, size, rate) in enumerate(
        (lv, s, r) for lv in levels for s in (0.01, 0.02, 0.035) for r in (0.5, 1.0)
    ):
        seconds, rate = 8 / rate, rate * random.uniform(0.9, 1.1)
        t = np.arange(0, seconds, TICK_S)
        q = size * np.sin(2 * np.pi * rate * t) * np.clip(t, 0, 1)
        v = np.gradient(q, TICK_S)
        state, friction = 0.0, np.empty(len(q))
        for n in range(len(q)):
            state = min(max(state + TICK_S * v[n] / reach, -1.0), 1.0) if reach else float(np.tanh(v[n] / 5e-4))
            bound = (
                replace(law, coulomb=level).dry(q[n], v[n], 0.0, 0.0, 0.0) if law.stribeck or law.tight[2] else level
            )
            friction[n] = bound * state + law.smooth(q[n], v[n])
        effort = law.inertia * np.gradient(v, TICK_S) + friction * (1 + random.normal(0, 0.01))
        at, stamps = logger.times(seconds, random)
        own = {"joint:slide:frictionloss": round(float(level) * 1.3)}
        logs.append(
            (
                {"time": stamps, "position": logger.position(at, t, q), "force": logger.effort(at, t, effort, random)},
                k % 3 == 1,
                own,
            )
        )
    xml = BRAKE.format(
        damping=_wrong(random, law.viscous, 3), friction=float(levels.mean()), mass=_wrong(random, law.inertia, 3)
    )
    write_session(
        folder, folder.name, xml, {"position": "joint:slide:position", "force": "actuator:pusher:force"}, logs
    )
    return Made(asdict(law), 0.0, {"reach": reach, "levels": [float(v) for v in levels]})
