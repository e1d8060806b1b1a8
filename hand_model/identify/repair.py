"""Corrections of the recording before anything is fitted to it: exchanged labels, and markers that slip on their
segment."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ..rotation import rotation_about
from .chain import ChainData, propagate
from .likelihood import ChainFit

Array = NDArray[np.float64]

# A support does not move by less than this [m] and stay there; rounding in a file may.
SMALLEST_SLIP_M = 2e-5
# Slips of one support's markers are found some blocks apart [frames].
SAME_MOMENT = 150
# Frames over which a marker's last place says where it will be.
LONGEST_GAP = 10


@dataclass(frozen=True)
class Swap:
    """Labels that were exchanged from frame start to frame stop (inclusive)."""

    labels: tuple[str, ...]
    start: int
    stop: int


@dataclass(frozen=True)
class Slip:
    """A marker that moved on its segment before `frame`. shift_palm: (3,) [m], at rest."""

    label: str
    frame: int
    shift_palm: Array


def repair_labels(data: ChainData) -> tuple[ChainData, tuple[Swap, ...]]:
    """Undo exchanged labels: where a cluster loses its shape, markers are followed from the last sound frame.

    A permutation is applied only where it brings every marker nearer to its track than the labels do, by more than half
    of the smallest distance between two markers, and leaves the clusters no more out of shape: a marker that slipped
    keeps its cluster broken for as long as the recording lasts, and tracks may be lost meanwhile. Two labels that jump
    to each other's places from one frame to the next are exchanged until they jump back or the cluster's shape says
    that they are back, whether or not the shape shows the exchange (a nearly symmetrical one does not).
    """
    spacing = _spacing(data)
    shape = _Shape.of(data)
    order = _jumped(data, spacing, shape)
    y = np.take_along_axis(data.position_world, order[..., None], axis=1)
    data = replace(data, position_world=y)
    broken = shape.broken(y)
    if not broken.any() or broken.all():
        return data, _swaps(order, data.labels)
    fixed = y.copy()
    for run in _runs(broken):
        forward = run[0] > 0
        frames = range(run[0], run[1] + 1) if forward else range(run[1], run[0] - 1, -1)
        last = _last_seen(fixed, run[0] - 1 if forward else run[1] + 1, forward)
        for f in frames:
            permutation = _follow(y[f], last, spacing)
            stay = np.arange(len(permutation))
            if (permutation != stay).any() and shape.worse(y[f, permutation], y[f]):
                permutation = stay
            order[f] = order[f, permutation]
            fixed[f] = y[f, permutation]
            seen = np.isfinite(fixed[f, :, 0])
            near = seen & (np.linalg.norm(np.nan_to_num(fixed[f]) - last, axis=1) < spacing / 2)
            last[near] = fixed[f, near]
    repaired = replace(data, position_world=fixed)
    return repaired, _swaps(order, data.labels)


def _jumped(data: ChainData, spacing: float, shape: _Shape) -> NDArray[np.int64]:
    """(n, m) column that each label has in truth, by pairs of labels that jump to each other's last places and back, or
    until the clusters' shape says that they are back (they may return behind a gap)."""
    y = data.position_world
    n, m = y.shape[:2]
    order = np.tile(np.arange(m), (n, 1))
    seen = np.isfinite(y[..., 0])
    index = np.maximum.accumulate(np.where(seen, np.arange(n)[:, None], 0), axis=0)
    last = np.take_along_axis(y, index[..., None], axis=0)  # held over gaps
    recent = (np.arange(n)[:, None] - index)[:-1] < LONGEST_GAP
    for a in range(m):
        for b in range(a + 1, m):
            stay = np.minimum(*(np.linalg.norm(y[1:, i] - last[:-1, i], axis=-1) for i in (a, b)))
            cross = np.maximum(*(np.linalg.norm(y[1:, i] - last[:-1, j], axis=-1) for i, j in ((a, b), (b, a))))
            with np.errstate(invalid="ignore"):
                jumps = (cross < 0.4 * stay) & (stay > 0.7 * spacing) & recent[:, a] & recent[:, b]
            exchanged = np.concatenate([[False], np.cumsum(jumps) % 2 == 1])
            for start, stop in _runs(exchanged):
                exchanged[start + shape.until(y[start : stop + 1], a, b) : stop + 1] = False
            order[np.ix_(exchanged, [a, b])] = order[np.ix_(exchanged, [b, a])]
    return order


