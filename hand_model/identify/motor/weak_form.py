"""The regression done right: the balance in weak form on every stroke, so that nothing recorded is ever differentiated.

current = inertia a + viscous v + coulomb z + stiffness p + preload (+ rise z exp(-|v / speed|^exponent)) is multiplied
by B-splines that vanish at both ends of a stroke and integrated by parts (modulating functions, Shinbrot 1957; Preisig
& Rippin 1993): position and current pass through the same splines. At an end the drive stands still and friction turns
round, at an instant known to about a sample; as the splines vanish there, an error of it counts only in second order. A
rest is not used: friction there is known only within its bounds. Friction builds up from what it held at rest over a
distance (Dahl 1968). The encoder's noise in the regressors is simulated at the recorded instants and taken off (errors
in variables; Fuller 1987, ch. 2); the covariance is the jackknife over strokes. Needs no setpoint and no controller.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import IdentificationError
from .modulating import Modulating
from .recording import MotorTrial

Array = NDArray[np.float64]

GIVE = (0.02, 0.3, 0.6, 1.0)  # [%], distances tried first; the least of them is Coulomb's friction to any encoder here
# speed [%/s] and exponent, profiled
STRIBECK = tuple(itertools.product((6.0, 10.0, 15.0, 22.0, 32.0, 45.0), (1.0, 2.0)))
RATIO = 2.0  # most that the rise is of Coulomb friction
INERTIA = 0.0125  # [raw s^2/%] of a typical finger drive, only to choose how dense the splines are
WINDOW = 5  # samples that tell motion from rest
EVIDENCE = 16.0  # fall of the misfit for which a give of the friction is believed


@dataclass(frozen=True)
class Regression:
    """values (5,) of balance.NAMES; covariance (5, 5), a jackknife over strokes; misfit: residual variance over that of
    the current's noise; give [%]: distance over which friction turns round; static_excess [raw], stribeck_speed [%/s]
    and its exponent; excess_z: the excess over its standard error."""

    values: Array
    covariance: Array
    misfit: float
    give: float = GIVE[0]
    static_excess: float = 0.0
    stribeck_speed: float = 20.0
    stribeck_exponent: float = 1.0
    excess_z: float = 0.0


@dataclass(frozen=True)
class Stroke:
    """A stretch of motion in one direction (sign), from begin_s to end_s [s], positions there [%], the current that
    held the drive before it [raw] (None where it did not come from rest), its samples' slice, and where friction began
    to turn round, rest [%]."""

    sign: float
    begin_s: float
    end_s: float
    begin: float
    end: float
    hold: float | None
    samples: slice
    rest: float


@dataclass(frozen=True)
class _Projected:
    """A stroke on its splines (k of them, n grid points); fixed (k, 2) acceleration and velocity, whitened;
    position, current (interpolated between samples; held_current: from those inside only) and speed (n,) on the grid;
    noise (3, 3) expected in the products of acceleration, velocity and position."""

    stroke: Stroke
    splines: Modulating
    fixed: Array
    position: Array
    current: Array
    held_current: Array
    speed: Array
    noise: Array


def fit_regressions(
    trials: Sequence[MotorTrial], sigma_position: float, sigma_current: float
) -> tuple[Regression, Regression]:
    """Least squares on all strokes, without a Stribeck rise and with one, whose speed and exponent are profiled over a
    grid.

    sigma_position [%], sigma_current [raw]: noise of one sample. Raises IdentificationError with fewer than six
    strokes.
    """
    moved = [strokes(t, sigma_position) for t in trials]
    parts = _projected(trials, moved, sigma_position, sigma_current)
    if len(parts) < 6:
        names = ", ".join(t.name for t in trials)
        raise IdentificationError(
            f"{names}: {len(parts)} strokes are long enough to be told from noise; at least six, both ways, are needed"
        )
    parts = _without_outliers(parts)
    # how friction builds up is a model of its own, and takes the place of inertia: only what slides
    if (give := _give(parts)) > GIVE[0]:
        sliding = [
            [_settled(t, s, 2.5 * give + 2 * sigma_position) for s in found]
            for t, found in zip(trials, moved, strict=True)
        ]
        parts = _without_outliers(_projected(trials, sliding, sigma_position, sigma_current), give)
    noise = sigma_current**2 * float(np.median(np.concatenate([np.diff(t.time_s) for t in trials])))
    system = _system(parts, give)
    values, covariance, square = _solve(system)
    # what the current does between the last sample outside a stroke and the first inside is not recorded
    shift = _values(_system([replace(q, current=q.held_current) for q in parts], give)) - values
    unrecorded = np.outer(shift, shift) / 4
    plain = Regression(values, covariance + unrecorded, square / noise, give)
    # a rise so broad that hardly any Coulomb friction is left is viscous friction in disguise
    systems = _rising(parts, give)
    found = [_values(x) for x in systems]
    rises = [i for i, x in enumerate(found) if x[5] < RATIO * x[2]] or range(len(found))
    best = min(rises, key=lambda i: _misfit(systems[i], found[i]))
    shape, (values, covariance, square) = STRIBECK[best], _solve(systems[best])
    excess = float(values[5])
    curved = Regression(
        values[:5],
        covariance[:5, :5] + unrecorded,
        square / noise,
        give,
        excess,
        *shape,
        excess / float(np.sqrt(covariance[5, 5])),
    )
    return plain, curved


def strokes(t: MotorTrial, sigma: float) -> list[Stroke]:
    """Strokes of a trial: where a line through the samples before and one through those after both move the same
    way."""
    time, p = t.time_s, t.position
    back, back_sd = _slope(time, p, sigma, -1)
    ahead, ahead_sd = _slope(time, p, sigma, 1)
    sign = np.where(
        (back > 3 * back_sd) & (ahead > 3 * ahead_sd),
        1,
        np.where((back < -3 * back_sd) & (ahead < -3 * ahead_sd), -1, 0),
    )
    cuts = np.r_[0, np.flatnonzero(np.diff(sign) != 0) + 1, len(sign)]
    runs = [
        (a, b) for a, b in itertools.pairwise(cuts) if sign[a] != 0 and b - a >= 4 and abs(p[b - 1] - p[a]) > 6 * sigma
    ]
    found = []
    for i, (a, b) in enumerate(runs):
        before = runs[i - 1][1] if i else 0
        after = runs[i + 1][0] if i + 1 < len(runs) else len(time)
        begin_s, begin, hold = _end(t, sigma, range(a, before, -1))
        end_s, end, _ = _end(t, sigma, range(b - 1, after - 1))
        found.append(Stroke(float(sign[a]), begin_s, end_s, begin, end, hold, slice(a, b), begin))
    return found


def _slope(time: Array, p: Array, sigma: float, way: int) -> tuple[Array, Array]:
    """Slope [%/s] of the line through each sample and those before (way -1) or after it, and its standard deviation."""
    first = np.clip(np.arange(len(time)) - (WINDOW - 1 if way < 0 else 0), 0, len(time) - WINDOW)
    index = first[:, None] + np.arange(WINDOW)
    x = time[index] - time[index].mean(axis=1, keepdims=True)
    square = np.sum(x * x, axis=1)
    return np.sum(x * p[index], axis=1) / square, sigma / np.sqrt(square)


def _end(t: MotorTrial, sigma: float, outwards: range) -> tuple[float, float, float | None]:
    """Instant [s] and position [%] at which a stroke begins or ends, and the current [raw] in the rest beyond it.

    outwards: samples from the stroke's last sure one to the neighbouring stroke. From rest the square root of the way
    travelled is linear in time, which leads back to the instant; without one the stroke ends at its last sure sample.
    """
    time, p, k = t.time_s, t.position, np.array(outwards, int)
    if len(k) < 6 or np.ptp(p[k[3:11]]) > 6 * sigma + 0.3:
        i = outwards.start
        return float(time[i]), float(p[i]), None
    rest = float(np.median(p[k[3:11]]))
    near = np.abs(p[k] - rest) < 2.5 * sigma
    m = int(k[max(int(np.argmax(near)) - 1, 0)]) if near.any() else int(k[0])
    inner = m - outwards.step
    s, s_inner = np.sqrt(abs(p[m] - rest)), np.sqrt(abs(p[inner] - rest))
    instant = time[m] - s * (time[inner] - time[m]) / max(s_inner - s, 1e-9)
    beyond = time[np.clip(m + 2 * outwards.step, 0, len(time) - 1)]
    instant = float(np.clip(instant, min(beyond, time[m]), max(beyond, time[m])))
    held = k[(time[k] - instant) * outwards.step > 0][:6]
    return instant, rest, float(t.current[held].mean()) if len(held) >= 3 else None


def _settled(t: MotorTrial, s: Stroke, travel: float) -> Stroke:
    """The stroke from where it has gone `travel` [%] on, in which friction turns round but for a small rest."""
    k = np.arange(s.samples.start, s.samples.stop)
    k = k[np.abs(t.position[k] - s.begin) > travel]
    if len(k) == 0:
        return replace(s, begin_s=s.end_s)
    return replace(s, begin_s=float(t.time_s[k[0]]), begin=float(t.position[k[0]]))


def _projected(
    trials: Sequence[MotorTrial], moved: Sequence[Sequence[Stroke]], sigma: float, sigma_current: float
) -> list[_Projected]:
    """Every stroke that is long enough on its splines; knots as dense as the noise lets accelerations be seen."""
    parts, rng = [], np.random.default_rng(0)
    for t, found in zip(trials, moved, strict=True):
        interval = float(np.median(np.diff(t.time_s)))
        spacing = max(2.5 * interval, np.pi * float(np.sqrt(INERTIA * sigma / sigma_current)))
        parts += [_project(t, s, sigma, spacing, interval / 4, rng) for s in found if s.end_s - s.begin_s > 4 * spacing]
    return parts


def _project(
    t: MotorTrial, s: Stroke, sigma: float, spacing: float, step: float, rng: np.random.Generator
) -> _Projected:
    from scipy.interpolate import make_interp_spline

    k = np.arange(max(s.samples.start - 3, 0), min(s.samples.stop + 3, len(t.time_s)))
    k = k[(t.time_s[k] > s.begin_s + 1e-4) & (t.time_s[k] < s.end_s - 1e-4)]
    at = np.r_[s.begin_s, t.time_s[k], s.end_s]
    splines = Modulating(s.begin_s, s.end_s, spacing, step)
    grid = splines.grid
    share = (grid - s.begin_s) / (s.end_s - s.begin_s)
    noise = sigma * rng.normal(size=(len(at), 2))
    noise[[0, -1]] *= 0.5  # means of a rest
    smooth = make_interp_spline(at, np.c_[np.r_[s.begin, t.position[k], s.end], noise], k=3)(grid)
    # less its chord the position vanishes at both ends, and with it what integration by parts leaves there
    bent = smooth - smooth[0] - (smooth[-1] - smooth[0]) * share[:, None]
    position, chord = smooth[:, 0], (smooth[-1, 0] - smooth[0, 0]) / (s.end_s - s.begin_s)
    accelerated = splines.products(bent, 2)
    moved, placed = (
        -splines.products(np.c_[bent[:, 0], smooth[:, 1:]], 1),
        splines.products(np.c_[bent[:, 0], np.ones(len(grid)), smooth[:, 1:]]),
    )
    velocity = moved[:, 0] + chord * placed[:, 1]
    speed = np.abs(chord + splines.slope(placed[:, 0]))
    seen = np.stack([accelerated[:, 1:], moved[:, 1:], placed[:, 2:]])
    current, held = np.interp(grid, t.time_s, t.current), np.interp(grid, t.time_s[k], t.current[k])
    noise = np.einsum("ikr,jkr->ij", seen, seen) / 2
    return _Projected(s, splines, np.c_[accelerated[:, 0], velocity], position, current, held, speed, noise)


def _rows(q: _Projected, give: float, shapes: Sequence[tuple[float, float]] = ()) -> tuple[Array, Array]:
    """Regressors (k, 5), with what each shape of a Stribeck rise adds (k, 5 + shapes), and current (k,): from rest
    friction is exp(-travel / give) of what it held, and slides for the rest."""
    left = np.exp(-np.abs(q.position - q.stroke.rest) / give)
    if q.stroke.hold is None:
        friction, held, hold = q.stroke.sign * (1 - 2 * left), np.zeros_like(left), 0.0
    else:
        friction, held, hold = q.stroke.sign * (1 - left), left, q.stroke.hold
    rises = [friction * np.exp(-((q.speed / speed) ** exponent)) for speed, exponent in shapes]
    x = q.splines.products(
        np.column_stack([friction, q.position - held * q.stroke.rest, 1 - held, *rises, q.current - held * hold])
    )
    return np.c_[q.fixed, x[:, :-1]], x[:, -1]


# by stroke: normal matrices (strokes, k, k), right sides (strokes, k); square of the current, and its rows
_System = tuple[Array, Array, float, int]


def _system(parts: Sequence[_Projected], give: float) -> _System:
    """Normal matrices less the encoder's noise, and right sides, without a Stribeck rise."""
    return _systems(parts, give, ())[0]


