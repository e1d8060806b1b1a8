"""Marker station: markers against rigid segments on hinges; slips, supports that turn, hinges that are none.

Linear in everything small about the identified chain: per frame the palm pose and joint angles, shared the chain, and the
columns of a candidate. Frames are eliminated one by one (orthogonal projection), the chain by its Gram matrix, so that a
candidate's gain is what neither a pose nor another chain can explain; a step's moment is scanned by cumulative sums.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...effects.outside.outsider import UNLIKELY
from .angles import FingerAngles, refitted
from .blocks import Blocks, blocks_of, project
from .displacement import NO_HINGE, Candidate, candidates_of, creeping

Array = NDArray[np.float64]

EVIDENCE_LEAST = 15.0  # log evidence of a marker effect, beyond its parameters and the search over moments
MOST = 10  # a slip that is put right between recordings is one a recording
SKIP_P = 0.3  # lack of fit above which no candidate is tried
ALPHA = 0.003  # false alarms per finger
EXPLAINED_LEAST = 0.9  # of the misfit: below, the names are not believed
SPELL = 12  # blocks, about a second, whose mean shows what stays correlated
HINGE = ("joint_wobble", "moving_centre")
UNHINGED = (*HINGE, NO_HINGE)  # of joints that are no hinges: in step with the angle
SLIPS = ("marker_slip", "palm_marker_slip", "support_slip")
REACH = 0.06  # m: the other axis of a wobble passes nearer to its joint; farther, its centre travels
MOSTLY = 0.7  # share of what any motion in step with the angle explains


@dataclass(frozen=True)
class MarkerEffect:
    """A candidate that was chosen. everywhere: (b, 3m, c) unprojected, as if it acted always. begin, end: first block of a
    step and the one after its last, None where it acts always. coefficients: (c,) of the columns, covariance: (c, c)."""

    effect: str
    body: int
    label: str | None
    begin: int | None
    end: int | None
    everywhere: Array
    evidence: float
    gain: float
    coefficients: Array = field(default_factory=lambda: np.zeros(0))
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    shifts: tuple[bool, ...] = ()

    @property
    def columns(self) -> Array:
        """(b, 3m, c) where it acts, zero elsewhere."""
        if self.begin is None:
            return self.everywhere
        index = np.arange(len(self.everywhere))
        return self.everywhere * ((index >= self.begin) & (index < self.end))[:, None, None]

    def acts(self, blocks: Blocks, record: int, time_s: Array) -> Array:
        """(n,) one where it acts at times [s] of a record, else zero."""
        if self.begin is None:
            return np.ones(len(time_s))
        first, last = int(blocks.record[self.begin]), int(blocks.record[self.end - 1])
        here = np.full(len(time_s), first < record <= last, float)
        return (time_s >= blocks.time_s[self.begin]).astype(float) if record == first else here


@dataclass(frozen=True)
class MarkerNaming:
    """Outcome of the marker station. sigma_m: noise of one coordinate of a block mean. p_before, p_after: lack of fit.
    refused: the likeliest further effect, that did not bring enough."""

    blocks: Blocks
    found: tuple[MarkerEffect, ...]
    sigma_m: float
    p_before: float
    p_after: float
    excess_before: float
    excess_after: float
    refused: MarkerEffect | None = None

    @property
    def believed(self) -> bool:
        """Whether the names stand: what they leave is noise, or they take most of the misfit away."""
        return bool(self.found) and (self.p_after >= ALPHA or self.excess_after < (1 - EXPLAINED_LEAST) * self.excess_before)


def name_markers(angles: FingerAngles) -> MarkerNaming:
    """Name slips and hinges that are none in the flexion recordings of one finger, by forward selection."""
    return named_in(blocks_of(angles))


def named_in(blocks: Blocks) -> MarkerNaming:
    """The same of its blocks of frames. Slips of one place are a creep where an even motion says as much."""
    y = project(blocks, blocks.residual.reshape(len(blocks.residual), -1, 1))
    shared = project(blocks, blocks.chain_columns)
    sigma = _noise(y, blocks)
    p_before, excess_before = _lack(_solve(shared, y)[1], blocks)
    if p_before > SKIP_P:
        return MarkerNaming(blocks, (), sigma, p_before, p_before, excess_before, excess_before)
    candidates = candidates_of(blocks)
    moments = {id(c.columns): _moments(project(blocks, c.columns), shared, y) for c in candidates}
    found, refused = _selected(candidates, blocks, y, shared, moments, sigma)
    for place in dict.fromkeys((e.body, e.label) for e in found if e.begin is not None):
        others = [e for e in found if e.begin is None or (e.body, e.label) != place]
        slips = [c for c in candidates if c.step and c.lasting and (c.body, c.label) == place]
        creeps = [_moving(c, blocks, y, shared, sigma) for slip in slips for c in creeping(blocks, slip)]
        creep = max(creeps, key=lambda c: c.gain)
        if _score([*others, creep], blocks, y, shared, sigma) > _score(found, blocks, y, shared, sigma) + UNLIKELY:
            found = [creep, *others]
    every = _with(shared, found, blocks)
    inverse, right = _chain_part(every, y)
    coefficients = inverse @ right
    residual = y - every @ coefficients[:, None]
    covariance = inverse * sigma**2 * _inflation(residual, blocks)
    p, excess = _lack(residual, blocks)
    start = blocks.chain_columns.shape[-1]
    done = []
    for effect in found:
        own = slice(start, start + effect.everywhere.shape[-1])
        done.append(replace(effect, coefficients=coefficients[own], covariance=covariance[own, own]))
        start = own.stop
    return MarkerNaming(blocks, tuple(done), sigma, p_before, p, excess_before, excess, refused)


def _selected(candidates: list[Candidate], blocks: Blocks, y: Array, shared: Array, moments: dict[int, _Moments],
              sigma: float) -> tuple[list[MarkerEffect], MarkerEffect | None]:
    """What forward selection finds, and the likeliest further effect, that did not bring enough."""
    found: list[MarkerEffect] = []
    while len(found) < MOST:
        known = {e.body for e in found if e.effect in HINGE}
        chain = _chain_part(shared, y)
        tried = [_try(c, blocks, moments[id(c.columns)], chain, sigma) for c in candidates if c.effect != NO_HINGE or c.body not in known]
        best = _choose(tried)
        if best.effect == "joint_wobble" and _reach(best, blocks, shared, y) > REACH:
            best = max((e for e in tried if e.effect == "moving_centre" and e.body == best.body), key=lambda e: e.evidence)
        more = project(blocks, best.columns)
        wider = np.concatenate([shared, more], axis=-1)
        # What stays correlated beside the best candidate weighs all of them down.
        best = replace(best, evidence=best.evidence - 0.5 * best.gain * (1 - 1 / _inflation(_solve(wider, y)[1], blocks)))
        if best.evidence < EVIDENCE_LEAST:
            return found, best
        found.append(best)
        shared = wider
        moments = {key: value.with_shared(more) for key, value in moments.items()}
    return found, None


def _moving(candidate: Candidate, blocks: Blocks, y: Array, shared: Array, sigma: float) -> MarkerEffect:
    """What a candidate brings beside the chain alone."""
    return _try(candidate, blocks, _moments(project(blocks, candidate.columns), shared, y), _chain_part(shared, y), sigma)


def _with(shared: Array, found: list[MarkerEffect], blocks: Blocks) -> Array:
    return np.concatenate([shared, *(project(blocks, e.columns) for e in found)], axis=-1)


def _score(found: list[MarkerEffect], blocks: Blocks, y: Array, shared: Array, sigma: float) -> float:
    """Log likelihood less the penalty of Schwarz (1978); a step has a moment, too."""
    residual = _solve(_with(shared, found, blocks), y)[1]
    count = sum(e.everywhere.shape[-1] + (e.begin is not None) for e in found)
    return -0.5 * float(np.sum(residual**2)) / sigma**2 - 0.5 * count * float(np.log(max((blocks.weight > 0).sum() * 2, 2)))


def _choose(tried: list[MarkerEffect]) -> MarkerEffect:
    """The likeliest. Any motion in step with the angle is what no known form explains: where one takes most of it, it is that
    one, seen to first order."""
    best = max(tried, key=lambda e: e.evidence)
    if best.effect != NO_HINGE:
        return best
    named = max((e for e in tried if e.effect in HINGE and e.body == best.body), key=lambda e: e.evidence)
    return named if named.gain > MOSTLY * best.gain else best


def _reach(wobble: MarkerEffect, blocks: Blocks, shared: Array, y: Array) -> float:
    """How far [m] from the joint the other axis of a wobble passes: what it shifts over what it turns (root mean squares)."""
    shifts = np.array(wobble.shifts)
    if not shifts.any():
        return 0.0
    more = project(blocks, wobble.everywhere)
    own = _solve(np.concatenate([shared, more], axis=-1), y)[0][shared.shape[-1] :]
    moved = (wobble.everywhere[..., shifts] @ own[shifts]).reshape(len(y), -1, 3)
    turned = (wobble.everywhere[..., ~shifts] @ own[~shifts]).reshape(len(y), -1, 3)
    carried = np.flatnonzero(blocks.body == wobble.body)
    spread = turned[:, carried] - turned[:, carried].mean(1, keepdims=True)
    arm = blocks.position[:, carried] - blocks.position[:, carried].mean(1, keepdims=True)
    tilt = np.sqrt(np.sum(spread**2) / max(float(np.sum(arm**2)) * 2 / 3, 1e-300))  # of arms in all directions, two thirds are across
    return float(np.sqrt(np.mean(np.sum(moved[:, carried] ** 2, axis=-1))) / max(tilt, 1e-12))


def _inflation(residual: Array, blocks: Blocks) -> float:
    """Variance of means over SPELL blocks of the residual (b, 3m, 1) over what independent blocks would have, at least one."""
    z = residual[..., 0]
    same = blocks.record[1:] == blocks.record[:-1]
    white = 0.5 * float(np.sum(np.mean(np.diff(z, axis=0)[same] ** 2, axis=0)))
    spells = [z[i : i + SPELL].mean(0) for r in np.unique(blocks.record) for rows in [np.flatnonzero(blocks.record == r)]
              for i in range(rows[0], rows[-1] + 2 - SPELL, SPELL)]
    if len(spells) < 4:
        return 1.0
    return max(SPELL * float(np.sum(np.mean(np.square(spells), axis=0))) / max(white, 1e-300), 1.0)


def _solve(shared: Array, y: Array) -> tuple[Array, Array]:
    """Shared coefficients and the residual (b, 3m, 1) that they leave."""
    inverse, right = _chain_part(shared, y)
    coefficients = inverse @ right
    return coefficients, y - shared @ coefficients[:, None]


def _noise(y: Array, blocks: Blocks) -> float:
    """Noise [m] of one coordinate: differences of neighbouring blocks, in which slow misfit cancels."""
    same = blocks.record[1:] == blocks.record[:-1]
    square = np.diff(y[..., 0], axis=0)[same] ** 2
    free = (blocks.weight > 0).sum(1) * 3 - blocks.pose_basis.shape[-1]
    return float(np.sqrt(0.5 * np.median(square.sum(1) / np.maximum(free[1:][same], 1)) / 0.965))


@dataclass(frozen=True)
class _Moments:
    """Products per block of projected columns d: with themselves (b, c, c), with the shared ones (b, s, c), with y (b, c)."""

    d: Array
    dd: Array
    sd: Array
    dy: Array

    def with_shared(self, more: Array) -> _Moments:
        """The same with further shared columns (b, 3m, e)."""
        return _Moments(self.d, self.dd, np.concatenate([self.sd, np.swapaxes(more, 1, 2) @ self.d], axis=1), self.dy)


def _moments(d: Array, shared: Array, y: Array) -> _Moments:
    turned = np.swapaxes(d, 1, 2)
    return _Moments(d, turned @ d, np.swapaxes(shared, 1, 2) @ d, (turned @ y)[..., 0])


def _chain_part(shared: Array, y: Array) -> tuple[Array, Array]:
    """Pseudo-inverse of the shared columns' Gram matrix, and their products with y."""
    flat = shared.reshape(-1, shared.shape[-1])
    gram = flat.T @ flat
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    return np.linalg.pinv(gram / np.outer(size, size), rcond=1e-9, hermitian=True) / np.outer(size, size), flat.T @ y.ravel()