@dataclass(frozen=True)
class _Shape:
    """Pairs of markers of one segment (p, 2), their usual distance and how far it is usually off (p,) [m]."""

    pairs: NDArray[np.int64]
    usual: Array
    noise: Array

    @classmethod
    def of(cls, data: ChainData) -> _Shape:
        first, second = np.triu_indices(len(data.body), 1)
        pairs = np.stack([first, second], axis=1)[data.body[first] == data.body[second]]
        distance = _distances(data.position_world, pairs)
        usual = np.nanmedian(distance, axis=0)
        return cls(pairs, usual, np.nanmedian(np.abs(distance - usual), axis=0))

    def broken(self, position: Array) -> NDArray[np.bool_]:
        """Frames (n,) of positions (n, m, 3) in which a distance is off by more than its noise allows."""
        with np.errstate(invalid="ignore"):
            return (np.abs(_distances(position, self.pairs) - self.usual) > 10 * self.noise + 1e-4).any(axis=1)

    def until(self, position: Array, a: int, b: int) -> int:
        """How many of the frames of positions (n, m, 3) have columns a and b exchanged, given that the first has: as
        many as are in better shape so; all of them where the shape does not tell."""
        other = position.copy()
        other[:, [a, b]] = other[:, [b, a]]
        left = np.nancumsum(self._off(position) - self._off(other))
        best = int(np.argmax(left))
        return len(position) if left[best] - left[-1] < self._tolerance else best + 1

    def worse(self, one: Array, other: Array) -> bool:
        """Whether markers (m, 3) are farther out of shape than others, by more than noise allows."""
        off = self._off(np.stack([one, other]))
        return bool(off[0] > off[1] + self._tolerance)

    @property
    def _tolerance(self) -> float:
        return float(np.nansum(10 * self.noise + 1e-4))

    def _off(self, position: Array) -> Array:
        return np.nansum(np.abs(_distances(position, self.pairs) - self.usual), axis=1)


def _distances(position: Array, pairs: NDArray[np.int64]) -> Array:
    return np.linalg.norm(position[:, pairs[:, 0]] - position[:, pairs[:, 1]], axis=-1)


def _spacing(data: ChainData) -> float:
    y = data.position_world[:: max(1, len(data.position_world) // 200)]
    first, second = np.triu_indices(y.shape[1], 1)
    distance = np.linalg.norm(y[:, first] - y[:, second], axis=-1)
    return float(np.nanmedian(distance[:, np.isfinite(distance).any(0)], axis=0).min())


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))


def _last_seen(y: Array, frame: int, forward: bool) -> Array:
    last = np.full(y.shape[1:], np.nan)
    frames = range(frame, max(frame - 500, -1), -1) if forward else range(frame, min(frame + 500, len(y)))
    for f in frames:
        missing = np.isnan(last[:, 0])
        if not missing.any():
            break
        last[missing] = y[f, missing]
    return np.nan_to_num(last, nan=1e6)


def _follow(observed: Array, last: Array, spacing: float) -> NDArray[np.int64]:
    """Which observed column belongs to each label: nearest to the tracks, identity unless clearly better."""
    m = len(observed)
    cost = np.linalg.norm(np.nan_to_num(observed, nan=1e3)[None] - last[:, None], axis=-1)
    cost = np.minimum(cost, 2 * spacing)  # a ghost far away must not push others around
    permutation = linear_sum_assignment(cost)[1]
    changed = permutation != np.arange(m)
    gain = cost[np.arange(m), np.arange(m)] - cost[np.arange(m), permutation]
    if changed.any() and gain[changed].sum() > spacing / 2 * changed.sum() * 0.5:
        return permutation
    return np.arange(m)


def _swaps(order: NDArray[np.int64], labels: tuple[str, ...]) -> tuple[Swap, ...]:
    identity = np.arange(order.shape[1])
    swaps = []
    for start, stop in _runs((order != identity).any(1)):
        involved = np.flatnonzero((order[start : stop + 1] != identity).any(0))
        swaps.append(Swap(tuple(labels[i] for i in involved), start, stop))
    return tuple(swaps)


def find_slip(fit: ChainFit, block: int = 25) -> Slip | None:
    """The most evident slip of one marker, or None: a lasting step of its residual, seen in its segment's frame.

    The step must stand out from the scatter of block means around it (that scatter holds every slow misfit of the
    chain) with odds that no search over markers and moments explains: t above the Gaussian quantile of 1e-9, in a
    direction found from the data, and be larger than a third of the noise.
    """
    rotations = propagate(fit.chain, fit.data.body, fit.pose.angle_rad)[1]
    best: tuple[float, Slip] | None = None
    for j, label in enumerate(fit.data.labels):
        turned = np.einsum("nji,nj->ni", rotations[:, fit.data.body[j]], fit.residual_palm[:, j])
        frames = np.flatnonzero(fit.weight[:, j] > 1e-4)
        if len(frames) < 8 * block:
            continue
        count = len(frames) // block
        # ghosts do not reach a median
        means = np.median(turned[frames[: count * block]].reshape(count, block, 3), axis=1)
        score, at, step = _step(means)
        if np.linalg.norm(step) > max(fit.noise_m / 3, SMALLEST_SLIP_M) and (best is None or score > best[0]):
            best = score, Slip(label, int(frames[at * block]), step)
    return best[1] if best is not None and best[0] > 6.1 else None


