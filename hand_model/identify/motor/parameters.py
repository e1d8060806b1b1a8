"""The parameters of a drive: their units, and the bounds within which a drive can be."""

from __future__ import annotations

UNITS = {
    "inertia": "raw s^2/%",
    "viscous": "raw s/%",
    "coulomb": "raw",
    "stiffness": "raw/%",
    "preload": "raw",
    "presliding": "%",
    "bristle": "s",
    "static_ratio": "1",
    "stribeck_speed": "%/s",
    "stribeck_exponent": "1",
    "speed_full": "%/s",
    "rise": "s",
    "fall": "s",
    "position_gain": "1/s",
    "deadband": "%",
    "gain": "raw/%",
    "damping": "raw s/%",
    "delay": "s",
    "lead": "s",
    "lag": "s",
    "edge": "%",
}
BOUNDS = {
    "inertia": (1e-5, 1e3),
    "viscous": (-1e3, 1e4),
    "coulomb": (1e-3, 1e5),
    "presliding": (0.02, 10.0),
    "bristle": (0.0, 0.2),
    "speed_full": (1.0, 1e4),
    "rise": (1e-4, 3.0),
    "fall": (1e-4, 3.0),
    "position_gain": (0.5, 200.0),
    "deadband": (0.0, 10.0),
    "gain": (1e-2, 1e4),
    "damping": (0.0, 1e3),
    "delay": (-0.002, 0.02),
    "lead": (-0.01, 0.01),
    "lag": (-0.005, 0.005),
    "static_ratio": (1.0, 8.0),
    "stribeck_speed": (1.5, 100.0),
    "stribeck_exponent": (1.0, 3.0),  # below 1 the rise would be infinitely steep at rest
}