def _try(candidate: Candidate, blocks: Blocks, moments: _Moments, chain: tuple[Array, Array], sigma: float) -> MarkerEffect:
    """Gain of a candidate beyond poses and chain; a step at its best moment."""
    dd, sd, dy = moments.dd, moments.sd, moments.dy
    inverse, sy = chain
    width = dd.shape[-1]
    total = np.trace(dd.sum(0)) / width
    last = np.searchsorted(blocks.record, blocks.record, side="right")  # records follow each other
    if not candidate.step:
        dd, sd, dy = (v.sum(0, keepdims=True) for v in (dd, sd, dy))
    elif candidate.lasting:
        dd, sd, dy = (np.cumsum(v[::-1], axis=0)[::-1] for v in (dd, sd, dy))
    else:
        dd, sd, dy = (_until(v, last) for v in (dd, sd, dy))
    free = dd - np.swapaxes(sd, 1, 2) @ (inverse @ sd) + 1e-6 * total * np.eye(width)
    right = dy - np.einsum("bsc,s->bc", sd, inverse @ sy)
    gain = np.einsum("bc,bc->b", right, np.linalg.solve(free, right[..., None])[..., 0]) / sigma**2
    if candidate.step:
        gain[:3] = gain[-3:] = 0.0
    at = int(np.argmax(gain))
    parameters = width + (1 if candidate.step else 0)
    evidence = 0.5 * float(gain[at]) - 0.5 * parameters * np.log(max((blocks.weight > 0).sum() * 2, 2))
    begin = at if candidate.step else None
    end = None if begin is None else len(blocks.residual) if candidate.lasting else int(last[at])
    return MarkerEffect(candidate.effect, candidate.body, candidate.label, begin, end, candidate.columns, float(evidence), float(gain[at]),
                        shifts=candidate.shifts)


