"""Where the palm and the probe are in the world of the cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .hand import PROBE, Array, unit
from .kinematics import rotations


@dataclass(frozen=True)
class Wander:
    """A slow sum of sines per component."""

    amplitude: Array
    hertz: Array
    phase: Array

    def at(self, times: Array) -> Array:
        """Values (n, components)."""
        waves = np.sin(2 * np.pi * times[:, None, None] * self.hertz + self.phase)
        return np.sum(self.amplitude * waves, axis=2)


def draw_wander(rng: np.random.Generator, size: float, low: float, high: float) -> Wander:
    """Three components of two sines each."""
    return Wander(
        rng.uniform(0.3, 1.3, (3, 2)) * size, rng.uniform(low, high, (3, 2)), rng.uniform(0, 2 * np.pi, (3, 2))
    )


def turn_by(rotvec: Array) -> Array:
    """Rotation matrix of a rotation vector."""
    angle = float(np.linalg.norm(rotvec))
    if angle == 0.0:
        return np.eye(3)
    return rotations(rotvec / angle, np.array([angle]))[0]


def draw_base(rng: np.random.Generator) -> tuple[Array, Array]:
    """Orientation and place [m] of the palm in a session."""
    return turn_by(rng.normal(0.0, 0.35, 3)), np.array([0.4, -0.2, 1.06]) + rng.normal(0.0, 0.04, 3)


def palm_motion(rng: np.random.Generator, base: tuple[Array, Array], times: Array) -> tuple[Array, Array]:
    """Rotations (n, 3, 3) and places (n, 3) of the palm while it is held by hand."""
    angles = draw_wander(rng, 0.008, 0.03, 0.25).at(times)
    shifts = draw_wander(rng, 0.0022, 0.03, 0.25).at(times)
    turns = np.array([turn_by(angle) for angle in angles])
    return turns @ base[0], base[1] + shifts


def to_world(turns: Array, places: Array, points: Array) -> Array:
    """Points (n, k, 3) or (k, 3) of the palm frame in the world."""
    points = np.broadcast_to(points, (len(turns), *points.shape[-2:]))
    return np.einsum("nij,nkj->nki", turns, points) + places[:, None]


def probe_markers(rng: np.random.Generator, tip: Array, times: Array) -> Array:
    """Probe markers (n, 4, 3) in the palm frame, the tip held, the handle swinging."""
    lean = turn_by(rng.normal(0.0, 0.4, 3))
    swing = draw_wander(rng, 0.07, 0.3, 0.8).at(times)
    turns = np.array([turn_by(angle) for angle in swing]) @ lean
    body = np.array(list(PROBE.values()))
    return np.einsum("nij,kj->nki", turns, body) + tip


def gravity_in_finger(base_turn: Array, frame: Array) -> tuple[float, float]:
    """Components of the direction of gravity along and dorsal to the finger."""
    down = frame @ (base_turn.T @ unit(np.array([0.0, 0.0, -1.0])))
    return float(down[0]), float(down[2])
