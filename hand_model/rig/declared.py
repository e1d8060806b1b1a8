"""The declared parameters fitted to the recordings, and written back: the "before" of every comparison."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .balance import MOMENTS, STATE_CUTOFF, Column, Rows, declared_columns
from .dynamics import inertial_parameters
from .model import RigModel, RigTrial
from .overrides import compile_model
from .solve import solve_bounded, squared_error
from .trial_balance import rows_with_rests, trial_rows

Array = NDArray[np.float64]

NONNEGATIVE = ("damping", "frictionloss", "armature", "back_emf", "spring", "stiffness")
CORRELATED = 30.0  # neighbouring samples say the same thing: so many of them weigh as one against the prior
NEAR_BEST = 1.1
ENOUGH_POWER = 1e-4  # share of the effort's power: a hundredth of its amplitude
CUTOFFS = (2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 35.0, 60.0)
MOST_NOISE = 0.1  # of the acceleration: a hundredth of its power
FEWER = 0.9  # of the samples in which a joint is seen to move: below, noise hides it
MOSTLY = 0.5  # of what smooth loads leave, that is left beside what recordings share by place, at most
NARROW = 256  # places along the range, at which recordings may have something in common
PLACES, SLOW = 8, np.geomspace(0.05, 0.4, 3)  # hats along the range; Stribeck speeds over the greatest
ALIKE = 1e-9  # of a column's square: columns that are the same but for so much are one
END_S = 2.0 / CUTOFFS[-1]  # at the very ends any filter fails


@dataclass(frozen=True)
class DeclaredFit:
    """Declared parameters after the fit. columns and theta (P,) correspond; scale: joint -> residual rms [effort unit];
    rows: every trial's balance at the chosen cut-off; quality: (trial, joint) -> share of the effort left unexplained
    (residual rms / effort rms)."""

    columns: tuple[Column, ...]
    theta: Array
    scale: dict[str, float]
    rows: tuple[Rows, ...]
    cutoff_hz: float
    quality: dict[tuple[str, str], float]
    bodies: Array = field(default_factory=lambda: np.zeros((0, 10)))  # declared inertial parameters, in columns' order
    # no effort is recorded anywhere: only ratios show, and the heaviest body's declared weight is the scale
    anchored: bool = False
    # (trial, joint) -> effort (n,) of effects at full rate
    beside: Mapping[tuple[str, str], Array] = field(default_factory=dict)
    kept: tuple[str, ...] = ()  # joints whose rest is kept in the balance

    def residual(self, row: Rows) -> Array:
        """Effort that the declared model leaves (m,), on the thinned grid."""
        return row.effort - row.columns @ self.theta

    def expected(self, row: Rows) -> Array:
        """Effort (n,) that the joint's own drive has to give, effects beside the declared parameters included."""
        return row.expected(self.theta) + self.beside.get((row.trial, row.joint), 0.0)


def bounds(columns: Sequence[Column]) -> tuple[Array, Array]:
    """Physical bounds of declared parameters: dissipation, springs and rotor inertia are never negative."""
    low = np.array([0.0 if c.kind in NONNEGATIVE or c.part in ("m", "Ixx", "Iyy", "Izz") else -np.inf for c in columns])
    return low, np.full(len(columns), np.inf)


def prior(columns: Sequence[Column], anchored: bool = False) -> tuple[Array, Array]:
    """Prior mean and weight (P,): a mass may be wrong by as much as itself, friction and springs by a hundred times;
    the weight (mass, first moments) of the heaviest body is not wrong at all where it is the scale (anchored)."""
    value = np.array([c.value for c in columns])
    moment = {c.name: 0.0 for c in columns if c.kind == "inertial"}
    for c in columns:
        if c.kind == "inertial" and c.part in ("m", "hx", "hy", "hz"):
            moment[c.name] = max(moment[c.name], abs(c.value) * (0.1 if c.part == "m" else 1.0))
    zero = np.array([moment.get(c.name, 0.0) if c.value == 0 and c.kind == "inertial" else 0.0 for c in columns])
    value_size = np.maximum(np.abs(value), zero)
    loose = np.array([1.0 if c.kind == "inertial" else 100.0 for c in columns])
    if anchored:
        heaviest = max(moment, key=lambda body: moment[body], default="")
        loose = np.where([c.name == heaviest and c.part in ("m", *MOMENTS) for c in columns], 1e-6, loose)
    weight = CORRELATED / np.maximum(value_size * loose, 1e-150) ** 2
    return value, np.where(value_size == 0, 1e-12, weight)


