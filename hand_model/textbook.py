"""What a finding's parameters should read, from how the twin's answer says the same: its law, form and units are its
own.

Only where the hidden form's law has that parameter: a bell fitted to a trapezoid has a centre, but no height of its
own; a compliance is known up to the share of friction that sits behind it, which no recording of angles tells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

Read = Callable[[Mapping[str, Any]], float]


def _same(name: str, factor: float = 1.0) -> Read:
    return lambda p: factor * p[name]


def _signed(name: str) -> Read:
    return lambda p: p[name] * p["sign"]


def _viscous_ratio(p: Mapping[str, Any]) -> float:
    """Flexion over extension of b (1 +- d); `one_sided` puts 1.5 d b on one way."""
    return (1 + p["share"] * p["sign"]) / (1 - p["share"] * p["sign"])


EVERY = None  # of the forms
# effect -> form -> parameter of the finding -> from the answer's parameters
READINGS: Mapping[str, Mapping[str | None, Mapping[str, Read]]] = {
    "asymmetric_friction": {EVERY: {"half_difference": _signed("half_difference_raw")}},
    "asymmetric_viscous_friction": {"absolute": {"ratio": _viscous_ratio}},
    "clock_drift": {EVERY: {"rate_minus_one": _signed("rate_error")}},
    "command_delay": {EVERY: {"delay": _same("delay_s")}},
    "coupling_deadband": {"hard": {"until": _same("deadband_rad", math.degrees(1.0))}},
    "current_channel_delay": {"delay": {"delay": _same("delay_s")}, "early": {"delay": _same("delay_s", -1.0)}},
    "current_saturation": {"reading": {"limit": _same("level_raw")}, "drive": {"limit": _same("level_raw")}},
    "detent_load": {
        "gaussian": {"load": _signed("height_raw"), "width": _same("width_percent")},
        EVERY: {"centre": _same("centre_percent")},
    },
    "drive_backlash": {EVERY: {"gap": _same("gap_percent")}},
    "drive_sag": {"torque": {"torque_loss": _same("share_per_100_raw")}},
    "elastoplastic_hysteresis": {
        "linear": {"yield_load": _same("level_raw")},
        "exponential": {"yield_load": _same("level_raw")},
    },
    "encoder_periodic_error": {EVERY: {"period": _same("period_percent")}},
    "end_stop_contact": {
        "linear": {"begin": _same("at_percent"), "stiffness": _same("stiffness_raw")},
        "open_side": {"begin": _same("at_percent"), "stiffness": _same("stiffness_raw", 1.8)},
    },
    "external_contact": {"stiff": {"begin": _same("at_percent"), "stiffness": _same("stiffness_raw")}},
    "linkage_backlash": {"play": {"gap": _same("gap_rad", math.degrees(1.0))}},
    "load_dependent_friction": {"transmitted": {"load_coefficient": _same("share")}},
    "marker_slip": {EVERY: {"distance": _same("distance_m")}},
    "moving_centre": {
        "ellipse": {"travel": _same("travel_m", 1.2)},  # its radius is 0.6 of the figure
        EVERY: {"travel": _same("travel_m")},
    },
    "nonlinear_spring": {"knee": {"knee": _same("knee_percent")}},
    "palm_marker_slip": {EVERY: {"distance": _same("distance_m")}},
    "position_dependent_friction": {
        "gaussian": {"extra_friction": _same("height_raw"), "width": _same("width_percent")},
        EVERY: {"centre": _same("centre_percent")},
    },
    "presliding_friction": {
        EVERY: {"bristle_length": _same("give_percent")},
        "lugre": {"bristle_time": _same("bristle_damping_raw")},
    },
    "quadratic_damping": {"square": {"drag": _same("drag_at_100_raw", 1e-4)}},
    "stribeck_friction": {
        f: {"static_excess": _same("static_excess_raw"), "stribeck_speed": _same("stribeck_speed")}
        for f in ("exponential", "gaussian")
    },
    "support_slip": {EVERY: {"turn": _same("angle_rad")}},
    "thermal_friction_drift": {
        "motion": {"cold_excess": lambda p: -p["change_raw"] * p["sign"], "warm_up_time": _same("warming_s")}
    },
    "torque_ripple": {"sine": {"amplitude": _same("amplitude_raw")}, EVERY: {"period": _same("period_percent")}},
    "viscoelastic_spring": {
        "maxwell": {"stiffness": _same("branch_stiffness"), "relaxation_time": _same("relaxation_s")}
    },
}


def readings(hidden: Mapping[str, Any]) -> dict[str, float]:
    """Parameters by the names of a finding, in its units, of one effect of an answer; none where the two laws have none
    in common."""
    forms = READINGS.get(hidden["effect"], {})
    own = {**forms.get(EVERY, {}), **forms.get(hidden.get("form"), {})}
    return {name: float(read(hidden["parameters"])) for name, read in own.items()}
