"""Marker station: markers against rigid segments on hinges; slips, supports that turn, hinges that are none.

Linear in everything small about the identified chain: per frame the palm pose and joint angles, shared the chain, and the
columns of a candidate. Frames are eliminated one by one (orthogonal projection), the chain by its Gram matrix, so that a
candidate's gain is what neither a pose nor another chain can explain; a step's moment is scanned by cumulative sums.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..identify.chain import Chain, jacobians, propagate
from .angles import FingerAngles

Array = NDArray[np.float64]

BLOCK = 8  # frames averaged into one row block
FARTHEST_M = 6e-3  # a residual beyond is a ghost or a wrong label, no slip
EVIDENCE_LEAST = 15.0  # log evidence of a marker effect, beyond its parameters and the search over moments
MOST = 4
SKIP_P = 0.3  # lack of fit above which no candidate is tried
BOTH = (True, False)


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
    """A candidate that was chosen. columns: (b, 3m, c) unprojected. begin: first block of a step, None where it acts always."""

    effect: str
    body: int
    label: str | None
    begin: int | None
    columns: Array
    evidence: float
    gain: float
    coefficients: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class MarkerNaming:
    """Outcome of the marker station. sigma_m: noise of one coordinate of a block mean. p_before, p_after: lack of fit."""

    blocks: Blocks
    found: tuple[MarkerEffect, ...]
    sigma_m: float
    p_before: float
    p_after: float
    excess_before: float
    excess_after: float


def blocks_of(angles: FingerAngles) -> Blocks:
    """Residuals, Jacobians and projections in blocks of frames."""
    labels, body = angles.records[0].data.labels, angles.records[0].data.body
    chain = angles.chain
    parts: list[tuple[Array, ...]] = []
    for index, record in enumerate(angles.records):
        observed = record.data.position_world
        good = np.flatnonzero(np.isfinite(record.angle_rad).all(1))
        count = len(good) // BLOCK
        if count < 20:
            continue
        frames = good[: count * BLOCK].reshape(count, BLOCK)
        frames = frames[(frames[:, -1] - frames[:, 0]) < 3 * BLOCK]
        flat = frames.ravel()
        residual = record.pose.take(flat).to_palm(observed[flat]) - propagate(chain, body, record.pose.angle_rad[flat])[0]
        far = ~(np.linalg.norm(residual, axis=-1) < FARTHEST_M)
        residual[far] = np.nan
        residual = residual.reshape(len(frames), BLOCK, len(labels), 3)
        weight = np.isfinite(residual[..., 0]).sum(1).astype(float)
        mean = np.nansum(residual, axis=1) / np.maximum(weight, 1)[..., None]
        angle = record.pose.angle_rad[frames].mean(1)
        parts.append((mean, weight, angle, np.full(len(frames), index), record.mocap.time_s[frames].mean(1)))
    residual, weight, angle, record_index, time_s = (np.concatenate(p) for p in zip(*parts, strict=True))
    return _assembled(chain, body, labels, residual, weight, angle, record_index, time_s)


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
    p_before = excess_before = None
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
        best = max((_try(c, blocks, moments[id(c.columns)], _chain_part(shared, y), sigma) for c in candidates),
                   key=lambda e: e.evidence)
        if best.evidence < EVIDENCE_LEAST:
            break
        found.append(best)
        more = project(blocks, best.columns)
        shared = np.concatenate([shared, more], axis=-1)
        moments = {key: value.with_shared(more) for key, value in moments.items()}
    start = blocks.chain_columns.shape[-1]
    done = []
    for effect in found:
        width = effect.columns.shape[-1]
        done.append(MarkerEffect(effect.effect, effect.body, effect.label, effect.begin, effect.columns, effect.evidence,
                                 effect.gain, coefficients[start : start + width]))
        start += width
    return MarkerNaming(blocks, tuple(done), sigma, p_before or 0.0, p, excess_before or 0.0, excess)


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
        out += _no_hinge(blocks, k)
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
    forms: list[list[Array]] = [[u**2], [u**2, u**3], wave]
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
    columns = candidate.columns
    if candidate.step:
        stop = len(columns) if candidate.lasting else last[at]
        index = np.arange(len(columns))
        columns = columns * ((index >= at) & (index < stop))[:, None, None]
    return MarkerEffect(candidate.effect, candidate.body, candidate.label, at if candidate.step else None, columns,
                        float(evidence), float(gain[at]))


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
    """The angles with the named effects' displacement taken out of the markers, by one linear step per frame."""
    if not naming.found:
        return angles
    from dataclasses import replace

    body = angles.records[0].data.body
    chain = angles.chain
    records = []
    for index, record in enumerate(angles.records):
        observed = record.data.position_world
        _, by_frame, _, _ = jacobians(chain, body, record.pose.angle_rad)
        residual = record.pose.to_palm(observed) - propagate(chain, body, record.pose.angle_rad)[0]
        shift = _at_frames(naming, index, record.mocap.time_s, body)
        r = residual - shift
        w = (np.isfinite(r[..., 0]) & (np.linalg.norm(np.nan_to_num(r), axis=-1) < FARTHEST_M)).astype(float)
        a = by_frame.reshape(len(r), -1, by_frame.shape[-1]) * np.repeat(w, 3, axis=1)[..., None]
        gram = np.swapaxes(a, 1, 2) @ a + 1e-12 * np.eye(a.shape[-1])
        right = np.swapaxes(a, 1, 2) @ np.nan_to_num(r).reshape(len(r), -1, 1)
        step = np.linalg.solve(gram, right)[..., 0]
        records.append(replace(record, angle_rad=np.where(np.isfinite(record.angle_rad), record.pose.angle_rad + step[:, 6:], np.nan)))
    return replace(angles, records=tuple(records))


def _at_frames(naming: MarkerNaming, record: int, time_s: Array, body: NDArray[np.int64]) -> Array:
    """Displacement (n, m, 3) [m] of all named effects at the frames of one record, interpolated between blocks."""
    blocks = naming.blocks
    mine = np.flatnonzero(blocks.record == record)
    out = np.zeros((len(time_s), len(body), 3))
    if not len(mine):
        return out
    nearest = mine[np.clip(np.searchsorted(blocks.time_s[mine], time_s), 0, len(mine) - 1)]
    for effect in naming.found:
        out += (effect.columns[nearest] @ effect.coefficients).reshape(len(time_s), -1, 3)
    return out
