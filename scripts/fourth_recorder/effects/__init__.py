"""Every effect that the recorder can hide."""

from __future__ import annotations

from . import electric, friction, kinematic, load, marker, outside
from .draw import Drawn, Effect, Form, Site

__all__ = ["EFFECTS", "OUTSIDE", "Drawn", "Effect", "Form", "Site"]

# The order is part of what a seed means.
EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Effect(friction.stribeck_friction, "current"),
        Effect(friction.asymmetric_viscous_friction, "current"),
        Effect(friction.asymmetric_friction, "current"),
        Effect(friction.load_dependent_friction, "current"),
        Effect(friction.position_dependent_friction, "current"),
        Effect(load.detent_load, "current"),
        Effect(load.nonlinear_spring, "current"),
        Effect(load.gravity_load, "current"),
        Effect(load.torque_ripple, "current"),
        Effect(friction.quadratic_damping, "current"),
        Effect(friction.elastoplastic_hysteresis, "current"),
        Effect(load.viscoelastic_spring, "current"),
        Effect(friction.presliding_friction, "current"),
        Effect(load.end_stop_contact, "current"),
        Effect(friction.thermal_friction_drift, "current"),
        Effect(kinematic.drive_backlash, "markers", joint="proximal"),
        Effect(kinematic.series_elasticity, "markers", joint="proximal"),
        Effect(kinematic.linkage_backlash, "markers", joint="distal"),
        Effect(kinematic.linkage_compliance, "markers", joint="distal"),
        Effect(kinematic.coupling_deadband, "markers", joint="distal"),
        Effect(kinematic.distal_stop, "markers", joint="distal"),
        Effect(kinematic.spring_decoupling, "markers", joint="proximal"),
        Effect(load.external_contact, "current"),
        Effect(kinematic.joint_wobble, "markers"),
        Effect(kinematic.moving_centre, "markers"),
        Effect(electric.encoder_periodic_error, "current"),
        Effect(electric.drive_sag, "motion"),
        Effect(electric.command_delay, "motion"),
        Effect(electric.current_saturation, "current"),
        Effect(electric.current_channel_delay, "current"),
        Effect(electric.command_as_measurement, "current"),
        Effect(electric.clock_drift, "markers", driven=False),
        Effect(marker.marker_slip, "markers", driven=False),
        Effect(marker.support_slip, "markers", driven=False),
        Effect(marker.palm_marker_slip, "markers", driven=False),
        Effect(marker.marker_swap, "markers", driven=False),
    )
}
OUTSIDE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Effect(outside.noise_bursts, "current"),
        Effect(outside.current_gain_change, "current"),
        Effect(outside.intermittent_stick, "current"),
        Effect(outside.rest_posture_change, "markers"),
        Effect(outside.controller_retuned, "motion"),
        Effect(outside.friction_of_acceleration, "current"),
        Effect(outside.lubricant_migration, "current"),
        Effect(outside.encoder_missed_counts, "motion"),
        Effect(outside.occlusion_bias, "markers", driven=False),
        Effect(outside.mocap_scale_drift, "markers", driven=False),
        Effect(outside.supply_fluctuation, "current"),
        Effect(outside.motor_crosstalk, "current"),
        Effect(outside.wandering_friction, "current"),
        Effect(outside.dwell_ageing, "current"),
        Effect(outside.travel_load, "current"),
        Effect(outside.preload_jump, "current"),
        Effect(outside.current_offset_drift, "current"),
        Effect(outside.running_vibration, "current"),
    )
}
