"""What a finding should read of an effect that was hidden: by effect, the figures that both have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

# From an effect's figures f, and its finger's full angles and motor ("motor", m) before anything was hidden in it.
READINGS: dict[str, Callable[[dict[str, Any], dict[str, Any], dict[str, float]], dict[str, float]]] = {
    "stribeck_friction": lambda f, g, m: {"static_ratio": f["static_ratio"], "stribeck_speed": f["stribeck_speed"]},
    "asymmetric_viscous_friction": lambda f, g, m: {"viscous_flexion": m["viscous"], "viscous_extension": m["viscous"] * (1 + f["viscous_asymmetry"])},
    "asymmetric_friction": lambda f, g, m: {"half_difference": -0.5 * m["coulomb"] * f["coulomb_asymmetry"]},
    "load_dependent_friction": lambda f, g, m: {"load_coefficient": f["load_friction"]},
    "position_dependent_friction": lambda f, g, m: {"centre": f["tight_centre"], "width": f["tight_width"], "ratio": f["tight_spot"]},
    "detent_load": lambda f, g, m: {"centre": f["detent_centre"], "width": f["detent_width"], "load": f["detent"]} if f["detent_form"] < 0.5 else {"centre": f["detent_centre"]},
    "nonlinear_spring": lambda f, g, m: {"quadratic_stiffness": f["square_spring"] / 1e4} if "square_spring" in f else {"cubic_stiffness": f["cubic_spring"] / 1e6},
    "torque_ripple": lambda f, g, m: {"amplitude": f["ripple"], "period": f["ripple_period"]},
    "quadratic_damping": lambda f, g, m: {"drag": f["drag"]},
    "elastoplastic_hysteresis": lambda f, g, m: {"yield_load": f["hysteresis"], "reach": f["hysteresis_distance"]},
    "viscoelastic_spring": lambda f, g, m: {"stiffness": f["relaxing_stiffness"], "relaxation_time": f["relaxation_time"]},
    "presliding_friction": lambda f, g, m: {"bristle_length": m["coulomb"] / f["bristle_stiffness"]},
    "end_stop_contact": lambda f, g, m: {"begin": f["stop"], "stiffness": f["stop_stiffness"]},
    "thermal_friction_drift": lambda f, g, m: {"ratio": f["warming"], "warm_up_time": f["warming_time"]},
    "drive_backlash": lambda f, g, m: {"segment_gap": float(np.rad2deg(2 * f["drive_play"]))},
    "linkage_backlash": lambda f, g, m: {"gap": float(np.rad2deg(2 * f["linkage_play"]))},
    "coupling_deadband": lambda f, g, m: {"until": float(np.rad2deg(f["deadband"]))},
    "distal_stop": lambda f, g, m: {"stops_at": float(np.rad2deg(f["distal_limit"] * g["full_angles"][1]))},
    "external_contact": lambda f, g, m: {"begin": f["place"], "stiffness": f["stiffness"]},
    "joint_wobble": lambda f, g, m: {"amplitude": f["angle"]},
    "moving_centre": lambda f, g, m: {"travel": 1e-3 * abs(f["distance"])},
    "command_delay": lambda f, g, m: {"delay": f["command_delay"]},
    "current_channel_delay": lambda f, g, m: {"delay": f["current_late_s"]},
    "current_saturation": lambda f, g, m: {"limit": f["level"]},
    "clock_drift": lambda f, g, m: {"rate_minus_one": f["skew"] - 1},
    "marker_slip": lambda f, g, m: {"distance": 1e-3 * float(np.linalg.norm(f["shift"]))},
    "palm_marker_slip": lambda f, g, m: {"distance": 1e-3 * float(np.linalg.norm(f["shift"]))},
    "support_slip": lambda f, g, m: {"turn": abs(f["angle"])},
}  # fmt: skip


def truth(hidden: dict[str, Any], answer: dict[str, Any]) -> dict[str, float]:
    """What a finding of a hidden effect should read, from the answer of its session; empty where they share nothing."""
    if hidden["effect"] not in READINGS:
        return {}
    finger = answer["settings"]["session"]["hand"]["fingers"][hidden["finger"]]
    return READINGS[hidden["effect"]](hidden["figures"], finger, finger["motor"])
