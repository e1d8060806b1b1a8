"""Inertial parameters that bodies can have: least squares over pseudo-inertias that are positive definite.

A body is physical exactly when its 4 x 4 pseudo-inertia is positive definite (Wensing, Kim & Slotine 2018). Least
squares over such bodies is convex (Traversaro et al. 2016; Sousa & Cortesao 2014): a logarithmic barrier holds every
body inside, and Newton steps follow it as it is lowered (Boyd & Vandenberghe 2004, ch. 11).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .balance import Column
from .dynamics import INERTIAL

Array = NDArray[np.float64]
DIAGONAL = [INERTIAL.index(k) for k in ("Ixx", "Iyy", "Izz")]
GAP = 1e-9  # of the squares explained: what the barrier may still cost
LOWERED = 0.05  # the barrier, from one round of Newton steps to the next
MOST_STEPS = 50
ARMIJO = 0.1


def pseudo_inertia(p: Array) -> Array:
    """Pseudo-inertia (4, 4) of parameters (10,): second moments, first moments, mass."""
    about = np.array([[p[4], p[7], p[8]], [p[7], p[5], p[9]], [p[8], p[9], p[6]]])
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(about) * np.eye(3) - about
    out[3, :3] = out[:3, 3] = p[1:4]
    out[3, 3] = p[0]
    return out


BASIS = np.array([pseudo_inertia(e) for e in np.eye(10)])  # (10, 4, 4): it is linear in them


def is_physical(p: Array) -> bool:
    """Whether a body can have parameters (10,), to the precision of floating point."""
    level = np.linalg.eigvalsh(pseudo_inertia(p))
    return bool(level[0] >= -1e-12 * max(level[-1], 1e-300))


def consistent(
    columns: Sequence[Column],
    declared: Array,
    theta: Array,
    gram: Array,
    moment: Array,
    low: Array,
    high: Array,
    mean: Array,
    weight: Array,
) -> Array:
    """theta (P + J,) again, or, where a body of it cannot exist, the least-squares solution over bodies that can.

    declared (bodies, 10): parameters as declared (what is zero there and no column stays zero), in the order in which
    bodies first appear in columns; all others as in `solve_bounded`.
    """
    bodies = list(dict.fromkeys(c.name for c in columns if c.kind == "inertial"))
    index = {(c.name, c.part): i for i, c in enumerate(columns) if c.kind == "inertial"}
    own = np.array([[index.get((b, part), -1) for part in INERTIAL] for b in bodies])
    if all(is_physical(p) for p in np.where(own >= 0, theta[own], declared)):
        return theta
    inertial = np.unique(own[own >= 0])
    rest = np.setdiff1d(np.arange(len(theta)), inertial)
    h, g = gram + np.diag(weight), moment + weight * mean
    unit = 1.0 / np.sqrt(np.maximum(np.diag(h), 1e-300))
    h, g, low, high = h * unit[:, None] * unit, g * unit, low / unit, high / unit
    x = theta / unit
    x[rest] = _inside(x[rest], low[rest], high[rest])
    for i, p in zip(own, declared, strict=True):
        x[i[i >= 0]] = (_well_inside(p, i >= 0) / unit[i])[i >= 0]
    edges = [(k, s, b[k]) for b, s in ((low, 1.0), (high, -1.0)) for k in rest if np.isfinite(b[k])]
    barrier = _Barrier(own, declared, unit, *(np.array([e[k] for e in edges]) for k in range(3)))
    weight_of_barrier = abs(float(g @ x)) + 1e-300
    size = abs(float(g @ np.linalg.solve(h + 1e-13 * np.eye(len(g)), g)))
    while True:
        x = _newton(h, g, weight_of_barrier, barrier, x)
        if weight_of_barrier * (4 * len(bodies) + len(edges)) < GAP * size:
            return x * unit
        weight_of_barrier *= LOWERED


def _newton(h: Array, g: Array, share: float, barrier: _Barrier, x: Array) -> Array:
    """argmin of x'hx / 2 - g'x + share barrier(x) from x (n,), inside."""

    def cost(y: Array) -> float:
        return float(0.5 * y @ h @ y - g @ y + share * barrier.value(y))

    now = cost(x)
    for _ in range(MOST_STEPS):
        slope, bend = barrier.slopes(x)
        gradient = h @ x - g + share * slope
        step = -np.linalg.solve(h + share * bend + 1e-14 * np.eye(len(x)), gradient)
        decrement = -float(gradient @ step)
        if decrement < 1e-3 * share:
            break
        length = 1.0
        while length > 1e-10 and not (then := cost(x + length * step)) <= now - ARMIJO * length * decrement:
            length *= 0.5
        if length <= 1e-10:
            break
        x, now = x + length * step, then
    return x


@dataclass(frozen=True)
class _Barrier:
    """Minus the logarithms of every body's determinant and of the distances from the edges of the box.

    own (bodies, 10): places of their parameters in x (-1: as declared (bodies, 10)); unit (n,): of x; at, sign, end
    (edges,): place in x, side on which there is room, edge.
    """

    own: Array
    declared: Array
    unit: Array
    at: Array
    sign: Array
    end: Array

    def value(self, x: Array) -> float:
        """At x (n,); infinite outside."""
        room, level = self._room(x), np.linalg.eigvalsh(self._pseudo(x))
        if np.any(room <= 0) or np.any(level[:, 0] <= 0):
            return np.inf
        return -float(np.sum(np.log(room))) - float(np.sum(np.log(level)))

    def slopes(self, x: Array) -> tuple[Array, Array]:
        """Gradient (n,) and Hessian (n, n) at x (n,), inside."""
        n, at, room = len(x), self.at.astype(int), self._room(x)
        slope, bend = np.zeros(n + 1), np.zeros((n + 1, n + 1))  # one more for what is not in x
        np.add.at(slope, at, -self.sign / room)
        np.add.at(bend, (at, at), room**-2)
        part = np.linalg.inv(self._pseudo(x))[:, None] @ BASIS * self.unit[self.own][:, :, None, None]
        flat = part.reshape(*self.own.shape, 16)
        turned = np.swapaxes(part, 2, 3).reshape(*self.own.shape, 16)
        slope[self.own] -= np.trace(part, axis1=2, axis2=3)
        bend[self.own[:, :, None], self.own[:, None, :]] += flat @ np.swapaxes(turned, 1, 2)
        return slope[:n], bend[:n, :n]

    def _room(self, x: Array) -> Array:
        return self.sign * (x[self.at.astype(int)] - self.end)

    def _pseudo(self, x: Array) -> Array:
        return (
            np.where(self.own >= 0, x[self.own] * self.unit[self.own], self.declared) @ BASIS.reshape(10, 16)
        ).reshape(-1, 4, 4)


def _inside(x: Array, low: Array, high: Array) -> Array:
    """x (n,) moved off the edges of its box."""
    room = np.where(np.isfinite(high - low), 1e-3 * (high - low), 1e-3 * np.maximum(np.abs(x), 1.0))
    return np.clip(x, low + room, high - room)


def _well_inside(p: Array, free: Array) -> Array:
    """Declared parameters (10,) with moments of inertia raised, where they are free (10,) bool, until such a body can
    be."""
    out = p.copy()
    out[0] = max(out[0], 1e-6)
    more = 1e-3 * max(float(np.max(np.abs(out[DIAGONAL]))), 1e-12)
    while np.linalg.eigvalsh(pseudo_inertia(out))[0] <= 0 and more < 1e6:
        out[DIAGONAL] += more * free[DIAGONAL]
        more *= 2.0
    return out
