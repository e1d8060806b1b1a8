"""Friction that is not one level plus one viscous share. Forces in raw units of current, positions in %, speeds in
%/s."""

from __future__ import annotations

import numpy as np

from ..geometry import log_uniform
from ..hand import Finger, Session
from .draw import WEAK, Drawn, clear_load, sign


def stribeck_friction(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """More friction at rest than in motion, by one of two laws."""
    motor = finger.motor
    motor.stribeck_form = float(rng.integers(2))
    motor.stribeck_speed = log_uniform(rng, 0.10, 0.22) * session.laboratory.top_speed
    motor.stribeck = strength * 4.5 * clear_load(session, rng)
    return Drawn(
        {
            "extra_static_raw": motor.stribeck,
            "speed_pct_s": motor.stribeck_speed,
            "static_ratio": 1 + motor.stribeck / motor.coulomb,
            "law": ["exp(-|v|/vs)", "1/(1+(v/vs)^2)"][int(motor.stribeck_form)],
        }
    )


def asymmetric_viscous_friction(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Viscous friction that differs between flexion and extension."""
    motor = finger.motor
    half_speed = 0.5 * session.laboratory.top_speed
    direction = sign(rng)
    motor.viscous_asymmetry = (
        strength * direction * min(clear_load(session, rng) * 2.2 / half_speed, 0.7 * motor.viscous)
    )
    return Drawn(
        {
            "viscous_flexion": motor.viscous + motor.viscous_asymmetry,
            "viscous_extension": motor.viscous - motor.viscous_asymmetry,
        }
    )


def asymmetric_friction(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Dry friction that differs between flexion and extension."""
    motor = finger.motor
    direction = sign(rng)
    motor.coulomb_asymmetry = strength * direction * min(2 * clear_load(session, rng), 0.4 * motor.coulomb)
    return Drawn(
        {
            "coulomb_flexion": motor.coulomb + motor.coulomb_asymmetry,
            "coulomb_extension": motor.coulomb - motor.coulomb_asymmetry,
        }
    )


def load_dependent_friction(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Dry friction that grows with the load; a stiffer spring lets it show."""
    motor = finger.motor
    if strength >= WEAK:
        motor.stiffness *= 1.5
        motor.coulomb *= 0.8
    share = 1.0 * clear_load(session, rng) / (motor.stiffness * 29)
    motor.load_friction = strength * float(np.clip(share, 0.12, 0.6))
    return Drawn({"friction_per_load": motor.load_friction})


def position_dependent_friction(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A tight spot."""
    motor = finger.motor
    motor.tight_spot = strength * 2.2 * clear_load(session, rng)
    motor.tight_centre = rng.uniform(20, 80)
    motor.tight_width = log_uniform(rng, 7, 14)
    return Drawn({"extra_raw": motor.tight_spot, "centre_pct": motor.tight_centre, "half_width_pct": motor.tight_width})


def quadratic_damping(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Drag with the speed squared, in exchange for viscous friction."""
    motor, top_speed = finger.motor, session.laboratory.top_speed
    motor.drag = strength * 7 * clear_load(session, rng) / top_speed**2
    if strength >= WEAK:
        motor.viscous *= 0.6
    return Drawn({"quadratic": motor.drag, "at_full_speed_raw": motor.drag * top_speed**2})


def elastoplastic_hysteresis(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A load that builds up over a distance after each reversal."""
    motor = finger.motor
    motor.hysteresis = strength * 2.2 * clear_load(session, rng)
    motor.hysteresis_distance = log_uniform(rng, 8, 18)
    return Drawn({"amplitude_raw": motor.hysteresis, "distance_pct": motor.hysteresis_distance})


def presliding_friction(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Soft bristles: a way to go before friction slides."""
    motor = finger.motor
    breakaway = log_uniform(rng, 0.7, 1.8)
    if strength < 1:
        breakaway = motor.breakaway + (breakaway - motor.breakaway) * strength
    motor.breakaway = breakaway
    return Drawn({"breakaway_pct": motor.breakaway})


def thermal_friction_drift(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Friction that falls as the motor warms; a thermometer may be logged."""
    motor, laboratory = finger.motor, session.laboratory
    motor.warming = -strength * min(3.5 * clear_load(session, rng), 0.6 * motor.coulomb)
    motor.warming_time = log_uniform(rng, 40, 110)
    if not laboratory.temperature_column:
        laboratory.temperature_column = bool(rng.integers(2))
    return Drawn({"change_raw": motor.warming, "time_constant_s": motor.warming_time})
