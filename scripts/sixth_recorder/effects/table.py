"""All effects by name. Their order is part of what a seed means."""

from __future__ import annotations

from typing import NamedTuple

from sixth_recorder.effects import drive, friction, kinematics, loads, markers, outside, recording
from sixth_recorder.effects.law import Draw


class Effect(NamedTuple):
    """channel: by what it is sized: current, kin (markers), fixed (drawn) or none; of a group, a pair has only one."""

    draw: Draw
    channel: str
    group: str


VOCABULARY: dict[str, Effect] = {
    "stribeck_friction": Effect(friction.stribeck_friction, "current", "friction"),
    "asymmetric_viscous_friction": Effect(friction.asymmetric_viscous_friction, "current", "viscous"),
    "asymmetric_friction": Effect(friction.asymmetric_friction, "none", "friction"),
    "load_dependent_friction": Effect(friction.load_dependent_friction, "current", "friction"),
    "position_dependent_friction": Effect(friction.position_dependent_friction, "current", "place"),
    "detent_load": Effect(loads.detent_load, "current", "place"),
    "nonlinear_spring": Effect(loads.nonlinear_spring, "current", "spring"),
    "gravity_load": Effect(loads.gravity_load, "current", "spring"),
    "torque_ripple": Effect(loads.torque_ripple, "current", "ripple"),
    "quadratic_damping": Effect(friction.quadratic_damping, "current", "viscous"),
    "elastoplastic_hysteresis": Effect(loads.elastoplastic_hysteresis, "current", "hysteresis"),
    "viscoelastic_spring": Effect(loads.viscoelastic_spring, "current", "spring"),
    "presliding_friction": Effect(friction.presliding_friction, "current", "hysteresis"),
    "end_stop_contact": Effect(loads.end_stop_contact, "current", "stop"),
    "thermal_friction_drift": Effect(friction.thermal_friction_drift, "current", "slow"),
    "drive_backlash": Effect(kinematics.drive_backlash, "kin", "play"),
    "series_elasticity": Effect(kinematics.series_elasticity, "kin", "play"),
    "linkage_backlash": Effect(kinematics.linkage_backlash, "kin", "play"),
    "linkage_compliance": Effect(kinematics.linkage_compliance, "kin", "play"),
    "coupling_deadband": Effect(kinematics.coupling_deadband, "kin", "range"),
    "distal_stop": Effect(kinematics.distal_stop, "kin", "range"),
    "spring_decoupling": Effect(kinematics.spring_decoupling, "kin", "range"),
    "external_contact": Effect(loads.external_contact, "current", "contact"),
    "joint_wobble": Effect(kinematics.joint_wobble, "kin", "pose"),
    "moving_centre": Effect(kinematics.moving_centre, "kin", "pose"),
    "encoder_periodic_error": Effect(recording.encoder_periodic_error, "kin", "encoder"),
    "drive_sag": Effect(drive.drive_sag, "fixed", "drive"),
    "command_delay": Effect(drive.command_delay, "fixed", "drive"),
    "current_saturation": Effect(drive.current_saturation, "current", "channel"),
    "current_channel_delay": Effect(recording.current_channel_delay, "current", "channel"),
    "command_as_measurement": Effect(recording.command_as_measurement, "fixed", "channel"),
    "clock_drift": Effect(recording.clock_drift, "kin", "clock"),
    "marker_slip": Effect(markers.marker_slip, "kin", "marker"),
    "support_slip": Effect(markers.support_slip, "kin", "marker"),
    "palm_marker_slip": Effect(markers.palm_marker_slip, "kin", "marker"),
    "marker_swap": Effect(markers.marker_swap, "fixed", "marker"),
}
OUTSIDE: dict[str, Effect] = {
    "dwell_ageing": Effect(outside.dwell_ageing, "current", "outside"),
    "grain_bursts": Effect(outside.grain_bursts, "current", "outside"),
    "sudden_preload_change": Effect(outside.sudden_preload_change, "current", "outside"),
    "belt_seam": Effect(outside.belt_seam, "current", "outside"),
    "current_gain_drift": Effect(outside.current_gain_drift, "current", "outside"),
    "current_zero_wander": Effect(outside.current_zero_wander, "current", "outside"),
    "mains_hum": Effect(outside.mains_hum, "fixed", "outside"),
    "speed_resonance": Effect(outside.speed_resonance, "current", "outside"),
    "structural_ringing": Effect(outside.structural_ringing, "current", "outside"),
    "volume_scale_drift": Effect(outside.volume_scale_drift, "kin", "outside"),
    "soft_marker_mount": Effect(outside.soft_marker_mount, "kin", "outside"),
    "palm_plate_bending": Effect(outside.palm_plate_bending, "kin", "outside"),
    "encoder_count_loss": Effect(outside.encoder_count_loss, "kin", "outside"),
}
EFFECTS = VOCABULARY | OUTSIDE
UNSEEN = "asymmetric_friction"  # refitted, it is a preload: only ever a background of messy cases
ALONE = "command_as_measurement"  # leaves nothing for a second effect to be seen in
MAIN = [name for name in VOCABULARY if name != UNSEEN]
JOINABLE = [name for name in MAIN if name != ALONE]
