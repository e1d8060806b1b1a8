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


TO_AND_FRO = np.array([0.1, 20.0, 0.4, 6.0])  # viscous, friction, spring, preload


def to_and_fro(seed: int, speeds: int, noise: float) -> DriveState:
    """A motor that goes to and fro over its range, two seconds at each of some speeds."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 2 * speeds, 0.02)
    phase = 2 * np.pi * np.cumsum(rng.uniform(0.1, 0.35, speeds).repeat(100)) * 0.02
    x, v = 50 - 50 * np.cos(phase), 50 * np.sin(phase) * np.gradient(phase, t)
    declared = np.stack([v, np.sign(v), x, np.ones(len(t))], 1)
    effort = declared @ TO_AND_FRO + noise * rng.standard_normal(len(t))
    names = ("viscous", "coulomb", "spring", "preload")
    return DriveState(f"log/{seed}.csv", "index", t, x, v, 0 * v, effort, declared, "%", "raw", {}, names)