def fit_rows(
    columns: Sequence[Column],
    rows: Sequence[Rows],
    scale: dict[str, float],
    weight: dict[str, float],
    anchored: bool = False,
) -> Array:
    """theta (P,) from the moving samples of the rows; scale: joint -> residual rms; weight: trial -> 0..1."""
    p = len(columns)
    gram, moment = np.zeros((p, p)), np.zeros(p)
    for row in rows:
        w = weight.get(row.trial, 1.0) / scale[row.joint] ** 2
        gram += w * row.sums[0]
        moment += w * row.sums[1]
    low, high = bounds(columns)
    mean, stiff = prior(columns, anchored)
    return solve_bounded(gram, moment, low, high, mean, stiff)


def fit_declared(
    rig: RigModel,
    refused: Collection[tuple[str, str]] = (),
    cutoff_hz: float | None = None,
    off_axis: bool = False,
    kept: Collection[str] = (),
) -> DeclaredFit:
    """Fit the declared parameters to the trials that do not validate.

    refused: (trial, joint) whose effort channel cannot be trusted; their balance is not fitted, nor kept; kept: joints
    whose rest is. A trial that disagrees with the others weighs less (its residual rms over the median of all, squared,
    beyond two).
    The cut-off is the highest at which the declared model, or it beside any load and friction that are smooth in
    position and speed, explains nearly the largest share of the effort: below it the motion is lost, above it are noise
    and flexibility that no rigid model holds.
    """
    columns = declared_columns(rig, off_axis)
    refused = set(refused)
    cutoff = cutoff_hz or _choose_cutoff(rig, columns, refused, kept)
    rows = tuple(
        r
        for t in rig.trials
        for r in trial_rows(rig, t, columns, cutoff, kept=kept)
        if (r.trial, r.joint) not in refused
    )
    fit = _robust_fit(columns, rows, cutoff or (rows[0].cutoff_hz if rows else float("nan")))
    model = compile_model(rig)
    names = dict.fromkeys(c.name for c in columns if c.kind == "inertial")
    bodies = [inertial_parameters(model)[model.body(n).id - 1] for n in names]
    return replace(fit, bodies=np.array(bodies).reshape(-1, 10), kept=tuple(kept))


def _choose_cutoff(
    rig: RigModel, columns: tuple[Column, ...], refused: set[tuple[str, str]], kept: Collection[str] = ()
) -> float | None:
    """The highest cut-off at which the share left is within NEAR_BEST of the least, below the first band that adds more
    to the residual than to the effort: there is nothing of the motion in it; or the widest band of all, where what
    recordings share by place explains for the most part what is left there, and less is left than in that other band (a
    ripple that passes fast). None where none can be tried.

    Shares are asked with all rests, of which a wide band spreads least, and of two models, for what is missing may be
    seen in wide bands alone, and is no reason against them."""
    most, last, fit = 0.0, None, None
    shares: dict[float, tuple[float, float]] = {}
    for cutoff in CUTOFFS:
        moving, rows, seen = _bands(rig, columns, refused, kept, cutoff)
        if seen is None:
            continue
        most = max(most, seen)
        if seen < FEWER * most or (shares and _drowns(rows)):  # noise hides when the joint moves, or how it accelerates
            break
        fit = _robust_fit(columns, rows, cutoff)
        powers = _powers(fit if moving is rows else _robust_fit(columns, moving, cutoff))
        if last is not None and _only_noise(last, powers):
            fit = _widest(rig, columns, refused, kept, cutoff, most) or fit
            break
        shares[cutoff], last = (_unexplained(fit, False), _unexplained(fit, True)), powers
    least = np.min([*shares.values(), (1.0, 1.0)], 0)
    best = max((c for c, share in shares.items() if np.any(share <= NEAR_BEST * least)), default=None)
    if fit is None or best in (None, fit.cutoff_hz):
        return best
    by_place = _unexplained(fit, True, True)
    return fit.cutoff_hz if by_place < min(MOSTLY * _unexplained(fit, True), shares[best][1]) else best


