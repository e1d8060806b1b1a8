"""Markers that are not where they were, or not who they are. Shifts in mm."""

from __future__ import annotations

import numpy as np

from ..geometry import RAD, log_uniform
from ..hand import PALM_LABELS, Finger, Session
from ..hidden import Slip, Swap
from .draw import Drawn, shift_mm


def marker_slip(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """One marker shifts on its segment."""
    joint, marker = int(rng.integers(2)), int(rng.integers(3))
    shift = shift_mm(session, strength, rng)
    session.faults.slips.append(Slip("marker", finger.name, rng.uniform(0.25, 0.75), shift, joint, marker))
    return Drawn({"shift_mm": shift.tolist()}, joint, finger.labels[joint][marker])


def support_slip(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """The support of a segment's markers turns and shifts."""
    joint = int(rng.integers(2))
    vector = rng.normal(size=3)
    least_deg = max(3.0, 6 * np.degrees(session.laboratory.marker_noise / 15))
    vector *= strength * least_deg * log_uniform(rng, 1, 1.7) * RAD / np.linalg.norm(vector)
    shift = rng.normal(size=3) * 0.4 * strength
    session.faults.slips.append(Slip("support", finger.name, rng.uniform(0.25, 0.75), shift, joint, turn=vector))
    return Drawn({"turn_deg": float(np.degrees(np.linalg.norm(vector))), "shift_mm": shift.tolist()}, joint)


def palm_marker_slip(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """One marker shifts on the palm, while a finger is recorded."""
    marker = int(rng.integers(3))
    shift = shift_mm(session, strength, rng)
    session.faults.slips.append(Slip("palm", finger.name, rng.uniform(0.25, 0.75), shift, marker=marker))
    return Drawn({"shift_mm": shift.tolist()}, marker=PALM_LABELS[marker])


def marker_swap(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Two markers of a finger, mostly of one segment, bear each other's labels for a spell or two."""
    across = rng.uniform() < 0.3
    joint = int(rng.integers(2))
    first, second = ((joint, int(marker)) for marker in rng.permutation(3)[:2])
    if across:
        second = (1 - joint, int(rng.integers(3)))
    spells = []
    for k in range(int(rng.integers(1, 3))):
        begin = float(rng.uniform(0.12 + 0.42 * k, 0.30 + 0.42 * k))
        spells.append((begin, log_uniform(rng, 0.8, 4) * (1 if strength >= 1 else 0.5)))
    session.faults.swaps.append(Swap(finger.name, first, second, spells))
    names = ",".join(finger.labels[segment][marker] for segment, marker in (first, second))
    return Drawn({"spells": [[round(begin, 3), round(length, 2)] for begin, length in spells]}, joint, names)
