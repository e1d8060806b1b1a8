"""A free swing between its reversals: one half swing for many amplitudes, and all recordings put together from these.

Nothing drives it, so all that follows a reversal depends on the amplitude there alone (a Poincare map). A half swing is
integrated once for a few amplitudes, by Runge and Kutta (fourth order) over the angle alpha of the phase plane about
the point where weight and dry friction balance (Lindstedt's coordinates, exact for a harmonic swing with Coulomb
friction): it ends at alpha = pi, at a reversal, and within it dry friction keeps its sign, so nothing is smoothed or
stepped over. Between the amplitudes of the table Chebyshev polynomials in their logarithm interpolate (Trefethen 2013).
A recording of a hundred half swings then costs a hundred small steps however finely it was sampled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..bristles import SHORTEST
from .friction import dry_friction, wet_friction

Array = NDArray[np.float64]
STEPS = 40  # of Runge and Kutta in a half swing
NODES = 32  # amplitudes in the table
FARTHEST = 2.9  # rad from rest: beyond, a swing may go over the top, and has no reversal there
MARGIN = 1.1  # of the largest amplitude in the table over the largest one that is asked for
SMALLEST = 3e-3  # of the amplitudes in the table, over the largest
SMALLEST_BENT = 5e-4  # the same where friction turns round over a way: a swing comes to rest within it
SIDED = ("offset", "asymmetry", "damping_asymmetry")  # what tells one way from the other
SETTLES = 30
STIFF, LARGE = 3.0, 6.0  # bristles over weight, amplitude over what friction holds
LEAST_TURN = 0.02  # of the harmonic swing's: slower, the swing stands
MOST = 3.0  # times the usual number of half swings: what goes faster is no swing that was recorded

# alpha at the steps, and between Chebyshev's points and polynomials
_ORDER = np.arange(NODES)
_POINTS = np.cos(np.pi * (_ORDER + 0.5) / NODES)
_TO_POLYNOMIALS = (2.0 / NODES) * np.cos(np.outer(_ORDER, np.arccos(_POINTS))) * np.where(_ORDER, 1.0, 0.5)[:, None]


@dataclass(frozen=True)
class Forces:
    """What acts on runs side by side, arrays that broadcast against each other.

    weight, phase: weight(q) = -weight sin(q + phase) [N m], a spring's stiffness [N m/rad] besides; offset [N m]; inertia
    [kg m2]; rest: where these balance [rad]; still: dry friction's bound at rest over their slope there [rad]; rate
    [rad/s] of small swings without friction; step_s: of the leapfrog that this stands for (0: of the law itself);
    wet(v, external), dry(v, external): damping [N m s/rad] and dry friction [N m].
    """

    weight: Array
    phase: Array
    offset: Array
    inertia: Array
    rest: Array
    still: Array
    rate: Array
    step_s: float
    parameters: Mapping[str, Array]
    has: Mapping[str, bool]

    def acceleration(self, q: Array, v: Array, sign: Array, far: Array) -> Array:
        """rad/s2 at angle q and velocity v; sign: of the velocity, where it has just begun too; far [rad]: from rest to
        the reversal before.

        A leapfrog of step h moves as the law does under a pull to rest that is stronger by h^2 / 12 times its second
        derivative in time (modified equation; Hairer, Lubich & Wanner 2006, ch. IX), up to h^4. Damping takes the
        velocity half a step later where MuJoCo knows it (implicit), half a step earlier where an effect adds it; the
        bound of dry friction that an effect moves is one step older still (`stepper.EffectStepper`).
        """
        p, sine, h = self.parameters, np.sin(q + self.phase), self.step_s
        external = -self.weight * sine
        if self.has["stiffness"]:
            external = external - p["stiffness"] * q
        drift = h * external / self.inertia
        dry = dry_friction(p, self.has, v - 1.5 * drift, external, None) if self.has["dry"] else p["coulomb"]
        if self.has["reach"]:
            dry = dry * self._bristle(np.abs(q - self.rest + sign * far), far)
        late, early = v + 0.5 * drift, v - 0.5 * drift
        wet = (p["wet"] + p["drag"] * np.abs(late)) * late
        if self.has["wet"] and (self.has["load_speed"] or self.has["damping_asymmetry"]):
            added = wet_friction(p, self.has, early, external) - p["wet"] - p["drag"] * np.abs(early)
            wet = wet + added * early
        out = (external + self.offset - wet - sign * dry) / self.inertia
        if h:
            square = self.weight / self.inertia
            bend, slope = square * sine * v * v, square * np.cos(q + self.phase)
            if self.has["stiffness"]:
                slope = slope + p["stiffness"] / self.inertia
            out = out - (h * h / 12.0) * (bend - slope * (external + self.offset) / self.inertia)
        return out

    def _bristle(self, moved: Array, far: Array) -> Array:
        """Share of its bound that dry friction has after a way from a reversal so far [rad] from rest: Dahl's state,
        which at the reversals of a swing that hardly dies away is as large on both sides."""
        reach = np.maximum(self.parameters["reach"], SHORTEST)
        return 1.0 - (1.0 + np.tanh(far / reach)) * np.exp(-moved / reach)

    def balance(self, sign: Array, far: Array) -> Array:
        """Angle [rad] about which it swings while it moves with that sign, after a reversal so far [rad] from rest."""
        return self.rest - sign * self.held(far)

    def held(self, far: Array) -> Array:
        """What dry friction pulls the middle of a half swing off rest by [rad] that begins so far from rest. Bristles that
        are hardly stiffer than the weight let a small swing go on about its rest; stiffer ones hold it as dry friction
        does."""
        if not self.has["reach"]:
            return self.still + 0.0 * far
        reach, far = np.maximum(self.parameters["reach"], SHORTEST), np.maximum(far, 0.0)
        holds = 1.0 / (1.0 + (STIFF * reach / np.maximum(self.still, SHORTEST)) ** 8)
        large = far**2 / (far**2 + np.maximum(LARGE * self.still, SHORTEST) ** 2)
        return self.still * np.tanh(far / reach) * (holds + (1.0 - holds) * large)

    def reversal(self, radius: Array) -> Array:
        """How far [rad] from rest a half swing begins that has such a radius [rad] about where it balances."""
        far = radius + self.still
        for _ in range(SETTLES if self.has["reach"] else 1):
            far = radius + self.held(far)
        return far

    def shaped(self, index: Array | slice, *more: int) -> Forces:
        """Those of some runs, with axes of length one appended."""

        def of(values: Array) -> Array:
            return values[index].reshape(-1, *(1 for _ in more))

        own = {k: of(x) for k, x in self.parameters.items()}
        return Forces(*(of(x) for x in (self.weight, self.phase, self.offset, self.inertia, self.rest, self.still,
                                        self.rate)), self.step_s, own, self.has)  # fmt: skip


def fly(
    forces: Forces, sign: Array, radius: Array, far: Array, begin: Array | float, steps: int = STEPS
) -> tuple[Array, Array]:
    """Radius (steps + 1, ...) [rad] in the phase plane and rate x time (steps + 1, ...) from alpha = begin to pi at
    `angles`: q = balance - sign radius cos alpha, v = sign rate radius sin alpha; far [rad]: from rest to the reversal
    before."""
    at = angles(forces, begin, steps)
    radii, times = [radius], [np.zeros_like(radius)]
    centre, square = forces.balance(sign, far), forces.rate**2

    def slopes(alpha: Array | float, r: Array) -> tuple[Array, Array]:
        c, s = np.cos(alpha), np.sin(alpha)
        q = centre - sign * (r * c)
        v = sign * np.maximum(forces.rate * r * s, 1e-300)
        beyond = (square * (r * c) - sign * forces.acceleration(q, v, sign, far)) / (square * np.maximum(r, 1e-300))
        turn = np.maximum(1.0 - beyond * c, LEAST_TURN)
        return -r * beyond * s / turn, 1.0 / turn

    for alpha, following in pairwise(at):
        h, r = following - alpha, radii[-1]
        a = slopes(alpha, r)
        b = slopes(alpha + 0.5 * h, r + 0.5 * h * a[0])
        c = slopes(alpha + 0.5 * h, r + 0.5 * h * b[0])
        d = slopes(alpha + h, r + h * c[0])
        radii.append(r + h / 6.0 * (a[0] + 2 * b[0] + 2 * c[0] + d[0]))
        times.append(times[-1] + h / 6.0 * (a[1] + 2 * b[1] + 2 * c[1] + d[1]))
    return np.stack(radii), np.stack(times)


def angles(forces: Forces, begin: Array | float, steps: int = STEPS) -> Array:
    """alpha (steps + 1, ...) from begin to pi: even, or, where friction turns round over a way, close together after
    the reversal."""
    share = np.linspace(0.0, 1.0, steps + 1) ** (2 if forces.has["reach"] else 1)
    return begin + np.multiply.outer(share, np.pi - np.asarray(begin))


@dataclass(frozen=True)
class Table:
    """Half swings of U laws. low, high: logarithms of the amplitudes (radius at the reversal) between which the
    polynomials hold; shape (U, 2, NODES, 2, STEPS + 1): coefficients of radius over amplitude and of rate x time along
    alpha, for motion of negative and of positive sign."""

    low: float
    high: float
    shape: Array

    def basis(self, radius: Array) -> Array:
        """Polynomials (..., NODES) at amplitudes; constant beyond the table's ends."""
        x = (2.0 * np.log(np.maximum(radius, 1e-300)) - self.low - self.high) / (self.high - self.low)
        return np.cos(np.arccos(np.clip(x, -1.0, 1.0))[..., None] * _ORDER)


