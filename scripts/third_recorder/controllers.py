"""Healthy motors and the controllers that drive them."""

from __future__ import annotations

import numpy as np

from .geometry import log_uniform
from .motor import Motor

NAMES = ["cascade PID", "trapezoid with feed-forward", "sliding ramp", "bang-bang with deadband"]
CASCADE, TRAPEZOID, RAMP, BANG = range(4)


def draw_motor(rng: np.random.Generator, controller: int, top_speed: float) -> Motor:
    """Motor of a finger; top_speed [%/s]. Every finger of a hand has the same kind of controller."""
    log_uniform(rng, 0.6, 1.7)  # nothing uses it; without it every seed would mean another session
    motor = Motor(
        mass=0.012 * log_uniform(rng, 0.58, 1.73),
        viscous=0.15 * log_uniform(rng, 0.58, 1.73),
        coulomb=34 * log_uniform(rng, 0.58, 1.5),
        stiffness=0.23 * log_uniform(rng, 0.58, 1.6),
        preload=9.5 * log_uniform(rng, 0.5, 1.5),
        acceleration=top_speed * rng.uniform(5, 14),
        top_speed=top_speed,
        controller=controller,
    )
    tune(rng, motor)
    return motor


def tune(rng: np.random.Generator, motor: Motor) -> None:
    """Draw the gains of its controller."""
    if motor.controller == CASCADE:
        motor.position_gain = rng.uniform(9, 16)
        motor.speed_gain = motor.mass * rng.uniform(45, 80)
        motor.integral_gain = motor.speed_gain * rng.uniform(9, 16)
    elif motor.controller == TRAPEZOID:
        natural = rng.uniform(28, 45)  # [rad/s]
        motor.position_gain = motor.mass * natural * natural
        motor.derivative_gain = motor.mass * natural * 1.3
        motor.feed_forward = rng.uniform(0.6, 1)
        motor.integral_gain = motor.mass * natural * natural * 1.5
    elif motor.controller == RAMP:
        natural = rng.uniform(24, 36)
        motor.position_gain = motor.mass * natural * natural
        motor.derivative_gain = motor.mass * natural * 1.5
        motor.feed_forward = rng.uniform(0, 0.3)
        motor.integral_gain = motor.mass * natural * natural * 3
    else:
        motor.deadband = rng.uniform(0.8, 2)
        motor.drive_gain = rng.uniform(3.5, 7)
        motor.load_share = rng.uniform(0.72, 0.84)
        motor.holding_gain = rng.uniform(8, 20)
        motor.acceleration *= 0.7
