"""Lay one description's axes over the other's, joint by joint from the base outwards, so that each difference stays
local.

At zero every joint is a line in the base frame (product of exponentials, Brockett 1984): two descriptions move alike
exactly when these lines coincide up to one transform of the base. Comparing them directly would smear a difference at
the knuckle over the whole finger, so each link keeps its own transform from b to a, passed on to its children, and a
joint may change it:
by a turn about its own axis (another zero), or because the links beyond follow its displaced axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .base_frame import base_transform
from .coincidence import differs, frame_cost, line_cost
from .features import Features
from .joint_fit import Fit, fit_joint
from .tree import Array, inverse


@dataclass(frozen=True)
class Alignment:
    """base: (4, 4) from b's base frame to a's. fits: one per paired joint. cost: the less, the more coincides."""

    base: Array
    fits: tuple[Fit, ...]
    cost: float


def align(f: Features, base: Array | None = None) -> Alignment:
    """Align b with a under their pairing. base: (4, 4) from b's base frame to a's, estimated where it is not given."""
    base = base_transform(f) if base is None else base
    carries: dict[int, Array] = {-1: base}
    conventions: dict[int, Array] = {}
    conventions[-1] = _convention(f, -1, base)
    fits, total = [], 0.0
    for k in range(len(f.names)):
        before = f.parent[k]
        up, held = carries[before], conventions[before]
        # A link frame is evidence only where this hand's frames follow a rule: none is turned, or all alike.
        rule = any(
            differs(held, other) < 1e-4 for other in (np.eye(4), conventions[f.parent[before] if before >= 0 else -1])
        )
        fit = fit_joint(f, k, up, [np.eye(4), held], 0.5 if rule else 0.1)
        fits.append(fit)
        carries[k], conventions[k] = fit.carry, _convention(f, k, fit.carry)
        total += float(line_cost(f, up, [k])[0]) + 2.0 * (abs(fit.offset) > 1e-9) + (fit.sign < 0)
        total += 0.3 * sum(
            frame_cost([np.eye(4), conventions[f.parent[k]]], *frame[:2], fit.carry) for frame in f.frames.get(k, [])
        )
    return Alignment(base, tuple(fits), total)


def _convention(f: Features, k: int, carry: Array) -> Array:
    own = next((frame for frame in f.frames.get(k, []) if frame[4]), None)
    return np.eye(4) if own is None else inverse(own[0]) @ carry @ own[1]