def amplitude(forces: Forces, q: Array, v: Array) -> Array:
    """Angle [rad] from rest to which weight alone lets a swing come from angle q and velocity v."""
    height = 1.0 - np.cos(q - forces.rest) + 0.5 * (v / forces.rate) ** 2
    return np.arccos(np.clip(1.0 - height, -1.0, 1.0))


def tabulated(forces: Forces, largest: float) -> Table:
    """The half swings of U laws (arrays (U,)), up to the amplitude `largest` [rad]."""
    largest = min(MARGIN * largest, FARTHEST)
    low, high = np.log((SMALLEST_BENT if forces.has["reach"] else SMALLEST) * largest), np.log(largest)
    radius = np.exp(0.5 * (low + high) + 0.5 * (high - low) * _POINTS)
    alike = not any(forces.has[name] for name in SIDED)  # both ways: one is enough
    sign = np.array([-1.0] if alike else [-1.0, 1.0])[:, None]
    start = np.broadcast_to(radius, (len(forces.rate), len(sign), NODES)).copy()
    own = forces.shaped(slice(None), 1, 1)
    radii, times = fly(own, sign, start, own.reversal(start), 0.0)
    # a leapfrog's dry friction turns round half a step early, and for so long helps the motion on
    times = times + np.minimum(own.step_s * own.rate * own.still / start, 0.5 * np.pi / STEPS)
    values = np.stack([radii / start, times])  # (2, steps + 1, U, 2, NODES)
    shape = np.einsum("mn,fsupn->upmfs", _TO_POLYNOMIALS, values)
    return Table(low, high, np.repeat(shape, 2, 1) if alike else shape)