def _until(values: Array, last: NDArray[np.int64]) -> Array:
    """Sums (b, ...) from each block to the end of its recording."""
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    return total[last] - total[:-1]


def _lack(residual: Array, blocks: Blocks) -> tuple[float, float]:
    """Chi-square of cell means of the projected residual, in segment frames, over time and over angle: p and excess."""
    from scipy.stats import chi2

    b, m = blocks.weight.shape
    z = np.einsum("bmji,bmj->bmi", blocks.rotation, residual.reshape(b, m, 3)).reshape(b, -1)
    same = blocks.record[1:] == blocks.record[:-1]
    variance = 0.5 * np.mean(np.diff(z, axis=0)[same] ** 2, axis=0)
    time_cell = np.searchsorted(np.linspace(0, b, 25)[1:-1], np.arange(b), side="right")
    worst, excess = 1.0, 0.0
    angles = [_bins(blocks.angle[:, k], 12) for k in range(blocks.angle.shape[1])]
    for cell in (time_cell, *angles):
        statistic, degrees = 0.0, 0
        for c in np.unique(cell):
            mine = z[cell == c]
            statistic += float(np.sum(mine.mean(0) ** 2 * len(mine) / np.maximum(variance, 1e-300)))
            degrees += z.shape[1]
        worst = min(worst, float(chi2.sf(statistic, degrees)) * (1 + len(angles)))
        excess = max(excess, statistic - degrees)
    return worst, excess