def _bands(
    rig: RigModel, columns: tuple[Column, ...], refused: set[tuple[str, str]], kept: Collection[str], cutoff: float
) -> tuple[tuple[Rows, ...], tuple[Rows, ...], float | None]:
    """Balances of some training recordings at a cut-off [Hz], with rests as they are kept and with all of them (the same
    where nothing rests), and the share of samples in which joints are seen to move; None where none do, or none is wide
    enough. The same samples for all cut-offs: what a low one spoils near the ends counts against it."""

    pairs = [rows_with_rests(rig, t, columns, cutoff, END_S, kept) for t in _sample(rig)]
    moving, resting = (
        tuple(r for rows in side for r in rows if (r.trial, r.joint) not in refused)
        for side in zip(*pairs, strict=True)
    )
    resting = resting if any(len(r.weight) for r in moving) else moving
    if not any(r.moving.sum() > 10 for r in moving) or cutoff > 0.3 * min(r.rate_hz for r in resting):
        return moving, resting, None
    return moving, resting, float(np.mean([r.moving.mean() for r in resting]))


def _widest(
    rig: RigModel,
    columns: tuple[Column, ...],
    refused: set[tuple[str, str]],
    kept: Collection[str],
    above: float,
    most: float,
) -> DeclaredFit | None:
    """The fit at the highest cut-off above one [Hz] that shows the motion; None where none does. most: share of samples
    in which joints are seen to move."""
    for cutoff in reversed([c for c in CUTOFFS if c > above]):
        _, rows, seen = _bands(rig, columns, refused, kept, cutoff)
        if seen is not None and seen >= FEWER * most and not _drowns(rows):
            return _robust_fit(columns, rows, cutoff)
    return None


def _drowns(rows: Sequence[Rows]) -> bool:
    """Whether noise of the positions is so large a part of the accelerations that a fit would read too small an inertia
    (errors in variables, Fuller 1987). Within one band white noise leaves sqrt(3 / 5) 2 pi c times as much in them as
    in velocities."""
    parts = []
    for r in rows:
        velocity = r.rest_speed / 3.0 / STATE_CUTOFF**1.5  # its noise within the balance's own band
        noise = np.sqrt(0.6) * 2 * np.pi * r.cutoff_hz * velocity
        parts.append(noise / (float(np.std(r.filtered(r.acceleration))) + 1e-300))
    return bool(np.median(parts) > MOST_NOISE)


def _powers(fit: DeclaredFit) -> Array:
    """Mean squares of what the balance has to explain and of what it leaves, (joints, 2)."""
    joints = sorted({r.joint for r in fit.rows})
    sides = [
        [
            np.concatenate([side(r) for r in fit.rows if r.joint == j])
            for side in (lambda r: _known(r, fit.columns), fit.residual)
        ]
        for j in joints
    ]
    return np.array([[np.mean(known**2), np.mean(left**2)] for known, left in sides])


def _only_noise(before: Array, after: Array) -> bool:
    """Whether a wider band adds more to the residual than to the effort, and enough of it to matter; powers (joints,
    2)."""
    effort, left = np.mean((after - before) / (after[:, :1] + 1e-300), 0)
    return bool(left > max(effort, ENOUGH_POWER))


def _sample(rig: RigModel, most: int = 5) -> list[RigTrial]:
    """Training trials enough to choose a cut-off by."""
    train = rig.select(validate=False)
    return list(train[:: max(1, int(np.ceil(len(train) / most)))])


def _unexplained(fit: DeclaredFit, beside: bool, by_place: bool = False) -> float:
    """Share of the training effort left (rms over rms, all trials of a joint pooled), geometric mean over joints;
    beside: where any smooth load and friction stand beside the declared columns; by_place: and what each recording has
    in common with the others by place."""
    shares = []
    for joint in {r.joint for r in fit.rows}:
        rows = [r for r in fit.rows if r.joint == joint and not r.validate and r.moving.any()]
        if rows:
            left = [fit.residual(r)[r.moving] for r in rows]
            left = _beside_smooth(rows, left) if beside else left
            if by_place:
                left = _beside_places([r.filtered(r.position)[r.moving] for r in rows], left)
            known = np.concatenate([_known(r, fit.columns)[r.moving] for r in rows])
            shares.append(np.log(_rms(np.concatenate(left)) / (_rms(known) + 1e-300) + 1e-12))
    return float(np.exp(np.mean(shares))) if shares else 1.0


