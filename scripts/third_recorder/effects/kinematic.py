"""Effects between motor and segments. Angles in degrees where they are given, in radians where they are kept."""

from __future__ import annotations

import numpy as np

from ..geometry import RAD, Array, log_uniform
from ..hand import Finger, Session
from ..kinematics import MovingCentre, Wobble
from .draw import TRACE, Drawn, clear_angle, visible_deg

COARSE_MM = 0.15  # marker noise above which the shape of the coupling needs a larger change


def coarse(session: Session) -> float:
    """Factor on changes of the coupling's shape."""
    return 1.3 if session.laboratory.marker_noise > COARSE_MM else 1


def spring_decoupling(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A hand pushes the finger on beyond its drive."""
    lift = finger.faults.lift = strength * log_uniform(rng, 4, 9)
    return Drawn({"lift_pct": lift, "trials": "two or more intervals a flexion trial"})


def drive_backlash(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Play between motor and proximal joint."""
    gap = strength * clear_angle(session, rng)
    finger.linkage.drive_play = gap / np.degrees(finger.linkage.full[0]) * 100
    return Drawn({"play_deg": gap})


def series_elasticity(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Give between motor and proximal joint."""
    linkage, motor = finger.linkage, finger.motor
    gap = strength * 1.3 * clear_angle(session, rng)
    share = linkage.give_share = rng.uniform(0.1, 0.25)
    reach = share * motor.coulomb + 0.9 * motor.viscous * session.laboratory.top_speed * 0.6
    linkage.give = gap / (2 * reach) * RAD
    return Drawn({"deg_per_raw": linkage.give / RAD, "share_of_coulomb_on_finger_side": share})


def linkage_backlash(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Play between the joints."""
    gap = strength * 1.5 * clear_angle(session, rng)
    finger.linkage.linkage_play = gap * RAD
    return Drawn({"play_deg_proximal": gap})


def linkage_compliance(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Give between the joints."""
    linkage, motor = finger.linkage, finger.motor
    gap = strength * 2.0 * clear_angle(session, rng)
    share = linkage.linkage_share = rng.uniform(0.1, 0.25)
    reach = share * motor.coulomb + 0.8 * motor.viscous * session.laboratory.top_speed * 0.6
    linkage.linkage_give = gap / (2 * reach) * RAD
    return Drawn({"deg_per_raw": linkage.linkage_give / RAD})


def coupling_deadband(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A distal joint that stays at first."""
    linkage = finger.linkage
    linkage.deadband = strength * log_uniform(rng, 0.2, 0.3) * coarse(session)
    return Drawn({"deadband_deg": linkage.deadband * np.degrees(linkage.full[0])})


def distal_stop(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A distal joint that stops before its end."""
    linkage = finger.linkage
    linkage.stop = 1 - strength * log_uniform(rng, 0.15, 0.25) * coarse(session)
    return Drawn({"stop_deg": linkage.stop * np.degrees(linkage.full[1])})


def joint_wobble(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A joint's axis that tilts."""
    joint = int(rng.integers(2))
    amplitude = strength * 1.2 * visible_deg(session) * log_uniform(rng, 1, 2)
    follows = str(rng.choice(["angle", "angle", "direction"]))
    finger.linkage.wobble = Wobble(
        joint,
        amplitude * RAD,
        across=rng.uniform(0, 6.28),
        waves=rng.uniform(1.1, 1.7),
        phase=rng.uniform(0, 6.28),
        follows=follows,
    )
    return Drawn({"amplitude_deg": amplitude, "follows": follows}, joint)


def moving_centre(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A joint's centre that travels farther than another fixed centre explains."""
    joint = int(rng.integers(2))
    rms = strength * max(0.35, 2.2 * session.laboratory.marker_noise) * log_uniform(rng, 1, 1.8)
    towards, power = rng.uniform(0, 6.28), rng.uniform(1.5, 2.6)
    wanted = rms / beyond_fixed_centre(finger.linkage.full[joint], towards, power)
    path = float(min(wanted, 15 * max(strength, TRACE)))
    finger.linkage.moving_centre = MovingCentre(joint, path, towards, power)
    return Drawn({"path_mm": path, "rms_beyond_fixed_centre_mm": path / wanted * rms}, joint)


def beyond_fixed_centre(full: float, towards: float, power: float) -> float:
    """RMS distance [mm] per mm of path between a travelling centre and the best fixed one, over an angle [rad]."""
    y = np.linspace(0, 1, 80)
    path: Array = np.c_[np.cos(towards) * y**power, np.sin(towards) * y**power + 0.3 * np.sin(np.pi * y)]
    c, s = np.cos(full * y), np.sin(full * y)
    fixed = np.zeros((160, 4))  # what another centre (two numbers) and another place of the segment would do
    fixed[0::2, 0], fixed[0::2, 1], fixed[0::2, 2] = 1 - c, s, 1
    fixed[1::2, 0], fixed[1::2, 1], fixed[1::2, 3] = -s, 1 - c, 1
    flat = path.reshape(-1)
    left = flat - fixed @ np.linalg.lstsq(fixed, flat, rcond=None)[0]
    return float(np.sqrt((left**2).mean() * 2))