def _step(means: Array) -> tuple[float, int, Array]:
    """Best single step in block means (b, 3): its t value, the block where it starts, the step (3,)."""
    count = len(means)
    total, cumulative = means.sum(0), np.cumsum(means, axis=0)[:-1]
    n_before = np.arange(1, count)[:, None]
    step = (total - cumulative) / (count - n_before) - cumulative / n_before
    gain = (step**2).sum(1) * (n_before * (count - n_before) / count)[:, 0]
    margin = max(2, count // 50)
    gain[:margin] = gain[-margin:] = 0
    at = int(np.argmax(gain)) + 1
    direction = step[at - 1] / max(np.linalg.norm(step[at - 1]), 1e-300)
    along = means @ direction
    scatter = np.concatenate([along[:at] - along[:at].mean(), along[at:] - along[at:].mean()])
    variance = max(float(scatter.var()), 1e-300)
    correlated = 1 + 2 * max(0.0, float(np.mean(scatter[:-1] * scatter[1:])) / variance)
    deviation = np.sqrt(variance * correlated * (1 / at + 1 / (count - at)))
    return float(np.linalg.norm(step[at - 1]) / max(deviation, 1e-300)), at, step[at - 1]


def split_marker(data: ChainData, slip: Slip) -> ChainData:
    """The same observations with the slipped marker as two columns: before and from the slip on."""
    j = max(
        i
        for i, label in enumerate(data.labels)
        if label == slip.label and np.isfinite(data.position_world[slip.frame :, i, 0]).any()
    )
    before, after = data.position_world[:, j].copy(), data.position_world[:, j].copy()
    before[slip.frame :], after[: slip.frame] = np.nan, np.nan
    y = np.insert(data.position_world, j + 1, after, axis=1)
    y[:, j] = before
    labels = (*data.labels[: j + 1], slip.label, *data.labels[j + 1 :])
    return ChainData(y, np.insert(data.body, j + 1, data.body[j]), labels)


def level_last_joint(fit: ChainFit) -> ChainFit:
    """The fit with the last joint's angle made continuous where its whole support turned on the segment.

    Such a turn about the joint's own axis cannot be told from an angle by the markers of that support; but the linkage
    can: the last angle is a smooth function of the first, before and after, up to that step. Found by least squares
    (quartic and step).
    """
    k = fit.data.n_joints - 1
    late = _after_support_slip(fit, k + 1)
    if k == 0 or late is None:
        return fit
    columns, frames = late
    angle = fit.pose.angle_rad
    used = (fit.weight[:, fit.data.body == k + 1] > 0.5).sum(1) >= 2
    basis = np.column_stack([np.polynomial.polynomial.polyvander(angle[:, 0], 4), frames])
    step = float(np.linalg.lstsq(basis[used], angle[used, k], rcond=None)[0][-1])
    levelled = angle.copy()
    levelled[frames, k] -= step
    axis, centre = fit.chain.axis_palm[k], fit.chain.centre_palm[k]
    marker = fit.chain.marker_palm.copy()
    marker[columns] = centre + (marker[columns] - centre) @ rotation_about(axis, step).T
    return replace(fit, chain=replace(fit.chain, marker_palm=marker), pose=replace(fit.pose, angle_rad=levelled))


def _after_support_slip(fit: ChainFit, body: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]] | None:
    """Columns and frames after the moment from which on no marker of a body sits where it sat before; None where one
    does."""
    columns = np.flatnonzero(fit.data.body == body)
    seen = fit.weight[:, columns] > 0.5
    frames = np.arange(len(seen))
    spans = [(frames[s].min(), frames[s].max()) if s.any() else (0, -1) for s in seen.T]
    alive = [(c, a, b) for c, (a, b) in zip(columns, spans, strict=True) if b >= a]
    for _, moment, _ in sorted(alive, key=lambda item: item[1]):
        early = [c for c, _, b in alive if b < moment + SAME_MOMENT]
        later = [c for c, a, _ in alive if a >= moment]
        if early and later and len(early) + len(later) == len(alive):
            return np.array(later), frames >= moment
    return None
