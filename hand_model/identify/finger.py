"""One finger from its flexion trials: chain, poses, clocks; still in the frame of the palm markers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import IdentificationError
from ..session import Finger, Log, Mocap, Session, Trial
from .bootstrap import variance_inflation
from .chain import Chain, ChainData, Pose, marker_body
from .clock import Clock, align
from .hinge import block_inflation
from .likelihood import START_FRAMES, ChainFit, angle_noise_ratio, fit_chain, robust_cost
from .repair import Slip, Swap, find_slip, level_last_joint, repair_labels, split_marker
from .start import other_starts, start_chain

Array = NDArray[np.float64]

# The format promises this much rest, hand open, at the start of a flexion trial [s].
REST_S = 1.0
# More slips than this in one finger are no slips but a chain that does not fit.
MOST_SLIPS = 6
# Residuals of a marker that sits on its segment are noise, alike for all; this many times larger and it does not.
LOOSE = 1.4
# Noise of a joint angle over the spread of that angle from which on a single start and a linearised covariance are not
# enough.
SHORT_ARC = 0.12
# Doubt added to an axis whose search did not settle [rad].
UNSETTLED_RAD = 0.1


@dataclass(frozen=True)
class FlexionRecord:
    """One flexion trial as the chain sees it. frames: slice into the finger's frames. clock, log: None without a
    log."""

    trial: Trial
    mocap: Mocap
    frames: slice
    log: Log | None
    clock: Clock | None
    swaps: tuple[Swap, ...]


@dataclass(frozen=True)
class FingerFit:
    """Everything learned of one finger, in the frame of the palm markers.

    fit: chain and poses over all frames, angles zero at rest. covariance: (3 m + 6 k,) squared: markers, then per joint
    axis and centre. rest: frames that define zero. slips: markers that moved on their segment.
    """

    finger: Finger
    records: tuple[FlexionRecord, ...]
    fit: ChainFit
    covariance: Array
    rest: NDArray[np.int64]
    slips: tuple[Slip, ...]

    @property
    def good(self) -> NDArray[np.bool_]:
        """(n,) frames whose angles rest on the palm and at least two markers of every segment."""
        return sound_frames(self.fit.data, self.fit.weight)

    def joint_covariance(self, joint: int) -> Array:
        """(6, 6) covariance of one joint's axis [-] and centre [m]."""
        start = 3 * len(self.fit.data.body) + 6 * joint
        return self.covariance[start : start + 6, start : start + 6]


def axis_sd_deg(covariance: Array) -> float:
    """Standard deviation [deg] of an axis in its worst direction, from the covariance (6, 6) of axis and centre."""
    return float(np.rad2deg(np.sqrt(max(np.linalg.eigvalsh(covariance[:3, :3])[-1], 0.0))))


def sound_frames(data: ChainData, weight: Array) -> NDArray[np.bool_]:
    """(n,) frames in which three palm markers and two of every segment carry (almost) full weight."""
    full = weight > 0.5
    good = full[:, data.body == 0].sum(1) >= 3
    for k in range(1, data.n_joints + 1):
        good &= full[:, data.body == k].sum(1) >= 2
    return good


def observations(session: Session, finger: Finger, mocap: Mocap) -> tuple[ChainData, tuple[Swap, ...]]:
    """Marker observations of a finger in one recording, exchanged labels put right.

    Raises SessionError for a missing label, IdentificationError for a marker that is never seen or a cluster on one
    line.
    """
    if session.palm is None:
        raise IdentificationError(f"{session.path}: the session has no palm markers")
    labels = session.palm.labels + finger.labels
    data = ChainData(mocap.markers(labels), marker_body(finger), labels)
    for j, label in enumerate(labels):
        if not np.isfinite(data.position_world[:, j, 0]).any():
            raise IdentificationError(f'{mocap.path}: marker "{label}" is never seen')
    return repair_labels(data)


def identify_finger(session: Session, finger: Finger, palm_shape: Array) -> FingerFit:
    """Chain of one finger from its flexion trials that are not kept for validation.

    palm_shape: (3, 3) [m] origin, medial, lateral in the frame of the palm markers. Raises IdentificationError where
    there is no such trial or it does not hold what the chain needs.
    """
    trials = session.select("flexion", finger.name, validate=False)
    if not trials:
        raise IdentificationError(
            f'{session.path}: finger "{finger.name}" has no flexion trial that is not kept for validation'
        )
    try:
        mocaps = [trial.mocap() for trial in trials]
        parts = [observations(session, finger, mocap) for mocap in mocaps]
        lengths = np.cumsum([0] + [len(mocap.time_s) for mocap in mocaps])
        data = ChainData(np.concatenate([p.position_world for p, _ in parts]), parts[0][0].body, parts[0][0].labels)
        rest = np.concatenate(
            [start + np.flatnonzero(m.time_s < REST_S) for start, m in zip(lengths, mocaps, strict=False)]
        )
        fit, slips = _fit_with_slips(_best_fit(data, rest, palm_shape))
    except IdentificationError as error:
        raise IdentificationError(f'{trials[0].name}: finger "{finger.name}": {error}') from None
    fit, covariance = _zero_at_rest(level_last_joint(fit), rest)
    covariance = _honest(covariance, fit) * block_inflation(fit)
    records = tuple(
        _record(trial, mocap, slice(int(a), int(b)), swaps, fit)
        for trial, mocap, a, b, (_, swaps) in zip(trials, mocaps, lengths[:-1], lengths[1:], parts, strict=True)
    )
    return FingerFit(finger, records, fit, covariance, rest, slips)


