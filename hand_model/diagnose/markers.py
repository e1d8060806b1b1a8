"""Marker station: markers against rigid segments on hinges; slips, supports that turn, hinges that are none.

Linear in everything small about the identified chain: per frame the palm pose and joint angles, shared the chain, and the
columns of a candidate. Frames are eliminated one by one (orthogonal projection), the chain by its Gram matrix, so that a
candidate's gain is what neither a pose nor another chain can explain; a step's moment is scanned by cumulative sums.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ..identify.chain import Chain, jacobians, propagate
from ..identify.likelihood import OUTLIER_LIMIT
from .angles import FARTHEST_M, FingerAngles, refitted

Array = NDArray[np.float64]

BLOCK = 8  # frames averaged into one row block
LOUD_BLOCKS, LOUD = 5, 0.6  # blocks over which the noise is read, and the share of the usual variance from which it is louder
EVIDENCE_LEAST = 15.0  # log evidence of a marker effect, beyond its parameters and the search over moments
MOST = 4
LASTING_S = 2.0  # half of it is how long something must last that is no ghost
SKIP_P = 0.3  # lack of fit above which no candidate is tried
BOTH = (True, False)
ALPHA = 0.003  # false alarms per finger
EXPLAINED_LEAST = 0.7  # of the misfit: below, the names are not believed
SPELL = 12  # blocks, about a second, whose mean shows what stays correlated
HINGE = ("joint_wobble", "moving_centre")
MOSTLY = 0.7  # share of what any motion in step with the angle explains
NO_HINGE = "no plain hinge"  # a joint whose markers leave the hinge in step with its angle, by none of the known ways


@dataclass(frozen=True)
class Blocks:
    """Block means of all flexion recordings of one finger, in order of time.

    residual: (b, m, 3) [m] observed minus chain, palm frame. weight: (b, m) frames behind a mean. pose_columns: (b, 3m, 6+k)
    orthonormal basis of what poses explain. chain_columns: (b, 3m, s). rotation: (b, m, 3, 3) body to palm. position: (b, m, 3).
    angle: (b, k). record, time_s: (b,). labels, body: of the markers.
    """

    residual: Array
    weight: Array
    pose_basis: Array
    chain_columns: Array
    rotation: Array
    position: Array
    axes: Array
    centres: Array
    angle: Array
    record: NDArray[np.int64]
    time_s: Array
    labels: tuple[str, ...]
    body: NDArray[np.int64]


@dataclass(frozen=True)
class MarkerEffect:
    """A candidate that was chosen. everywhere: (b, 3m, c) unprojected, as if it acted always. begin, end: first block of a
    step and the one after its last, None where it acts always."""

    effect: str
    body: int
    label: str | None
    begin: int | None
    end: int | None
    everywhere: Array
    evidence: float
    gain: float
    coefficients: Array = field(default_factory=lambda: np.zeros(0))

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


def blocks_of(angles: FingerAngles) -> Blocks:
    """Residuals, Jacobians and projections in blocks of frames."""
    labels, body = angles.records[0].data.labels, angles.records[0].data.body
    chain = angles.chain
    parts: list[tuple[Array, ...]] = []
    for index, record in enumerate(angles.records):
        observed = record.data.position_world
        residual = record.pose.to_palm(observed) - propagate(chain, body, record.pose.angle_rad)[0]
        size = np.linalg.norm(residual, axis=-1)
        sound = np.isfinite(record.angle_rad).all(1)
        far = ~(size < FARTHEST_M) | _passing(size > OUTLIER_LIMIT * angles.noise_m, record.mocap.time_s)
        good = np.flatnonzero(sound | (~far.any(1) & ~_passing(~sound, record.mocap.time_s)))
        count = len(good) // BLOCK
        if count < 20:
            continue
        frames = good[: count * BLOCK].reshape(count, BLOCK)
        frames = frames[(frames[:, -1] - frames[:, 0]) < 3 * BLOCK]
        residual[far] = np.nan
        residual = residual[frames.ravel()]
        residual = residual.reshape(len(frames), BLOCK, len(labels), 3)
        weight = np.isfinite(residual[..., 0]).sum(1).astype(float)
        mean = np.nansum(residual, axis=1) / np.maximum(weight, 1)[..., None]
        weight *= _calm(residual - mean[:, None])[:, None]
        angle = record.pose.angle_rad[frames].mean(1)
        parts.append((mean, weight, angle, np.full(len(frames), index), record.mocap.time_s[frames].mean(1)))
    residual, weight, angle, record_index, time_s = (np.concatenate(p) for p in zip(*parts, strict=True))
    return _assembled(chain, body, labels, residual, weight, angle, record_index, time_s)


def _calm(scatter: Array) -> Array:
    """Usual over present variance of the readings (b,) within blocks, at most one: what is seen while the cameras are disturbed
    counts for less. scatter: (b, frames, m, 3) [m], nan where nothing is seen."""
    variance = uniform_filter1d(np.nan_to_num(np.nanmean(scatter**2, axis=(1, 2, 3))), LOUD_BLOCKS, mode="nearest")
    share = np.median(variance) / np.maximum(variance, 1e-30)
    return np.where(share < LOUD, share, 1.0)


def _passing(flag: NDArray[np.bool_], time_s: Array) -> NDArray[np.bool_]:
    """Where a flag (n,) or (n, m) is up for a moment only: a ghost passes, a slip lasts."""
    width = max(int(LASTING_S / float(np.median(np.diff(time_s)))), 1)
    up = uniform_filter1d(flag.astype(float), width, axis=0, mode="nearest")
    return flag & (up < 0.45)


def _assembled(chain: Chain, body: NDArray[np.int64], labels: tuple[str, ...], residual: Array, weight: Array, angle: Array,
               record: Array, time_s: Array) -> Blocks:
    x, by_frame, by_marker, by_joint = jacobians(chain, body, angle)
    _, _, joints = propagate(chain, body, angle)
    b, m = weight.shape
    root = np.sqrt(np.repeat(weight / BLOCK, 3, axis=1))[..., None]
    basis, _ = np.linalg.qr(by_frame.reshape(b, 3 * m, -1) * root)
    shared = np.zeros((b, m, 3, 3 * m))
    for j in range(m):
        shared[:, j, :, 3 * j : 3 * j + 3] = by_marker[:, j]
    columns = np.concatenate([shared.reshape(b, 3 * m, -1), by_joint.reshape(b, 3 * m, -1)], axis=-1)
    return Blocks(residual, weight, basis, columns, by_marker, x, np.stack([a for a, _ in joints], 1),
                  np.stack([c for _, c in joints], 1), angle, record.astype(int), time_s, labels, body)


def project(blocks: Blocks, columns: Array) -> Array:
    """Columns (b, 3m, c), weighted, minus what each block's pose explains."""
    root = np.sqrt(np.repeat(blocks.weight / BLOCK, 3, axis=1))[..., None]
    c = columns * root
    return c - blocks.pose_basis @ (np.swapaxes(blocks.pose_basis, 1, 2) @ c)