def motion(
    forces: Forces, law: Array, table: Table, start: tuple[Array, Array], times: list[Array], most: int
) -> list[Array]:
    """Angles [rad] of runs (L,) at their times [s] (nan beyond `most` half swings): run l under law[l] from start =
    (angle, velocity), (L,) each."""
    own, (q, v) = forces.shaped(law), start
    sign = np.where(v != 0.0, np.sign(v), -np.sign(q - own.rest))
    sign = np.where(sign == 0.0, 1.0, sign)
    across = np.abs(v) / own.rate
    far = np.hypot(q - own.rest, across)
    centre, held = own.balance(sign, far), own.held(far)
    ahead = -sign * (q - centre)
    radius, begin = np.hypot(ahead, across), np.arctan2(across, ahead)
    radii, turned = fly(own, sign, radius, far, begin)
    alpha = angles(own, begin)
    knots = [(turned / own.rate, centre - sign * radii * np.cos(alpha), sign * own.rate * radii * np.sin(alpha))]
    # half swing after half swing: its amplitude, centre, sign and begin
    end = np.array([t[-1] for t in times])
    sides = [table.shape[..., -1][law, (s > 0).astype(int)] for s in (-sign, sign)]  # (L, NODES, 2) each
    at, radius, now = knots[0][0][-1], radii[-1], sign
    halves = []
    while np.any(at < end) and len(halves) < most:
        landed, now = centre + now * radius, -now
        far = radius - held
        held = own.held(far)
        radius = far - held
        stands = radius <= 0.0  # within dry friction's bound at rest
        radius = np.where(stands, 0.0, radius)
        centre = np.where(stands, landed, own.balance(now, far))
        basis = table.basis(radius)
        share, turn = np.einsum("lm,lmf->fl", basis, sides[len(halves) % 2])
        halves.append((at, centre, radius, now, basis))
        at, radius = at + np.where(stands, np.pi, turn) / own.rate, radius * share
    knots += _filled(own, law, table, halves)
    when, where, speed = (np.concatenate(x).T for x in zip(*knots, strict=True))
    return _read(when, where, speed, times)