def _best_fit(data: ChainData, rest: NDArray[np.int64], palm_shape: Array) -> ChainFit:
    """The chain from the usual start; where arcs are short, the best of several starts."""
    first = start_chain(data, rest, palm_shape)
    fit = fit_chain(data, first)
    if fit.converged and (angle_noise_ratio(fit) < SHORT_ARC).all():
        return fit
    few = data.thinned(START_FRAMES)
    tried = [fit_chain(few, start) for start in (fit.chain, *other_starts(data, rest, palm_shape, first))]
    costs = [robust_cost(t.residual_palm, fit.noise_m) for t in tried]
    best = int(np.argmin(costs))
    if costs[best] > costs[0] - 3:  # no likelier by what three unknowns' worth of noise could make it
        return fit
    return fit_chain(data, tried[best].chain)


def _fit_with_slips(fit: ChainFit) -> tuple[ChainFit, tuple[Slip, ...]]:
    """The fit with every marker that slips in two, and the slips; none is sought where the chain settles neither with
    it nor without: what moves there moves all the time."""
    slips: list[Slip] = []
    while len(slips) < MOST_SLIPS:
        slip = find_slip(fit)
        if slip is None:
            break
        j = max(i for i, label in enumerate(fit.data.labels) if label == slip.label)
        split = split_marker(fit.data, slip)
        marker = np.insert(fit.chain.marker_palm, j + 1, fit.chain.marker_palm[j] + slip.shift_palm, axis=0)
        apart = _without_loose(fit_chain(split, Chain(marker, fit.chain.axis_palm, fit.chain.centre_palm)), (j, j + 1))
        if not (fit.converged or apart.converged):
            break
        fit = apart
        slips.append(slip)
    return fit, tuple(slips)


def _without_loose(fit: ChainFit, columns: tuple[int, int]) -> ChainFit:
    """The fit without that epoch of a slipped marker which does not sit on its segment: its residuals stand out from
    the rest, those aside that were left out so before."""
    square = np.sum(fit.residual_palm**2, axis=-1)
    seen, size = np.isfinite(square).any(axis=0), np.zeros(square.shape[1])
    size[seen] = np.sqrt(np.nanmedian(square[:, seen], axis=0))
    others = np.median(size[seen & ~np.isin(np.arange(len(size)), columns)])
    worst = max(columns, key=lambda j: size[j])
    if size[worst] < LOOSE * others:
        return fit
    y = fit.data.position_world.copy()
    y[:, worst] = np.nan
    return fit_chain(replace(fit.data, position_world=y), fit.chain)


def _zero_at_rest(fit: ChainFit, rest: NDArray[np.int64]) -> tuple[ChainFit, Array]:
    """The same fit with every joint at zero at rest and flexing positively; covariance (3 m + 6 k) of markers, axes,
    centres."""
    good = sound_frames(fit.data, fit.weight)
    still = rest[good[rest]] if good[rest].any() else np.flatnonzero(good)[:1]
    angle = fit.pose.angle_rad
    zero = np.median(angle[still], axis=0)
    zero_sd = np.sqrt(np.mean(fit.angle_sd_rad[still] ** 2, axis=0) / len(still))
    sign = np.where(np.mean(angle[good] - zero, axis=0) < 0, -1.0, 1.0)

    def at_rest(chain: Chain, rest_rad: Array) -> Chain:
        moved = chain.at(rest_rad, fit.data.body)
        return replace(moved, axis_palm=moved.axis_palm * sign[:, None])

    def outcome(step: Array) -> Array:
        moved = at_rest(fit.chain.moved(step[: fit.chain.size]), zero + step[fit.chain.size :])
        return np.concatenate([moved.marker_palm.ravel(), np.hstack([moved.axis_palm, moved.centre_palm]).ravel()])

    unknowns = fit.chain.size + len(zero)
    derivative = np.stack([(outcome(e) - outcome(-e)) / 2e-6 for e in 1e-6 * np.eye(unknowns)], axis=1)
    prior = np.zeros((unknowns, unknowns))
    prior[: fit.chain.size, : fit.chain.size] = fit.covariance
    prior[fit.chain.size :, fit.chain.size :] = np.diag(zero_sd**2)
    pose = Pose(fit.pose.rotation, fit.pose.translation, (angle - zero) * sign)
    return replace(fit, chain=at_rest(fit.chain, zero), pose=pose), derivative @ prior @ derivative.T


def _honest(covariance: Array, fit: ChainFit) -> Array:
    """Covariance with each joint's rows and columns scaled up by what a bootstrap shows, and beyond SHORT_ARC by the
    square of noise over arc [rad]: there the estimate can be anywhere within that."""
    factor, ratio = variance_inflation(fit), angle_noise_ratio(fit)
    scale = np.ones(len(covariance))
    for k in range(len(factor)):
        rows = slice(len(scale) - 6 * (len(factor) - k), len(scale) - 6 * (len(factor) - k) + 6)
        variance = max(np.trace(covariance[rows, rows][:3, :3]), 1e-18)
        doubt = ratio[k] ** 4 if ratio[k] > SHORT_ARC else 0.0
        doubt += 0.0 if fit.converged else UNSETTLED_RAD**2
        scale[rows] = np.sqrt(factor[k] + doubt / variance)
    return covariance * scale[:, None] * scale


def _record(trial: Trial, mocap: Mocap, frames: slice, swaps: tuple[Swap, ...], fit: ChainFit) -> FlexionRecord:
    if trial.log_path is None:
        return FlexionRecord(trial, mocap, frames, None, None, swaps)
    log = trial.log()
    good = sound_frames(fit.data, fit.weight)[frames]
    angle = np.where(good, fit.pose.angle_rad[frames, 0], np.nan)
    return FlexionRecord(
        trial, mocap, frames, log, align(mocap.time_s, angle, log.time_s, log.column("position"), trial.name), swaps
    )