def name_markers(angles: FingerAngles) -> MarkerNaming:
    """Name slips and hinges that are none in the flexion recordings of one finger, by forward selection."""
    blocks = blocks_of(angles)
    y = project(blocks, blocks.residual.reshape(len(blocks.residual), -1, 1))
    shared = project(blocks, blocks.chain_columns)
    sigma = _noise(y, blocks)
    candidates: list[_Candidate] | None = None
    found: list[MarkerEffect] = []
    p_before = excess_before = refused = None
    for _ in range(MOST + 1):
        coefficients, residual = _solve(shared, y)
        p, excess = _lack(residual, blocks)
        if p_before is None:
            p_before, excess_before = p, excess
        if len(found) == MOST or (not found and p > SKIP_P):
            break
        if candidates is None:
            candidates = _candidates(blocks)
            moments = {id(c.columns): _moments(project(blocks, c.columns), shared, y) for c in candidates}
        known = {e.body for e in found if e.effect in HINGE}
        chain = _chain_part(shared, y)
        best = _choose([_try(c, blocks, moments[id(c.columns)], chain, sigma) for c in candidates
                        if c.effect != NO_HINGE or c.body not in known])
        more = project(blocks, best.columns)
        wider = np.concatenate([shared, more], axis=-1)
        # What stays correlated beside the best candidate weighs all of them down.
        best = replace(best, evidence=best.evidence - 0.5 * best.gain * (1 - 1 / _inflation(_solve(wider, y)[1], blocks)))
        if best.evidence < EVIDENCE_LEAST:
            refused = best
            break
        found.append(best)
        shared = wider
        moments = {key: value.with_shared(more) for key, value in moments.items()}
    start = blocks.chain_columns.shape[-1]
    done = []
    for effect in found:
        width = effect.everywhere.shape[-1]
        done.append(replace(effect, coefficients=coefficients[start : start + width]))
        start += width
    return MarkerNaming(blocks, tuple(done), sigma, 1.0 if p_before is None else p_before, p, excess_before or 0.0, excess, refused)


