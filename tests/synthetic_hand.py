"""Hands for the tests of compilation and engines: random axes, centres, linkages and markers from a seed."""

from __future__ import annotations

import numpy as np

from hand_model.hand import Coupling, Finger, Hand, Joint


def synthetic_hand(
    seed: int = 0,
    side: str = "left",
    joints: int = 2,
    fingers=("thumb_0", "thumb_1", "index", "ring"),
    tips: bool = True,
) -> Hand:
    """A hand of that many joints per finger, coupled in a chain (each joint follows the one before it)."""
    random = np.random.default_rng(seed)
    across = 1 if side == "left" else -1
    made = tuple(_finger(random, name, i, across, joints, tips) for i, name in enumerate(fingers))
    palm = {label: random.normal(0, 0.02, 3) for label in ("PO", "PM", "PL")}
    return Hand("synthetic", side, palm, {"origin": np.zeros(3)}, made, 1e-4, {"mocap/a.c3d": "0123456789abcdef"})


def _finger(random, name, i, across, joints, tips):
    thumb = name.startswith("thumb")
    centre = np.array([0.0, -0.03 * across, -0.05]) if thumb else np.array([0.045, across * 0.02 * (i - 2.5), 0.0])
    centre = centre + random.normal(0, 0.001, 3)
    made = []
    for k in range(joints):
        axis = np.array([0.0, 1.0, 0.0]) + random.normal(0, 0.15, 3)
        markers = {f"{name}_{k}{letter}": centre + [0.012, 0, 0.015] + random.normal(0, 0.006, 3) for letter in "abc"}
        tip = centre + [0.027, 0, 0] + random.normal(0, 0.001, 3) if tips and k == joints - 1 else None
        high = 1.1 + random.uniform(0, 0.3)
        made.append(Joint(f"s{k}", axis / np.linalg.norm(axis), centre, 1e-6 * np.eye(6), (-0.02, high), markers, tip))
        centre = centre + [0.032, 0, 0.003] + random.normal(0, 0.001, 3)
    couplings = tuple(
        Coupling(f"s{k}", f"s{k + 1}", np.array([0.0, random.uniform(0.4, 0.6), 0.25, 0.04, -0.03]), {}, {})
        for k in range(joints - 1)
    )
    return Finger(name, "thumb" if thumb else name, tuple(made), (), couplings)
