"""A drive in motion, as the effects see it."""

from __future__ import annotations

import numpy as np

from hand_model.effects.base import DriveState


def state(n: int = 1200, seed: int = 0) -> DriveState:
    """Three full cycles at different speeds, 0 to 100 %."""
    t = np.arange(n) * 0.018
    phase = np.cumsum(np.repeat([0.3, 0.6, 1.0], n // 3)) * 0.018
    x = 50 - 50 * np.cos(2 * np.pi * phase)
    v, a = np.gradient(x, t), np.gradient(np.gradient(x, t), t)
    declared = np.stack([a, v, np.sign(v), x, np.ones(n)], axis=-1)
    names = ("inertia", "viscous", "coulomb", "spring", "preload")
    effort = declared @ np.array([0.01, 0.15, 35.0, 0.2, 9.0]) + np.random.default_rng(seed).normal(0, 1, n)
    return DriveState(
        "trial",
        "drive",
        t,
        x,
        v,
        a,
        effort,
        declared,
        declared_names=names,
        extra={"load": effort, "drag": np.zeros(n), "trial_index": np.zeros(n)},
    )