def _choose(tried: list[MarkerEffect]) -> MarkerEffect:
    """The likeliest. Any motion in step with the angle is what no known form explains: where one takes most of it, it is that
    one, seen to first order."""
    best = max(tried, key=lambda e: e.evidence)
    if best.effect != NO_HINGE:
        return best
    named = max((e for e in tried if e.effect in HINGE and e.body == best.body), key=lambda e: e.evidence)
    return named if named.gain > MOSTLY * best.gain else best


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
class _Candidate:
    effect: str
    body: int
    label: str | None
    columns: Array
    step: bool
    lasting: bool = True  # a step that lasts for the session, or until the end of the recording (it was put right after)


def _candidates(blocks: Blocks) -> list[_Candidate]:
    b, m = blocks.weight.shape
    out = []
    for j, label in enumerate(blocks.labels):
        name = "palm_marker_slip" if blocks.body[j] == 0 else "marker_slip"
        for frame in _frames(blocks, int(blocks.body[j]), j):
            columns = np.zeros((b, m, 3, 3))
            columns[:, j] = frame
            flat = columns.reshape(b, 3 * m, 3)
            out += [_Candidate(name, int(blocks.body[j]), label, flat, True, lasting) for lasting in BOTH]
    for k in range(1, int(blocks.body.max()) + 1):
        mine = np.flatnonzero(blocks.body == k)
        arm = blocks.position[:, mine] - blocks.position[:, mine].mean(1, keepdims=True)
        for frame in _frames(blocks, k, int(mine[0])):
            turned = np.stack([np.cross(frame[:, None, :, i], arm) for i in range(3)], axis=-1)
            columns = np.zeros((b, m, 3, 6))
            columns[:, mine, :, :3] = frame[:, None]
            columns[:, mine, :, 3:] = turned
            flat = columns.reshape(b, 3 * m, 6)
            out += [_Candidate("support_slip", k, None, flat, True, lasting) for lasting in BOTH]
        out += [*_no_hinge(blocks, k), *_any_motion(blocks, k)]
    return out


def _frames(blocks: Blocks, body: int, marker: int) -> list[Array]:
    """Frames (b, 3, 3) in which a slip may be constant: its segment's, or the palm's (a marker held back by a cable)."""
    b = len(blocks.residual)
    fixed = np.broadcast_to(np.eye(3), (b, 3, 3))
    return [fixed] if body == 0 else [blocks.rotation[:, marker], fixed]


def _no_hinge(blocks: Blocks, k: int) -> list[_Candidate]:
    """Wobble and moving centre of joint k - 1, each with a few forms over its angle."""
    b, m = blocks.weight.shape
    low, high = np.quantile(blocks.angle[:, k - 1], [0.005, 0.995])
    u = ((blocks.angle[:, k - 1] - low) / max(high - low, 1e-9))[:, None]
    wave = [np.sin(2 * np.pi * u), np.cos(2 * np.pi * u)]
    forms: list[list[Array]] = [[u**2], [u**2, u**3], wave, [u**2, u**3, *wave]]
    moved = np.flatnonzero(blocks.body >= k)
    axis, centre = blocks.axes[:, k - 1], blocks.centres[:, k - 1]
    helper = np.eye(3)[np.argmin(np.abs(axis.mean(0)))]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axis, first)
    out = []
    for form in forms:
        for name in ("joint_wobble", "moving_centre"):
            functions = form if name == "joint_wobble" or form is wave else [u, *form[: len(form)]]
            columns = np.zeros((b, m, 3, 2 * len(functions)))
            one = np.zeros((b, len(moved), 3, 2 * len(functions)))
            for i, f in enumerate(functions):
                for d, direction in enumerate((first, second)):
                    if name == "joint_wobble":
                        arm = blocks.position[:, moved] - centre[:, None]
                        shift = np.cross(direction[:, None], arm) * f[:, None]
                    else:
                        shift = np.broadcast_to((direction * f)[:, None], (b, len(moved), 3))
                    one[..., 2 * i + d] = shift
            columns[:, moved] = one
            out.append(_Candidate(name, k, None, columns.reshape(b, 3 * m, -1), False))
    return out


