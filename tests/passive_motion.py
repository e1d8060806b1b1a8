"""Effects with parameters, and the motion of drive and finger under which file and columns are compared."""

from __future__ import annotations

import numpy as np

from hand_model.effects.base import DriveState
from hand_model.effects.path import dahl

GIVE, UNIT = 0.8, 2.0
DECLARED = {"inertia": 0.012, "viscous": 0.15, "coulomb": 35.0, "spring": 0.22, "preload": 9.0}
SAG = 0.15  # of the effort, lost at 100 raw
# shape, amplitude, share of the effect's size by which file and column may differ in 99 % of the samples
DRIVE = [
    ("asymmetric_viscous_friction", {}, {"half_difference": 0.08}, 0.01),
    ("current_channel_delay", {"form": 0.0, "delay": 0.04}, {}, 0.03),
    ("current_channel_delay", {"form": 0.0, "delay": -0.05}, {}, 0.03),
    ("current_saturation", {"limit": 45.0}, {}, 0.02),
    ("current_saturation", {"form": 2.0, "limit": 20.0}, {}, 0.02),
    ("detent_load", {"form": 0.0, "centre": 40.0, "width": 6.0}, {"load": -12.0}, 0.01),
    ("detent_load", {"form": 1.0, "centre": 60.0, "width": 4.0}, {"load": 12.0}, 0.01),
    ("drive_sag", {"form": 0.0}, {"torque_loss": SAG}, 0.01),
    ("drive_sag", {"form": 2.0, "lag": 0.3}, {"torque_loss": SAG}, 0.01),
    ("drive_sag", {"form": 3.0}, {"torque_loss": SAG}, 0.01),
    ("elastoplastic_hysteresis", {"form": 0.0, "reach": 15.0}, {"yield_load": 14.0}, 0.02),
    ("elastoplastic_hysteresis", {"form": 1.0, "reach": 12.0}, {"yield_load": 14.0}, 0.02),
    ("end_stop_contact", {"side": 1.0, "begin": 82.0, "end": 97.0, "inward": 15.0}, {"stiffness": 1.5}, 0.01),
    ("end_stop_contact", {"side": -1.0, "begin": 12.0, "end": 0.0, "inward": 12.0}, {"stiffness": 1.5}, 0.01),
    (
        "end_stop_contact",
        {"side": 1.0, "form": 1.0, "loss": 0.008, "begin": 82.0, "end": 97.0, "inward": 15.0},
        {"stiffness": 1.5},
        0.01,
    ),
    (
        "end_stop_contact",
        {"side": -1.0, "form": 2.0, "lag": 0.06, "begin": 12.0, "end": 0.0, "inward": 12.0},
        {"stiffness": 1.5},
        0.02,
    ),
    ("gravity_load", {"sweep": 1.3}, {"along": 9.0, "across": -4.0}, 0.01),
    ("load_dependent_friction", {}, {"per_load": 0.2}, 0.02),
    ("nonlinear_spring", {}, {"cubic_stiffness": 3e-5}, 0.01),
    ("position_dependent_friction", {"centre": 45.0, "width": 7.0}, {"extra_friction": 20.0}, 0.02),
    ("presliding_friction", {"bristle_length": 6.0}, {}, 0.02),
    ("quadratic_damping", {}, {"drag": 0.002}, 0.01),
    ("stribeck_friction", {"stribeck_speed": 18.0}, {"static_excess": 25.0}, 0.06),
    ("thermal_friction_drift", {"form": 0.0, "warm_up_time": 30.0, "cooling_time": 90.0}, {"cold_excess": 12.0}, 0.02),
    ("thermal_friction_drift", {"form": 3.0, "warm_up_time": 8.0, "cooling_time": 90.0}, {"cold_excess": 12.0}, 0.02),
    ("torque_ripple", {"period": 9.0}, {"sine": 4.0, "cosine": 3.0}, 0.01),
    ("viscoelastic_spring", {"relaxation_time": 1.2}, {"stiffness": 0.3}, 0.01),
]
MOTOR_NAMES = {
    "inertia": "inertia",
    "viscous": "viscous",
    "coulomb": "coulomb",
    "spring": "stiffness",
    "preload": "preload",
}