def _beside_smooth(rows: Sequence[Rows], left: Sequence[Array]) -> list[Array]:
    """What is left of residuals (moving samples of each row) beside any smooth load and friction."""
    x = np.concatenate([np.concatenate([r.columns, _smooth(r)], 1)[r.moving] for r in rows])
    x = x[:, np.any(x != 0, 0)]
    x, y = x / (np.linalg.norm(x, axis=0) + 1e-300), np.concatenate(left)
    y = y - x @ np.linalg.solve(x.T @ x + ALIKE * np.eye(x.shape[1]), x.T @ y)
    return np.split(y, np.cumsum([len(e) for e in left])[:-1])


def _beside_places(places: Sequence[Array], left: Sequence[Array]) -> list[Array]:
    """What is left of residuals, of each recording at its positions, beside the mean that the other recordings have at
    each of many places; as they are where it tells nothing of them."""
    if len(left) < 2:
        return list(left)
    low, high = min(p.min() for p in places), max(p.max() for p in places)
    at = [np.minimum(((p - low) / (high - low + 1e-300) * NARROW).astype(int), NARROW - 1) for p in places]
    sums, counts = (
        np.array([np.bincount(k, w, minlength=NARROW) for k, w in zip(at, weights, strict=True)])
        for weights in (left, [np.ones(len(e)) for e in left])
    )
    others, count = sums.sum(0) - sums, counts.sum(0) - counts
    means = np.divide(others, count, out=np.zeros_like(others), where=count > 0)
    beside = [e - mean[k] for e, mean, k in zip(left, means, at, strict=True)]
    return beside if _rms(np.concatenate(beside)) < _rms(np.concatenate(left)) else list(left)


def _smooth(row: Rows) -> Array:
    """Columns (m, k) of any load that is smooth in position, of any friction that is so in position or falls with
    speed, of drag."""
    low, size = row.position.min(), float(np.percentile(np.abs(row.velocity), 95)) + 1e-300
    at = (row.position - low) / (float(np.ptp(row.position)) + 1e-300) * (PLACES - 1)
    hats, v = np.maximum(1 - np.abs(at[:, None] - np.arange(PLACES)), 0.0), row.velocity / size
    slow = np.exp(-((v[:, None] / SLOW) ** 2))
    return row.filtered(
        np.column_stack([hats, np.column_stack([hats, slow]) * row.direction[:, None], np.abs(v), v * np.abs(v)])
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _robust_fit(columns: tuple[Column, ...], rows: tuple[Rows, ...], cutoff: float) -> DeclaredFit:
    train = [r for r in rows if not r.validate and r.moving.sum() > 10]
    joints = sorted({r.joint for r in train})
    size = {
        j: _rms(np.concatenate([_known(r, columns)[r.moving] for r in train if r.joint == j])) + 1e-300 for j in joints
    }
    scale, weight = dict(size), {}
    anchored = not any(np.any(r.effort) for r in rows)
    theta = np.array([c.value for c in columns])
    for _ in range(12):
        theta = fit_rows(columns, train, scale, weight, anchored)
        left = {(r.trial, r.joint): _missed(r, theta) for r in train}
        for j in joints:
            scale[j] = max(float(np.median([left[r.trial, r.joint] for r in train if r.joint == j])), 1e-3 * size[j])
        weight = {
            t: min(1.0, min((2.0 * scale[j] / max(left[t, j], 1e-300)) ** 2 for j in joints if (t, j) in left))
            for t in {r.trial for r in train}
        }
    quality = {}
    for r in rows:
        m = r.moving
        quality[r.trial, r.joint] = _rms((r.effort - r.columns @ theta)[m]) / (_rms(_known(r, columns)[m]) + 1e-300)
    # of a joint that no training recording moves there is nothing to hold out
    fitted = tuple(r for r in rows if r.joint in scale)
    return DeclaredFit(columns, theta, scale, fitted, cutoff, quality, anchored=anchored)


def _missed(row: Rows, theta: Array) -> float:
    """What parameters (P,) leave of a row's moving samples, rms."""
    *sums, count = row.sums
    return float(np.sqrt(max(squared_error(*sums, theta), 0.0) / max(count, 1)))


def _known(row: Rows, columns: Sequence[Column]) -> Array:
    """What the balance has to explain: the effort, or, on a passive or open joint, the largest declared term."""
    if _rms(row.effort) > 0:
        return row.effort
    value = np.array([c.value for c in columns])
    terms = row.columns * value
    return terms[:, int(np.argmax(np.sum(terms**2, 0)))]