def _any_motion(blocks: Blocks, k: int) -> list[_Candidate]:
    """Whatever a smooth function of joint k - 1's angle could be: any motion of what it carries as a rigid body, or of each
    marker of its segment (skin, a loose support)."""
    b, m = blocks.weight.shape
    low, high = np.quantile(blocks.angle[:, k - 1], [0.005, 0.995])
    u = (blocks.angle[:, k - 1] - low) / max(high - low, 1e-9)
    forms = [u, u**2, u**3, np.sin(2 * np.pi * u), np.cos(2 * np.pi * u)]
    moved, mine = np.flatnonzero(blocks.body >= k), np.flatnonzero(blocks.body == k)
    rigid = np.zeros((b, m, 3, 6))
    rigid[:, moved, :, :3] = np.eye(3)
    arm = blocks.position[:, moved] - blocks.centres[:, k - 1][:, None]
    rigid[:, moved, :, 3:] = np.stack([np.cross(np.eye(3)[i], arm) for i in range(3)], axis=-1)
    own = np.zeros((b, m, 3, 3 * len(mine)))
    for i, j in enumerate(mine):
        own[:, j, :, 3 * i : 3 * i + 3] = blocks.rotation[:, j]
    out = []
    for basis in (rigid, own):
        flat = basis.reshape(b, 3 * m, -1)
        columns = np.concatenate([flat * f[:, None, None] for f in forms], axis=-1)
        out.append(_Candidate(NO_HINGE, k, None, columns, False))
    return out


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


def _try(candidate: _Candidate, blocks: Blocks, moments: _Moments, chain: tuple[Array, Array], sigma: float) -> MarkerEffect:
    """Gain of a candidate beyond poses and chain; a step at its best moment."""
    dd, sd, dy = moments.dd, moments.sd, moments.dy
    inverse, sy = chain
    width = dd.shape[-1]
    total = np.trace(dd.sum(0)) / width
    last = np.array([np.flatnonzero(blocks.record == r)[-1] + 1 for r in blocks.record])
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
    return MarkerEffect(candidate.effect, candidate.body, candidate.label, begin, end, candidate.columns, float(evidence), float(gain[at]))


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
    right = []
    for index, record in enumerate(angles.records):
        shift = _at_frames(naming, index, record.mocap.time_s)
        world = np.einsum("nij,nmj->nmi", record.pose.rotation, shift)
        right.append(replace(record.data, position_world=record.data.position_world - world))
    return refitted(angles, right)


def _at_frames(naming: MarkerNaming, record: int, time_s: Array) -> Array:
    """Displacement (n, m, 3) [m], palm frame, of all named effects at the frames of one record."""
    blocks = naming.blocks
    mine = np.flatnonzero(blocks.record == record)
    out = np.zeros((len(time_s), *blocks.weight.shape[1:], 3))
    if not len(mine):
        return out
    at = np.interp(time_s, blocks.time_s[mine], np.arange(len(mine)))
    low = np.minimum(at.astype(int), max(len(mine) - 2, 0))
    share = (at - low)[:, None]
    for effect in naming.found:
        course = (effect.everywhere[mine] @ effect.coefficients)
        now = (1 - share) * course[low] + share * course[np.minimum(low + 1, len(mine) - 1)]
        out += (now * effect.acts(blocks, record, time_s)[:, None]).reshape(out.shape)
    return out
