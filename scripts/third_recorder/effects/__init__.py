"""Every effect that the recorder can hide, and how it is drawn."""

from __future__ import annotations

from . import electric, friction, kinematic, load, marker, outside
from .draw import TRACE, WEAK, Drawn, Effect

__all__ = ["EFFECTS", "OUTSIDE", "TRACE", "WEAK", "Drawn", "Effect"]

# The order is part of what a seed means.
EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Effect(friction.stribeck_friction, "friction"),
        Effect(friction.asymmetric_viscous_friction, "friction"),
        Effect(friction.asymmetric_friction, "friction"),
        Effect(friction.load_dependent_friction, "friction"),
        Effect(friction.position_dependent_friction, "friction"),
        Effect(load.detent_load, "load"),
        Effect(load.nonlinear_spring, "load"),
        Effect(load.gravity_load, "load"),
        Effect(load.torque_ripple, "load"),
        Effect(friction.quadratic_damping, "friction"),
        Effect(friction.elastoplastic_hysteresis, "friction"),
        Effect(load.viscoelastic_spring, "load"),
        Effect(friction.presliding_friction, "friction"),
        Effect(load.end_stop_contact, "load"),
        Effect(friction.thermal_friction_drift, "friction"),
        Effect(load.external_contact, "load"),
        Effect(kinematic.spring_decoupling, "kinematic", joint="proximal"),
        Effect(electric.encoder_periodic_error, "electric"),
        Effect(electric.drive_sag, "electric"),
        Effect(electric.command_delay, "electric"),
        Effect(electric.current_saturation, "electric"),
        Effect(electric.current_channel_delay, "electric"),
        Effect(electric.command_as_measurement, "electric"),
        Effect(electric.clock_drift, "recording", everywhere=True),
        Effect(kinematic.drive_backlash, "kinematic", joint="proximal"),
        Effect(kinematic.series_elasticity, "kinematic", joint="proximal"),
        Effect(kinematic.linkage_backlash, "kinematic", joint="distal"),
        Effect(kinematic.linkage_compliance, "kinematic", joint="distal"),
        Effect(kinematic.coupling_deadband, "kinematic", joint="distal"),
        Effect(kinematic.distal_stop, "kinematic", joint="distal"),
        Effect(kinematic.joint_wobble, "kinematic"),
        Effect(kinematic.moving_centre, "kinematic"),
        Effect(marker.marker_slip, "marker"),
        Effect(marker.support_slip, "marker"),
        Effect(marker.palm_marker_slip, "marker", everywhere=True),
        Effect(marker.marker_swap, "marker"),
    )
}
OUTSIDE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Effect(outside.emi_bursts, "outside"),
        Effect(outside.stroke_number_friction, "outside"),
        Effect(outside.speed_dependent_spring, "outside"),
        Effect(outside.camera_distortion, "outside", everywhere=True),
        Effect(outside.motor_constant_warms, "outside"),
        Effect(outside.palm_bends_under_load, "outside"),
        Effect(outside.current_sensor_wander, "outside"),
        Effect(outside.support_tremor, "outside"),
        Effect(outside.marker_support_rings, "outside"),
        Effect(outside.friction_ages_at_rest, "outside"),
        Effect(outside.log_clock_jumps, "outside", everywhere=True),
        Effect(outside.tendon_creep, "outside"),
    )
}
