"""The current that a recorded motion takes, both sides filtered alike; friction by its state along the path (Dahl
1968)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .published import CUTOFF_HZ, derivatives, zero_phase
from .recording import MotorTrial

Array = NDArray[np.float64]

NAMES = ("inertia", "viscous", "coulomb", "stiffness", "preload")
PRESLIDING = 1.2  # [%], a travel after which the friction has turned round in any drive of interest


def friction_state(position: Array, presliding: float) -> Array:
    """Dahl's friction state z (n,) in -1..1 along positions (n,) [%]: z' = (1 - z sign(v)) v / presliding, from z =
    0."""
    move = np.diff(position)
    keep = np.exp(-np.abs(move) / presliding)
    sign = np.sign(move)
    z = np.zeros(len(position))
    state = 0.0
    for i, (a, s) in enumerate(zip(keep.tolist(), sign.tolist(), strict=True)):
        state = s + (state - s) * a
        z[i + 1] = state
    return z


def balance(t: MotorTrial, values: Array, cutoff_hz: float = 2 * CUTOFF_HZ, flexing: bool = False) -> Array:
    """Current (n,) [raw] that the recorded motion of a trial takes, by `values` (5,) of NAMES; motion filtered at
    cutoff_hz [Hz].

    flexing: friction as in flexion throughout, which is all that it can be while the drive flexes or is held up in
    flexion.
    """
    rate = 1 / float(np.median(np.diff(t.time_s)))
    time = np.arange(t.time_s[0], t.time_s[-1], 1 / rate)
    p = zero_phase(np.interp(time, t.time_s, t.position), rate, cutoff_hz)
    v, a = derivatives(p, rate)
    z = np.ones(len(p)) if flexing else friction_state(p, PRESLIDING)
    return np.interp(t.time_s, time, np.column_stack([a, v, z, p, np.ones(len(p))]) @ values)
