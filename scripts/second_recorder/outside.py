"""Real things that the table has no name for."""

from __future__ import annotations

import numpy as np

from .effects import Draw, Settings, direction, sign
from .hand import Finger


def current_gain_drift(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The gain of the current reading drifts with session time."""
    return {"rec": {"gain_drift": sign(rng) * rng.uniform(0.3, 0.45)}}


def acceleration_friction(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Friction grows with acceleration."""
    return {"dyn": {"accel_friction": rng.uniform(0.03, 0.05)}}


def friction_jump(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Friction jumps for good at one moment of the session."""
    return {"dyn": {"jump_ratio": rng.uniform(0.35, 0.6), "jump_at": rng.uniform(18.0, 32.0)}}


def broken_tooth(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A bump that opposes every third pass."""
    return {
        "dyn": {
            "tooth_amp": rng.uniform(25.0, 40.0),
            "tooth_c": rng.uniform(30.0, 70.0),
            "tooth_w": rng.uniform(1.5, 3.0),
        }
    }


def lens_distortion(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A radial distortion of the camera volume."""
    return {"rec": {"lens": sign(rng) * rng.uniform(2.0, 3.5)}}


def palm_bends(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A palm marker gives way with the load of the drive."""
    return {"marker": {"bend": [int(rng.integers(0, 3)), (rng.uniform(0.0015, 0.0025) * direction(rng)).tolist()]}}


def supply_ripple(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A slow wave on the current reading."""
    return {
        "rec": {
            "supply_amp": rng.uniform(9.0, 14.0),
            "supply_hz": rng.uniform(0.35, 1.3),
            "supply_phase": rng.uniform(0.0, 2 * np.pi),
        }
    }


def dwell_friction(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Breakaway that grows with the time at rest."""
    return {
        "dyn": {
            "dwell_amp": rng.uniform(30.0, 45.0),
            "dwell_tau": rng.uniform(0.25, 0.6),
            "dwell_dist": rng.uniform(3.0, 7.0),
        }
    }


def fast_spring(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A second spring that engages only in fast motion."""
    return {
        "dyn": {
            "fast_spring_k": rng.uniform(0.6, 1.0),
            "fast_spring_x": rng.uniform(40.0, 60.0),
            "fast_spring_v": rng.uniform(55.0, 70.0),
        }
    }


def crosstalk(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The other motor, busy meanwhile, leaks into the current channel."""
    return {"rec": {"crosstalk": sign(rng) * rng.uniform(0.2, 0.35)}}


def tissue_swing(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Distal markers swing with their acceleration."""
    return {
        "marker": {
            "swing_hz": rng.uniform(4.0, 7.0),
            "swing_damping": rng.uniform(0.08, 0.2),
            "swing_gain": rng.uniform(0.7, 1.2),
        }
    }


def vibration(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Somebody shakes the finger for a while."""
    start = rng.uniform(0.15, 0.45)
    return {
        "dyn": {
            "shake_amp": rng.uniform(11.0, 18.0),
            "shake_hz": rng.uniform(2.5, 6.0),
            "shake_window": [start, start + rng.uniform(0.3, 0.5)],
        }
    }


def lost_counts(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The encoder loses counts at some moments."""
    moments = np.sort(rng.uniform(0.1, 0.9, 4))
    return {"rec": {"lost_counts": [[float(moment), int(rng.integers(50, 120))] for moment in moments]}}


def support_creep(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A support turns slowly all the time."""
    return {"marker": {"creep": [int(rng.integers(0, 2)), (rng.uniform(0.08, 0.14) * direction(rng)).tolist()]}}


def damped_linkage(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The distal joint follows with a lag."""
    return {"kin": {"linkage_lag": rng.uniform(0.04, 0.08)}}


def lost_frames(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The cameras drop frames without saying so."""
    moments = np.sort(rng.uniform(0.1, 0.9, 3))
    return {"rec": {"lost_frames": [[float(moment), int(rng.integers(6, 15))] for moment in moments]}}


OUTSIDE: dict[str, tuple[Draw, str]] = {
    "current_gain_drift": (current_gain_drift, "current"),
    "acceleration_friction": (acceleration_friction, "current"),
    "friction_jump": (friction_jump, "current"),
    "broken_tooth": (broken_tooth, "current"),
    "lens_distortion": (lens_distortion, "markers"),
    "palm_bends": (palm_bends, "markers"),
    "supply_ripple": (supply_ripple, "current"),
    "dwell_friction": (dwell_friction, "current"),
    "fast_spring": (fast_spring, "current"),
    "crosstalk": (crosstalk, "current"),
    "tissue_swing": (tissue_swing, "markers"),
    "vibration": (vibration, "current"),
    "lost_counts": (lost_counts, "position"),
    "support_creep": (support_creep, "markers"),
    "damped_linkage": (damped_linkage, "markers"),
    "lost_frames": (lost_frames, "markers"),
}