def _rising(parts: Sequence[_Projected], give: float) -> list[_System]:
    """The same with each shape of STRIBECK."""
    return _systems(parts, give, STRIBECK)


def _systems(parts: Sequence[_Projected], give: float, shapes: Sequence[tuple[float, float]]) -> list[_System]:
    gram, right, square, rows = [], [], 0.0, 0
    for q in parts:
        x, y = _rows(q, give, shapes)
        g = x.T @ x
        g[np.ix_([0, 1, 3], [0, 1, 3])] -= q.noise
        gram.append(g)
        right.append(x.T @ y)
        square, rows = square + float(y @ y), rows + len(y)
    columns = [[*range(5), 5 + i] for i in range(len(shapes))] or [[*range(5)]]
    gram, right = np.array(gram), np.array(right)
    return [(gram[:, k][:, :, k], right[:, k], square, rows) for k in columns]


def _values(system: _System) -> Array:
    gram, right, *_ = system
    return np.linalg.solve(gram.sum(axis=0), right.sum(axis=0))


def _misfit(system: _System, values: Array) -> float:
    """Mean square that values leave."""
    _, right, square, rows = system
    return float(max(square - right.sum(axis=0) @ values, 0.0) / rows)


def _give(parts: Sequence[_Projected]) -> float:
    """Distance over which friction turns round [%]; the least of GIVE where the strokes show none."""
    from scipy.optimize import minimize_scalar

    def cost(give: float) -> float:
        system = _system(parts, give)
        return _misfit(system, _values(system))

    costs = [cost(g) for g in GIVE]
    best = int(np.argmin(costs))
    count = sum(len(q.fixed) for q in parts)
    if best == 0 or costs[0] - costs[best] < EVIDENCE * costs[best] / count:
        return GIVE[0]
    bounds = (GIVE[best - 1] if best > 1 else 0.1, 1.8 if best == len(GIVE) - 1 else GIVE[best + 1])
    return float(minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 0.02}).x)


def _solve(system: _System) -> tuple[Array, Array, float]:
    """Values, their covariance by leaving out one stroke after the other (jackknife), and the mean square left."""
    gram, right, *_ = system
    values, n = _values(system), len(gram)
    d = np.linalg.solve(gram.sum(axis=0) - gram, (gram @ values - right)[..., None])[..., 0]
    d -= d.mean(axis=0)
    return values, (n - 1) / n * d.T @ d, _misfit(system, values)


def _without_outliers(parts: list[_Projected], give: float = GIVE[0]) -> list[_Projected]:
    """The strokes without those that the others do not explain: something held the drive, or their ends were
    misjudged."""
    for _ in range(3):
        values = _values(_system(parts, give))
        misfit = np.array([np.mean((y - x @ values) ** 2) for x, y in (_rows(q, give) for q in parts)])
        kept = [q for q, m in zip(parts, misfit, strict=True) if m < 6 * np.median(misfit)]
        if len(kept) == len(parts) or len(kept) < 6:
            break
        parts = kept
    return parts