def state(until_s: float = 24.0, elapsed_s: float = 5.0) -> DriveState:
    """A drive that moves over its range at several speeds and rests between."""
    t = np.arange(0.0, until_s, 0.018)
    knots = np.array([0.0, 1, 3, 4, 5.5, 6, 7.2, 8, 12, 13, 17, 18, 19.2, 20, 22, 24])
    level = np.array([0.0, 0, 97, 97, 20, 20, 80, 80, 5, 5, 95, 95, 30, 30, 0, 0])
    fine = np.arange(-1.0, 25.0, 0.001)
    kernel = np.exp(-0.5 * (np.arange(-400, 401) / 120) ** 2)
    smooth = np.convolve(np.pad(np.interp(fine, knots, level), 400, mode="edge"), kernel / kernel.sum(), mode="valid")
    x, v, a = (
        np.interp(t, fine, y) for y in (smooth, np.gradient(smooth, fine), np.gradient(np.gradient(smooth, fine), fine))
    )
    declared = np.stack([a, v, dahl(x, GIVE), x, np.ones_like(x)], axis=-1)
    extra = {
        "bandwidth_s": 0 * t,
        "give": 0 * t + GIVE,
        "elapsed": t + elapsed_s,
        "gravity_along": 0 * t + 3.0,
        "gravity_across": 0 * t - 9.0,
        "gravity_x": 0 * t + 3.0,
        "gravity_z": 0 * t - 9.0,
    }
    needed = declared @ np.array(list(DECLARED.values()))
    # u (1 - SAG |u| / 100) = needed
    extra["required"] = np.sign(needed) * (1 - np.sqrt(1 - 4 * SAG / 100 * np.abs(needed))) / (2 * SAG / 100)
    return DriveState("log/a.csv", "index", t, x, v, a, 0 * x, declared, declared_names=tuple(DECLARED), extra=extra)


def every(found, amplitude: dict[str, float]) -> dict[str, float]:
    """All amplitudes of an effect, zero where none is given."""
    return {a[0]: amplitude.get(a[0], 0.0) for a in found.amplitudes()}


FINGER = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast"/><worldbody><body name="palm">
<body name="index_proximal_link"><inertial pos="0.02 0 0" mass="0.01" diaginertia="1e-6 1e-6 1e-6"/>
<joint name="index_proximal" type="hinge" axis="0 1 0" armature="1e-4" damping="1e-3"/>
<body name="index_distal_link" pos="0.04 0 0"><inertial pos="0.01 0 0" mass="0.005" diaginertia="1e-6 1e-6 1e-6"/>
<joint name="index_distal" type="hinge" axis="0 1 0"/></body></body></body></worldbody>
<equality><joint name="index_linkage" joint1="index_distal" joint2="index_proximal" polycoef="0.02 0.7 0.15 0 0" solref="0.002 1"
 solimp="0.9999 0.9999 0.001 0.5 2"/></equality></mujoco>"""
# rad over the share of the range; over rad
ENCODER, LINKAGE = np.array([0.02, 1.1, 0.25, -0.1]), np.array([0.02, 0.7, 0.15, 0.0, 0.0])
KINEMATIC = [
    ("drive_backlash", {"gap": 2.5, "form": 0.0}, {}),
    ("drive_backlash", {"gap": 2.5, "form": 2.0}, {}),
    ("drive_backlash", {"gap": 2.5, "form": 4.0, "reach": 3.0}, {}),
    ("series_elasticity", {"form": 0.0}, {"compliance": 0.02, "drag_compliance": 0.0}),
    ("series_elasticity", {"form": 1.0}, {"compliance": 0.02, "drag_compliance": 0.0}),
    ("linkage_backlash", {"gap": 2.0, "form": 0.0}, {}),
    ("linkage_backlash", {"gap": 2.0, "form": 2.0}, {}),
    ("linkage_backlash", {"gap": 2.0, "form": 4.0, "reach": 3.0}, {}),
    ("linkage_compliance", {"form": 0.0}, {"compliance": 0.03, "drag_compliance": 0.0}),
    ("linkage_compliance", {"form": 1.0}, {"compliance": 0.02, "drag_compliance": 0.0}),
    ("series_elasticity", {"form": 2.0, "lag": 0.25}, {"compliance": 0.02, "drag_compliance": 0.0}),
    ("series_elasticity", {"form": 5.0}, {"compliance": 0.02, "drag_compliance": 0.03}),
    ("linkage_compliance", {"form": 3.0, "lag": 0.2}, {"compliance": 0.03, "drag_compliance": 0.0}),
    ("linkage_compliance", {"form": 4.0}, {"compliance": 0.01, "drag_compliance": 0.04}),
    ("series_elasticity", {"form": 7.0, "stiff": 30.0}, {"compliance": 0.03, "drag_compliance": 0.0}),
    ("linkage_compliance", {"form": 6.0, "stiff": 40.0}, {"compliance": 0.03, "drag_compliance": 0.0}),
    ("linkage_compliance", {"form": 9.0, "lag": 0.1}, {"compliance": 0.03, "drag_compliance": 0.06}),
    ("coupling_deadband", {"until": 15.0, "corner": 0.1}, {}),
    ("coupling_deadband", {"until": 8.0, "corner": 2.5}, {}),
    ("distal_stop", {"from": 50.0, "passing": 0.0}, {}),
    ("distal_stop", {"from": 50.0, "passing": 0.2}, {}),
]