def _filled(own: Forces, law: Array, table: Table, halves: list) -> list[tuple[Array, Array, Array]]:
    """Times, angles and velocities (K STEPS, L) along the half swings."""
    if not halves:
        return []
    at, centre, radius, sign = (np.stack([h[k] for h in halves]) for k in range(4))
    basis = np.stack([h[4] for h in halves], 1)  # (L, K, NODES)
    share, turned = np.empty((2, STEPS + 1, *radius.shape))
    for parity in (0, 1):
        if parity < len(halves):
            shape = table.shape[law, (sign[parity] > 0).astype(int)].reshape(len(law), NODES, -1)
            out = (basis[:, parity::2] @ shape).reshape(len(law), -1, 2, STEPS + 1)
            share[:, parity::2], turned[:, parity::2] = out.transpose(2, 3, 1, 0)
    alpha = angles(own, 0.0)[:, None, None]
    r = radius * share
    turned = np.where(radius > 0.0, turned, alpha)
    knots = at + turned / own.rate, centre - sign * r * np.cos(alpha), sign * own.rate * r * np.sin(alpha)
    return [tuple(x[1:].transpose(1, 0, 2).reshape(-1, len(law)) for x in knots)]


def _read(when: Array, where: Array, speed: Array, times: list[Array]) -> list[Array]:
    """Cubic Hermite interpolation of every run's knots (L, n) at its times."""
    count, size = when.shape
    apart = max(float(np.max(when)), max(float(t[-1]) for t in times)) + 1.0
    length = np.array([len(t) for t in times])
    run = np.repeat(np.arange(count), length)
    asked = np.concatenate(times)
    k = np.searchsorted((when + apart * np.arange(count)[:, None]).ravel(), asked + apart * run, side="right")
    k = np.clip(k - 1, run * size, run * size + size - 2)
    t0, q0, v0 = when.ravel(), where.ravel(), speed.ravel()
    h = np.maximum(t0[k + 1] - t0[k], 1e-300)
    s = (asked - t0[k]) / h
    rise, a, b = q0[k + 1] - q0[k], h * v0[k], h * v0[k + 1]
    out = q0[k] + s * (a + s * (3.0 * rise - 2.0 * a - b + s * (a + b - 2.0 * rise)))
    out = np.where(s <= 1.0 + 1e-9, out, np.nan)
    return np.split(out, np.cumsum(length)[:-1])


__all__ = ["FARTHEST", "MOST", "Forces", "Table", "amplitude", "fly", "motion", "tabulated"]