def _bins(values: Array, count: int) -> NDArray[np.int64]:
    return np.searchsorted(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]), values)


def corrected_angles(angles: FingerAngles, naming: MarkerNaming) -> FingerAngles:
    """The angles with the named effects' displacement taken out of the markers, chain and poses fitted anew."""
    if not naming.believed:
        return angles
    course = _least_course(naming) if any(e.effect in UNHINGED for e in naming.found) else None
    right = []
    for index, record in enumerate(angles.records):
        shift = shift_at_frames(naming, index, record.mocap.time_s, course)
        world = np.einsum("nij,nmj->nmi", record.pose.rotation, shift)
        right.append(replace(record.data, position_world=record.data.position_world - world))
    return refitted(angles, right)


def _least_course(naming: MarkerNaming) -> Array:
    """Displacement (b, 3m) [m] by all joints that are no hinges, without what another chain of hinges would explain as well: the least
    that leaves hinges. Their tilts are nearly another axis, and what is linear in both would else go far both ways."""
    blocks = naming.blocks
    course = np.zeros(blocks.residual.reshape(len(blocks.residual), -1).shape)
    for effect in (e for e in naming.found if e.effect in UNHINGED):
        course += effect.everywhere @ effect.coefficients
    chain, _ = _solve(project(blocks, blocks.chain_columns), project(blocks, course[..., None]))
    return course - blocks.chain_columns @ chain


def shift_at_frames(naming: MarkerNaming, record: int, time_s: Array, course: Array | None = None) -> Array:
    """Displacement (n, m, 3) [m], palm frame, of all named effects at the frames of one record. course: (b, 3m) [m] in the place of those
    of joints that are no hinges."""
    blocks = naming.blocks
    mine = np.flatnonzero(blocks.record == record)
    out = np.zeros((len(time_s), *blocks.weight.shape[1:], 3))
    if not len(mine):
        return out
    at = np.interp(time_s, blocks.time_s[mine], np.arange(len(mine)))
    low = np.minimum(at.astype(int), max(len(mine) - 2, 0))
    share = (at - low)[:, None]

    def between(blockwise: Array) -> Array:
        return (1 - share) * blockwise[low] + share * blockwise[np.minimum(low + 1, len(mine) - 1)]

    for effect in naming.found:
        if course is None or effect.effect not in UNHINGED:
            now = between(effect.everywhere[mine] @ effect.coefficients)
            out += (now * effect.acts(blocks, record, time_s)[:, None]).reshape(out.shape)
    return out if course is None else out + between(course[mine]).reshape(out.shape)
