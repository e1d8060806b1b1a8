"""The drive in raw units: a mass with friction that truly sticks, under a position controller.

inertia a = u - load(p, v, ...) - viscous v - friction, with |friction| <= level while it sticks and friction = level
sign(v) while it slides. Viscous friction is integrated implicitly, the stop at a velocity reversal is an event of its
own. A motor with give carries the friction on bristles instead (LuGre; Canudas de Wit et al. 1995, eq. 1-3).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .program import Program, commands
from .truth import Controller, MotorTruth

Array = NDArray[np.float64]

STEP_S = 1e-3
SLEW = 1500.0  # of the cascade's wanted velocity [%/s^2]


@dataclass
class DriveNow:
    """The running state that influences see: time [s] of trial and session, position [%], velocity [%/s], current
    [raw].

    direction: of the motion, or of the push while sticking. transmitted: load behind the gearbox [raw]. gravity_palm:
    unit vector of gravity in the palm frame. bristle: deflection [%] of the friction's bristles. level: what friction
    slides at, as of the step before [raw].
    """

    time_s: float = 0.0
    session_s: float = 0.0
    position: float = 0.0
    velocity: float = 0.0
    current: float = 0.0
    direction: float = 1.0
    transmitted: float = 0.0
    spring: float = 0.0
    slip: bool = True
    gravity_palm: Sequence[float] = (0.0, 0.0, -1.0)
    bristle: float = 0.0
    level: float = 0.0


Term = Callable[[DriveNow], float]


@dataclass(frozen=True)
class DriveTerms:
    """What acts on one drive beyond the declared model.

    load: [raw] against flexion whatever the direction. friction: [raw] added to the Coulomb level, opposing motion.
    advance: called once per step, after the motion. speed_factor: share of the commanded speed that the drive reaches.
    sense: position [%] that the encoder tells the controller. current_limit: the drive's own clip [raw].
    replace_coulomb: a bristle, one of the loads, carries the friction instead.
    """

    load: tuple[Term, ...] = ()
    friction: tuple[Term, ...] = ()
    advance: tuple[Callable[[DriveNow, float], None], ...] = ()
    speed_factor: tuple[Term, ...] = ()
    sense: tuple[Callable[[float], float], ...] = ()
    current_limit: float = float("inf")
    command_delay_s: float = 0.0
    replace_coulomb: bool = False


@dataclass(frozen=True)
class Motion:
    """One simulated trial at STEP_S: time [s], position [%], velocity [%/s], acceleration [%/s^2], current [raw],
    load (spring and all further loads) [raw], friction [raw], each (n,); setpoint [%], speed and current_limit
    [raw].
    """

    time_s: Array
    position: Array
    velocity: Array
    acceleration: Array
    current: Array
    load: Array
    friction: Array
    setpoint: Array
    speed: Array
    current_limit: Array
    session_start_s: float = 0.0
    extra: dict[str, Array] = field(default_factory=dict)


def _controller(control: Controller, now: DriveNow, step_s: float) -> Callable[[float, float, float], float]:
    """The control law: (setpoint [%], speed limit [%/s], sensed position [%]) -> wanted current [raw]."""
    # ramp: the reference [%]; profile: the reference and its speed [%/s]; cascade: the integral [raw], the wanted
    # velocity
    state = [0.0, 0.0]

    def ramp(setpoint: float, limit: float, sensed: float) -> float:
        wanted = setpoint - state[0]
        move = max(-limit * step_s, min(limit * step_s, wanted))
        state[0] += move
        return control.gain * (state[0] - sensed) + control.damping * (move / step_s - now.velocity)

    def profile(setpoint: float, limit: float, sensed: float) -> float:
        left, most = setpoint - state[0], control.acceleration * step_s
        # as fast as it can still stop from, in whole steps
        wanted = math.copysign(
            min(limit, math.sqrt(2.0 * control.acceleration * abs(left) + 0.25 * most**2) - 0.5 * most), left
        )
        state[1] += max(-most, min(most, wanted - state[1]))
        if abs(left) < abs(state[1]) * step_s:
            state[0], state[1] = setpoint, 0.0
        state[0] += state[1] * step_s
        return control.gain * (state[0] - sensed) + control.damping * (state[1] - now.velocity)

    def cascade(setpoint: float, limit: float, sensed: float) -> float:
        error = setpoint - sensed
        wanted = 0.0 if abs(error) < 1.0 else max(-limit, min(limit, 14.0 * error))
        state[1] += max(-SLEW * step_s, min(SLEW * step_s, wanted - state[1]))
        slip = state[1] - now.velocity
        if wanted:  # inside the dead zone the integral holds, so that nothing hunts
            state[0] = max(-200.0, min(200.0, state[0] + control.integral * slip * step_s))
        return control.gain * slip + state[0]

    return {"ramp": ramp, "profile": profile, "cascade": cascade}[control.kind]


def simulate(
    motor: MotorTruth,
    program: Program,
    terms: DriveTerms = DriveTerms(),
    start_s: float = 0.0,
    gravity_palm: Array | None = None,
    step_s: float = STEP_S,
    start_percent: float = 0.0,
) -> Motion:
    """Simulate one program from rest at `start_percent` [%].

    gravity_palm: (n, 3) unit vectors per step, for terms that need them. start_s: session time of the trial's start
    [s].
    """
    n = round(program.duration_s / step_s) + 1
    time_s = np.arange(n) * step_s
    target, speed, limit = (column.tolist() for column in commands(program, time_s, terms.command_delay_s))
    now = DriveNow(position=start_percent, level=motor.coulomb)
    if motor.give:  # at rest the bristles carry the preload, as a hard stick would
        now.bristle = -motor.give * min(0.9, motor.preload / motor.coulomb)
    control = _controller(motor.controller, now, step_s)
    to_speed = motor.controller.speed_full / motor.controller.speed_raw_full
    gravity = None if gravity_palm is None else gravity_palm.tolist()
    rows = []
    for i in range(n):
        now.time_s = i * step_s
        now.session_s = start_s + now.time_s
        if gravity is not None:
            now.gravity_palm = gravity[i]
        rows.append(
            _step(
                motor, terms, control, now, target[i], speed[i] * to_speed, min(limit[i], terms.current_limit), step_s
            )
        )
    position, velocity, acceleration, current, load, friction = np.array(rows).T
    setpoint, speed_raw, limit_raw = commands(program, time_s)
    return Motion(
        time_s, position, velocity, acceleration, current, load, friction, setpoint, speed_raw, limit_raw, start_s
    )


def _step(
    motor: MotorTruth,
    terms: DriveTerms,
    control: Callable,
    now: DriveNow,
    target: float,
    speed: float,
    limit: float,
    step_s: float,
) -> tuple[float, ...]:
    """Advance `now` by one step; returns position, velocity, acceleration, current, load, friction at its start."""
    p, v = now.position, now.velocity
    for factor in terms.speed_factor:
        speed *= factor(now)
    sensed = p
    for sense in terms.sense:
        sensed += sense(p)
    current = max(-limit, min(limit, control(target, speed, sensed)))
    now.current = current
    now.spring = motor.stiffness * p + motor.preload
    now.transmitted = now.spring
    now.slip = v != 0.0
    load = now.spring
    for term in terms.load:
        load += term(now)
        now.transmitted = load
    drive = current
    drive -= load
    direction = (1.0 if v > 0 else -1.0) if v != 0.0 else (1.0 if drive > 0 else -1.0)
    now.direction = direction
    level = motor.coulomb
    for term in terms.friction:
        level += term(now)
    now.level = level = max(0.0, level)
    if terms.replace_coulomb:
        level = 0.0
    if motor.give and level > 0.0:
        new, friction = _bristles(motor, now, drive, level, step_s)
    elif v == 0.0 and abs(drive) <= level:
        new, friction = 0.0, drive
    else:
        friction = direction * level
        new = (v + step_s * (drive - friction) / motor.inertia) / (1.0 + step_s * motor.viscous / motor.inertia)
        if v != 0.0 and new * direction <= 0.0:
            new = 0.0
    now.position = p + 0.5 * step_s * (v + new)
    now.velocity = new
    for advance in terms.advance:
        advance(now, step_s)
    return p, v, (new - v) / step_s, current, load, friction


def _bristles(motor: MotorTruth, now: DriveNow, drive: float, level: float, step_s: float) -> tuple[float, float]:
    """Velocity after the step [%/s] and friction [raw] of bristles that slide at `level` [raw]; moves the bristles."""
    stiffness = motor.coulomb / motor.give
    damping = 0.3 * math.sqrt(stiffness * motor.inertia)
    half = 0.5 * step_s
    now.bristle = max(-level / stiffness, min(level / stiffness, now.bristle))  # the level may have fallen since
    # midpoint rule: a step that is late in the bristles adds to inertia and friction at every stop
    free = motor.inertia * now.velocity + half * (drive - stiffness * now.bristle)  # its sign is that of the motion
    # of the motion that bends the bristles
    share = 1.0 - math.copysign(now.bristle, now.bristle * free) * stiffness / level
    reach = half * stiffness + damping
    middle = free / (motor.inertia + half * (motor.viscous + reach * share))
    new, friction = 2.0 * middle - now.velocity, stiffness * now.bristle + reach * share * middle
    now.bristle = max(-level / stiffness, min(level / stiffness, now.bristle + step_s * share * middle))
    return new, friction
