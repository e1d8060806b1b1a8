"""Every effect of the table: how it is drawn. Strength 1 is clear, 0.1 a trace; 0 would be the healthy hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .hand import Finger, unit
from .motor import BRISTLE

Settings = dict[str, dict[str, Any]]
Draw = Callable[[np.random.Generator, float, Finger], Settings]


@dataclass(frozen=True)
class Effect:
    """A row of the table; `station` is where it acts, `joint` and `signal` where it shows."""

    name: str
    station: str
    signal: str
    joint: str | None
    draw: Draw
    scalable: bool = True


def sign(rng: np.random.Generator) -> float:
    """Plus or minus one."""
    return 1.0 if rng.random() < 0.5 else -1.0


def direction(rng: np.random.Generator) -> np.ndarray:
    """A random unit vector."""
    return unit(rng.normal(0.0, 1.0, 3))


def stribeck(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Friction rises as speed falls."""
    return {"dyn": {"Fs_ratio": 1 + s * rng.uniform(0.5, 0.95), "vs": rng.uniform(12.0, 28.0)}}


def asymmetric_viscous(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """More drag in one direction."""
    side = "b_flex_ratio" if rng.random() < 0.5 else "b_ext_ratio"
    return {"dyn": {side: 1 + s * rng.uniform(0.8, 1.6)}}


def asymmetric_coulomb(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Coulomb friction differs by direction."""
    return {"dyn": {"fc_asym": s * sign(rng) * rng.uniform(0.2, 0.4)}}


def load_friction(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Friction grows with the spring load."""
    return {"dyn": {"load_mu": s * rng.uniform(0.35, 0.7)}}


def tight_spot(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """More friction in one part of the range."""
    return {
        "dyn": {"pos_amp": s * rng.uniform(0.6, 1.1), "pos_c": rng.uniform(30.0, 70.0), "pos_w": rng.uniform(5.0, 10.0)}
    }


def detent(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A load in one part of the range, the same both ways."""
    return {
        "dyn": {
            "detent_amp": s * sign(rng) * rng.uniform(14.0, 24.0),
            "detent_c": rng.uniform(25.0, 75.0),
            "detent_w": rng.uniform(4.0, 9.0),
        }
    }


def spring_shape(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The spring stiffens or softens with the cube of the angle."""
    shape = rng.uniform(0.8, 1.6) if rng.random() < 0.65 else -rng.uniform(0.6, 0.9)
    return {"dyn": {"spring_cubic": s * shape}}


def gravity(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Weight of the finger; the hand is turned over between the flexions."""
    out: Settings = {"dyn": {"gravity_amp": s * rng.uniform(14.0, 24.0)}}
    if s > 0.2:
        turn = np.array([sign(rng) * rng.uniform(1.6, 2.8), 0.0, 0.0]) + rng.normal(0.0, 0.15, 3)
        out["rec"] = {"turn_between_trials": turn.tolist()}
    return out


def ripple(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Load periodic in motor position."""
    return {
        "dyn": {
            "ripple_amp": s * rng.uniform(6.0, 11.0),
            "ripple_period": rng.uniform(5.0, 12.0),
            "ripple_phase": rng.uniform(0.0, 2 * np.pi),
        }
    }


def square_drag(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Drag with speed squared."""
    return {"dyn": {"quad": s * rng.uniform(0.0013, 0.0026)}}


def hysteresis(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A load that builds up over a distance after each reversal."""
    return {"dyn": {"plastic_amp": s * rng.uniform(10.0, 18.0), "plastic_dist": rng.uniform(6.0, 16.0)}}


def relaxing_spring(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A Maxwell element beside the spring."""
    return {"dyn": {"relax_k": s * rng.uniform(0.2, 0.4), "relax_tau": rng.uniform(0.5, 2.0)}}


def presliding(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Much softer bristles."""
    give = rng.uniform(5.0, 10.0)
    return {"dyn": {"bristle": BRISTLE / (1.0 + s * (BRISTLE / give - 1.0))}}


def end_stop(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """An elastic stop before the closed end."""
    return {"dyn": {"stop_k": s * rng.uniform(2.0, 4.0), "stop_x": rng.uniform(80.0, 89.0)}}


def warming(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Friction of a cold drive that fades with session time."""
    return {"dyn": {"thermal_amp": s * rng.uniform(0.35, 0.6), "thermal_tau": rng.uniform(40.0, 120.0)}}


def drive_play(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Lost motion before the proximal joint (plus or minus, rad)."""
    return {"kin": {"drive_play": s * rng.uniform(0.015, 0.03)}}


def series_give(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Give before the proximal joint, rad per 100 raw."""
    return {"kin": {"series_give": s * rng.uniform(0.025, 0.05)}}


def linkage_play(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Lost motion between the joints (plus or minus, rad)."""
    return {"kin": {"linkage_play": s * rng.uniform(0.015, 0.03)}}


def linkage_give(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Give between the joints, rad per 100 raw."""
    return {"kin": {"linkage_give": s * rng.uniform(0.03, 0.06)}}


def deadband(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The distal joint waits for a share of the proximal range."""
    return {"kin": {"deadband": s * rng.uniform(0.07, 0.14)}}


def distal_stop(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The distal joint stops at a share of its range."""
    return {"kin": {"distal_stop": 0.96 - s * rng.uniform(0.06, 0.16)}}


def decoupling(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The finger hangs ahead of its drive near open, or is pushed ahead three times."""
    if rng.random() < 0.35:
        return {"kin": {"hang_angle": s * rng.uniform(0.07, 0.14)}}
    starts = rng.uniform(0.03, 0.15) + np.cumsum(rng.uniform(0.22, 0.32, 3)) - 0.2
    windows = [[float(a), float(a + rng.uniform(0.10, 0.18))] for a in starts]
    return {"kin": {"lift_windows": windows, "lift_angle": s * rng.uniform(0.3, 0.6)}}


def contact(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A springy object in the way for a part of each trial."""
    start = rng.uniform(0.3, 0.5)
    return {
        "dyn": {
            "contact_k": s * rng.uniform(1.0, 2.0),
            "contact_x": rng.uniform(55.0, 75.0),
            "contact_window": [start, start + rng.uniform(0.3, 0.45)],
        }
    }


def wobble(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A second rotation about an axis across the first."""
    return {
        "kin": {
            "wobble_amp": s * rng.uniform(0.03, 0.06),
            "wobble_waves": float(rng.choice([1.0, 2.0])),
            "wobble_joint": int(rng.random() < 0.3),
            "wobble_direction": direction(rng).tolist(),
        }
    }


def travelling_centre(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The centre of a joint travels with its angle."""
    joint = int(rng.random() < 0.3)
    axis = finger.axes[joint]
    across = unit(np.cross(axis, direction(rng)))
    return {"kin": {"travel": (s * rng.uniform(0.002, 0.004) * across).tolist(), "travel_joint": joint}}


def encoder_wave(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Reading error periodic in counts."""
    return {
        "rec": {
            "encoder_amp": s * rng.uniform(25.0, 55.0),
            "encoder_period": rng.uniform(300.0, 1000.0),
            "encoder_phase": rng.uniform(0.0, 2 * np.pi),
        }
    }


def sagging(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The drive delivers less the more it is asked for."""
    return {"dyn": {"sag": s * rng.uniform(0.18, 0.32)}}


def late_command(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The drive acts later than its log says."""
    return {"dyn": {"command_delay": s * rng.uniform(0.06, 0.15)}}


def saturation(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The reading clips, or the drive does."""
    motor = finger.motor
    holding = motor.Fc + motor.tau0 + 100.0 * motor.k  # needed to creep at full flexion
    top = holding + 115.0 * motor.b
    slack = 30.0 * (1.0 - s) ** 4  # a trace of it must not bite because other loads are there too
    if rng.random() < 0.3:
        return {"dyn": {"limit": slack + top + 8.0 - s * (0.75 + 0.15 * rng.random()) * (top + 8.0 - holding)}}
    return {"rec": {"clip": float(np.round(slack + top + 5.0 - s * rng.uniform(0.2, 0.35) * top))}}


def current_late(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Current sampled later or earlier than position."""
    return {"rec": {"current_delay": s * (1.0 if rng.random() < 0.75 else -1.0) * rng.uniform(0.03, 0.08)}}


def faked_channel(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A command, or nothing, in place of a measurement."""
    which = str(rng.choice(["position_is_setpoint", "position_is_reference", "current_is_dead"]))
    return {"rec": {"faked": which, "dead_value": int(rng.integers(0, 12))}}


def skew(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """The log clock runs fast or slow."""
    return {"rec": {"skew": 1 + s * sign(rng) * rng.uniform(0.0008, 0.002)}}


def slip(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """One marker jumps in each trial."""
    vector = s * rng.uniform(0.0013, 0.003) * direction(rng)
    return {
        "marker": {
            "slip": [int(rng.integers(0, 2)), int(rng.integers(0, 3)), rng.uniform(0.25, 0.7), vector.tolist()],
            "slip_frame": "segment" if rng.random() < 0.5 else "palm",
        }
    }


def support_turn(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A whole support turns about its foot in each trial."""
    rotvec = s * rng.uniform(0.05, 0.1) * direction(rng)
    return {"marker": {"support": [int(rng.integers(0, 2)), rng.uniform(0.25, 0.7), rotvec.tolist()]}}


def palm_slip(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """A palm marker jumps in each trial."""
    vector = s * rng.uniform(0.0015, 0.0035) * direction(rng)
    return {"marker": {"palm_slip": [int(rng.integers(0, 3)), rng.uniform(0.25, 0.7), vector.tolist()]}}


def swapped(rng: np.random.Generator, s: float, finger: Finger) -> Settings:
    """Two labels of a segment exchanged for a while."""
    segment = int(rng.integers(0, 2))
    swaps = []
    for start in rng.uniform(0.1, 0.85, max(1, round(3 * s))):
        i, j = rng.choice(3, 2, replace=False)
        labels = finger.labels
        swaps.append(
            [labels[3 * segment + i], labels[3 * segment + j], float(start), max(5, int(s * rng.uniform(60, 220)))]
        )
    return {"marker": {"swaps": swaps}}


EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Effect("stribeck_friction", "dyn", "current", None, stribeck),
        Effect("asymmetric_viscous_friction", "dyn", "current", None, asymmetric_viscous),
        Effect("asymmetric_friction", "dyn", "current", None, asymmetric_coulomb),
        Effect("load_dependent_friction", "dyn", "current", None, load_friction),
        Effect("position_dependent_friction", "dyn", "current", None, tight_spot),
        Effect("detent_load", "dyn", "current", None, detent),
        Effect("nonlinear_spring", "dyn", "current", None, spring_shape),
        Effect("gravity_load", "dyn", "current", None, gravity),
        Effect("torque_ripple", "dyn", "current", None, ripple),
        Effect("quadratic_damping", "dyn", "current", None, square_drag),
        Effect("elastoplastic_hysteresis", "dyn", "current", None, hysteresis),
        Effect("viscoelastic_spring", "dyn", "current", None, relaxing_spring),
        Effect("presliding_friction", "dyn", "current", None, presliding),
        Effect("end_stop_contact", "dyn", "current", None, end_stop),
        Effect("thermal_friction_drift", "dyn", "current", None, warming),
        Effect("drive_backlash", "kin", "markers", "proximal", drive_play),
        Effect("series_elasticity", "kin", "markers", "proximal", series_give),
        Effect("linkage_backlash", "kin", "markers", "distal", linkage_play),
        Effect("linkage_compliance", "kin", "markers", "distal", linkage_give),
        Effect("coupling_deadband", "kin", "markers", "distal", deadband),
        Effect("distal_stop", "kin", "markers", "distal", distal_stop),
        Effect("spring_decoupling", "kin", "markers", "proximal", decoupling),
        Effect("external_contact", "dyn", "current", None, contact),
        Effect("joint_wobble", "kin", "markers", "proximal", wobble),
        Effect("moving_centre", "kin", "markers", "proximal", travelling_centre),
        Effect("encoder_periodic_error", "rec", "position", "proximal", encoder_wave),
        Effect("drive_sag", "dyn", "current", None, sagging),
        Effect("command_delay", "dyn", "position", None, late_command),
        Effect("current_saturation", "rec", "current", None, saturation),
        Effect("current_channel_delay", "rec", "current", None, current_late),
        Effect("command_as_measurement", "rec", "log", None, faked_channel, scalable=False),
        Effect("clock_drift", "rec", "log", None, skew),
        Effect("marker_slip", "marker", "markers", None, slip),
        Effect("support_slip", "marker", "markers", None, support_turn),
        Effect("palm_marker_slip", "marker", "markers", None, palm_slip),
        Effect("marker_swap", "marker", "markers", None, swapped),
    )
}
