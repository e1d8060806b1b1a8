"""Loads besides the straight spring. Forces in raw units of current, positions in %, times in s."""

from __future__ import annotations

import numpy as np

from ..geometry import Array, log_uniform
from ..hand import Finger, Session
from .draw import WEAK, Drawn, clear_load


def detent_load(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A load about one place: a bump, or a hill that pushes on past its top."""
    motor = finger.motor
    motor.detent = strength * 2.2 * clear_load(session, rng) * int(rng.choice([-1, 1]))
    motor.detent_centre = rng.uniform(22, 78)
    motor.detent_width = log_uniform(rng, 6, 12)
    motor.detent_form = float(rng.integers(2))
    return Drawn(
        {
            "amplitude_raw": motor.detent,
            "centre_pct": motor.detent_centre,
            "half_width_pct": motor.detent_width,
            "form": ["bump", "over-the-hill"][int(motor.detent_form)],
        }
    )


def bent_shape(form: float, shape: float, x: Array) -> Array:
    """Load of a bent spring over 0 to 1: exponential, or a knee."""
    if form == 0:
        return (np.exp(shape * x) - 1) / (np.exp(shape) - 1)
    past = x - shape
    return 0.5 * (past + np.sqrt(past * past + 0.0016))


def nonlinear_spring(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A spring that stiffens, seldom softens, beyond what a straight one can take over."""
    motor = finger.motor
    motor.bent_form = float(rng.integers(2))
    motor.bent_shape = rng.uniform(3, 5) if motor.bent_form == 0 else rng.uniform(0.5, 0.75)
    x = np.linspace(0, 1, 400)
    y = bent_shape(motor.bent_form, motor.bent_shape, x)
    line = np.polyfit(x, y, 1)
    motor.bent_slope, motor.bent_offset = line
    beyond = np.std(y - np.polyval(line, x))
    stiffens = rng.uniform() < 0.7
    motor.bent_spring = (1 if stiffens else -1) * strength * 0.7 * clear_load(session, rng) / beyond
    return Drawn(
        {
            "form": ["exponential stiffening", "knee"][int(motor.bent_form)] if stiffens else "softening",
            "amplitude_raw": motor.bent_spring,
            "shape": motor.bent_shape,
            "rms_beyond_linear_raw": motor.bent_spring * beyond,
        }
    )


def gravity_load(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """The finger's weight, with a palm that tilts far enough to show it."""
    motor, laboratory = finger.motor, session.laboratory
    motor.weight = strength * 2.4 * clear_load(session, rng)
    if strength >= WEAK:
        laboratory.tilt_deg = rng.uniform(45, 75)
        laboratory.gravity_given = True
    return Drawn({"weight_raw": motor.weight, "tilt_deg": laboratory.tilt_deg})


def torque_ripple(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A periodic load over position, at times with its second harmonic."""
    motor = finger.motor
    motor.ripple = strength * 1.3 * clear_load(session, rng)
    motor.ripple_period = log_uniform(rng, 4, 11)
    motor.ripple_phase = rng.uniform(0, 6.28)
    motor.ripple_second = motor.ripple * float(rng.choice([0, 0.25]))
    return Drawn(
        {
            "amplitude_raw": motor.ripple,
            "period_pct": motor.ripple_period,
            "second_harmonic_raw": motor.ripple_second,
        }
    )


def viscoelastic_spring(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A second spring in series with a damper."""
    motor = finger.motor
    motor.relaxation_time = log_uniform(rng, 0.7, 3.0)
    motor.relaxing_stiffness = strength * 1.5 * clear_load(session, rng) / 20
    return Drawn({"branch_stiffness": motor.relaxing_stiffness, "relaxation_s": motor.relaxation_time})


def end_stop_contact(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A soft stop before one end of the range."""
    motor = finger.motor
    if rng.uniform() < 0.65:
        place = motor.upper_stop = rng.uniform(82, 91)
        stiffness = motor.upper_stiffness = strength * 4 * clear_load(session, rng) / (98 - place)
    else:
        place = motor.lower_stop = rng.uniform(9, 17)
        stiffness = motor.lower_stiffness = strength * 4 * clear_load(session, rng) / place
    return Drawn({"position_pct": place, "stiffness_raw_per_pct": stiffness})


def external_contact(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A soft object in the finger's way for a part of some trials."""
    motor = finger.motor
    motor.obstacle = rng.uniform(45, 70)
    motor.obstacle_stiffness = strength * 4.5 * clear_load(session, rng) / (97 - motor.obstacle)
    motor.obstacle_damping = strength * 0.15 * motor.viscous
    finger.faults.touched_share = float(rng.uniform(0.3, 0.55))
    return Drawn(
        {
            "position_pct": motor.obstacle,
            "stiffness_raw_per_pct": motor.obstacle_stiffness,
            "object_there": f"parts of some trials (share {finger.faults.touched_share:.2f})",
        }
    )
