"""Marker recordings of a two-joint finger with known truth, made without the twin."""

from __future__ import annotations

import numpy as np

from hand_model.identify.chain import Chain, ChainData, propagate
from hand_model.rotation import rotation_from_vector

LABELS = ("PO", "PM", "PL", "P1", "P2", "P3", "D1", "D2", "D3")
BODY = np.array([0, 0, 0, 1, 1, 1, 2, 2, 2])
PALM = np.array([[-0.012, -0.004, 0.011], [0.035, -0.030, 0.016], [0.030, 0.029, 0.014]])


def finger_chain(seed: int) -> Chain:
    """A finger near the published index: axes within a few degrees, markers 10 to 15 mm apart around each segment."""
    rng = np.random.default_rng(seed)
    axis = np.array([[0.05, 0.99, 0.1], [0.1, 0.98, -0.12]]) + rng.normal(0, 0.04, (2, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    centre = np.array([[0.045, -0.027, 0.004], [0.076, -0.033, 0.005]]) + rng.normal(0, 0.002, (2, 3))
    triangle = np.array([[0.0, -0.007, 0.010], [0.002, 0.008, 0.012], [0.013, 0.001, 0.016]])
    segments = [c + [0.008, 0, 0] + triangle + rng.normal(0, 0.001, (3, 3)) for c in centre]
    return Chain(np.concatenate([PALM, *segments]), axis, centre)


def recording(seed: int, arcs_deg: tuple[float, float] = (75, 65), noise_m: float = 2e-4, n: int = 1500):
    """A chain, its observations on a moving palm, and the true angles (n, 2); the first 100 frames are at rest."""
    rng = np.random.default_rng(seed + 1000)
    chain = finger_chain(seed)
    phase = np.linspace(0, 2 * np.pi * 5, n)
    drive = (1 - np.cos(phase)) / 2
    drive[:100] = 0
    angle = np.stack(
        [np.deg2rad(arcs_deg[0]) * drive, np.deg2rad(arcs_deg[1]) * (0.5 * drive + 0.5 * drive**2)], axis=1
    )
    x = propagate(chain, BODY, angle)[0]
    turn = np.stack([0.05 * np.sin(phase / 7), 0.03 * np.cos(phase / 5), 0.04 * np.sin(phase / 11)], axis=1) + [
        0.3,
        0.2,
        -0.4,
    ]
    shift = np.stack([0.004 * np.sin(phase / 9) + 0.4, 0.003 * np.cos(phase / 4) - 0.2, 1 + 0 * phase], axis=1)
    y = np.einsum("nij,nmj->nmi", rotation_from_vector(turn), x) + shift[:, None] + rng.normal(0, noise_m, x.shape)
    return chain, ChainData(y, BODY, LABELS), angle
