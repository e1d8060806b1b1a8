"""The pointing probe: its tip in the frame of the palm markers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import IdentificationError
from ..rotation import kabsch
from ..session import Probe, Session, Trial
from .start import cluster_shape

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ProbedPoint:
    """A point held with the probe tip. position_palm: (3,) [m]. covariance: (3, 3) of its mean. trial: its file."""

    position_palm: Array
    covariance: Array
    trial: str


def tip_path(trial: Trial, session: Session, probe: Probe, palm_shape: Array) -> Array:
    """Tip positions (n, 3) [m] in the frame of palm_shape (3, 3): probe and palm registered per frame (Kabsch).

    Frames in which a palm marker or all but two probe markers are hidden are left out. Raises IdentificationError where
    the probe has no known geometry or no frame remains.
    """
    return tip_and_shaft(trial, session, probe, palm_shape)[0]


def tip_and_shaft(trial: Trial, session: Session, probe: Probe, palm_shape: Array) -> tuple[Array, Array]:
    """As `tip_path`, with the unit directions (n, 3) from the tip to the middle of the probe's markers: away from what
    it touches."""
    if session.palm is None or probe.position_probe is None:
        raise IdentificationError(f'trial "{trial.name}": needs palm markers and a probe whose tip is known')
    mocap = trial.mocap()
    palm, tool = mocap.markers(session.palm.labels), mocap.markers(probe.labels)
    tool = _probe_markers(tool, probe)
    good = np.isfinite(palm).all((1, 2)) & (np.isfinite(tool).all(2).sum(1) >= min(3, len(probe.labels)))
    if not good.any():
        raise IdentificationError(f'trial "{trial.name}": no frame shows the palm and three probe markers together')
    rotation, translation = kabsch(palm_shape, palm[good])
    turned, tip_world = kabsch(probe.position_probe, tool[good])
    shaft = turned @ (np.asarray(probe.position_probe).mean(0))
    shaft /= np.maximum(np.linalg.norm(shaft, axis=1, keepdims=True), 1e-12)
    return np.einsum("nji,nj->ni", rotation, tip_world - translation), np.einsum("nji,nj->ni", rotation, shaft)


def _probe_markers(tool: Array, probe: Probe) -> Array:
    """Probe markers with those off the known shape by far (ghosts, swaps) taken out, frame by frame."""
    if len(probe.labels) < 4:
        return tool
    rotation, translation = kabsch(probe.position_probe, tool)
    miss = np.linalg.norm(
        tool - np.einsum("nij,mj->nmi", rotation, probe.position_probe) - translation[:, None], axis=-1
    )
    limit = 6 * np.nanmedian(miss)
    worst = np.nanargmax(np.where(np.isfinite(miss), miss, -1.0), axis=1)
    bad = np.take_along_axis(miss, worst[:, None], 1)[:, 0] > limit
    out = tool.copy()
    out[np.flatnonzero(bad), worst[bad]] = np.nan
    return out


def probed_point(trial: Trial, session: Session, probe: Probe, palm_shape: Array) -> ProbedPoint:
    """Robust mean of the tip while it is held on a point; blocks of a fifth of the trial give its covariance."""
    tip = tip_path(trial, session, probe, palm_shape)
    distance = np.linalg.norm(tip - np.median(tip, axis=0), axis=1)
    tip = tip[distance <= 4 * np.median(distance) + 1e-12]
    blocks = np.stack([block.mean(0) for block in np.array_split(tip, min(5, len(tip)))])
    white = np.cov(tip.T, bias=False) / len(tip) if len(tip) > 1 else np.zeros((3, 3))
    slow = np.cov(blocks.T) / len(blocks) if len(blocks) > 1 else np.zeros((3, 3))
    larger = white if np.trace(white) > np.trace(slow) else slow
    return ProbedPoint(tip.mean(0), larger, trial.name)


def calibrated_probe(session: Session) -> Probe | None:
    """The session's probe; where its tip is not known, found from its `pivot` trials.

    The tip stays put while the tool swings: R_f p + t_f = const, solved by robust least squares over all frames, in the
    room and, where the palm is seen, relative to it (the tip may stand on the hand): the smaller residual tells which.
    Raises IdentificationError where no pivot trial exists or the tool swings too little.
    """
    probe = session.probe
    if probe is None or probe.position_probe is not None:
        return probe
    trials = session.select("pivot")
    if not trials:
        raise IdentificationError(
            f'{session.path}: the probe has no marker positions and there is no trial of kind "pivot"'
        )
    tracks = [trial.mocap().markers(probe.labels) for trial in trials]
    shape = cluster_shape(np.concatenate(tracks))
    tracks = [_probe_markers(track, Probe(probe.labels, shape)) for track in tracks]
    found = [_pivot(shape, tracks, trials[0].name)]
    if session.palm is not None and all(set(session.palm.labels) <= set(trial.mocap().labels) for trial in trials):
        palms = [trial.mocap().markers(session.palm.labels) for trial in trials]
        palm = cluster_shape(np.concatenate(palms))
        poses = [kabsch(palm, track) for track in palms]
        hidden = [~np.isfinite(track).all((1, 2)) for track in palms]
        still = [np.einsum("nji,nmj->nmi", r, track - t[:, None]) for (r, t), track in zip(poses, tracks, strict=True)]
        for track, gap in zip(still, hidden, strict=True):
            track[gap] = np.nan
        found.append(_pivot(shape, still, trials[0].name))
    tip, _ = min(found, key=lambda f: f[1])
    return Probe(probe.labels, shape - tip)


def _pivot(shape: Array, tracks: list[Array], name: str) -> tuple[Array, float]:
    """Tip (3,) [m] in the frame of shape, and the typical miss [m] of a frame; tracks: (n, m, 3) [m] of each trial."""
    rows, right = [], []
    for i, track in enumerate(tracks):
        good = np.isfinite(track).all(2).sum(1) >= min(4, len(shape))
        if not good.any():
            continue
        rotation, translation = kabsch(shape, track[good])
        hole = np.zeros((len(rotation), 3, 3 * len(tracks)))
        hole[:, :, 3 * i : 3 * i + 3] = -np.eye(3)
        rows.append(np.concatenate([rotation, hole], axis=2))
        right.append(-translation)
    if not rows:
        raise IdentificationError(f'trial "{name}": no frame shows the whole probe')
    design, target = np.concatenate(rows), np.concatenate(right)
    weight = np.ones(len(design))
    for _ in range(20):  # Cauchy weights, frame by frame
        root = np.sqrt(weight)[:, None]
        solution, _, _, singular = np.linalg.lstsq(
            (root[..., None] * design).reshape(-1, design.shape[2]), (root * target).reshape(-1), rcond=None
        )
        miss = np.linalg.norm(design @ solution - target, axis=1)
        weight = 1 / (1 + (miss / (2.4 * np.median(miss) + 1e-12)) ** 2)
    if singular[-1] < 0.03 * np.sqrt(weight.sum()):
        raise IdentificationError(f'trial "{name}": the probe swings too little to find its tip; 40 deg or more')
    return solution[:3], float(np.median(miss))
