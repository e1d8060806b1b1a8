"""A finger's joints as its markers show them: angle, axis and centre along a flexion recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation, Slerp

from hand_model.rotation import kabsch
from hand_model.session import Finger, Session, Trial

from .plant import SPREAD, Array, Seen, smoothed

CURVED = 4  # degree of what an angle is of the drive's place
ROUNDS = 5  # of an axis and of what everything turns from, each as the other says


def watched(session: Session, finger: Finger, trial: Trial) -> Seen:
    """One recording of a finger with two segments of three markers each; its angles as the encoder, much less noisy than
    the markers, foretells them."""
    mocap, log = trial.mocap(), trial.log()
    palm, upper, lower = (
        np.array([mocap.labels.index(label) for label in labels])
        for labels in (session.palm.labels, *(s.markers for s in finger.segments))
    )
    bodies = [_poses(mocap.position_world[:, rows], mocap.time_s) for rows in (palm, upper, lower)]
    turned = [_axis(bodies[i], bodies[i + 1]) for i in range(2)]
    start = mocap.time_s - mocap.time_s[0] < 0.8
    course = smoothed(log.time_s - log.time_s[0], log.columns["position"], SPREAD)
    last_s, time_s = log.time_s[-1] - log.time_s[0], mocap.time_s - mocap.time_s[0]
    late_s, angles = _foretold(course, last_s, time_s, [j[1] for j in turned])
    axes = [bodies[i][0] @ turned[i][0] for i in range(2)]
    centres = [_centre(bodies[i], bodies[i + 1], turned[i][0], angles[i]) for i in range(2)]
    return Seen(
        time_s=time_s,
        log_s=np.clip(time_s - late_s, 0.0, last_s),
        position=mocap.position_world,
        labels=mocap.labels,
        segments=(upper, lower),
        palm=palm,
        angle=tuple(a - float(np.median(a[start])) for a in angles),
        axis=tuple(axes),
        centre=tuple(centres),
        palm_turn=bodies[0][0],
        proximal_turn=bodies[1][0],
        load=np.zeros(len(time_s)),
    )


def _poses(points: Array, time_s: Array) -> tuple[Array, Array]:
    """Turns (n, 3, 3) and places (n, 3) [m] of a body of markers (n, k, 3), between frames in which one is lost as
    nearly as these tell."""
    whole = np.flatnonzero(np.isfinite(points).all((1, 2)))
    shape = points[whole[0]] - points[whole[0]].mean(0)
    turn, place = kabsch(shape, points[whole])
    between = Slerp(time_s[whole], Rotation.from_matrix(turn))
    turned = between(np.clip(time_s, time_s[whole[0]], time_s[whole[-1]])).as_matrix()
    return turned, np.stack([np.interp(time_s, time_s[whole], v) for v in place.T], 1)


def _axis(bearing: tuple[Array, Array], borne: tuple[Array, Array]) -> tuple[Array, Array]:
    """Axis (3,) of a hinge between two bodies in the bearing one, and its angle (n,) [rad] from the first frame. The
    first frame's noise would tilt an axis about which all others turn from there: they turn from what all of them say."""
    relative = Rotation.from_matrix(bearing[0].transpose(0, 2, 1) @ borne[0])
    begin = relative[0]
    for _ in range(ROUNDS):
        vector = (relative * begin.inv()).as_rotvec()
        axis = np.linalg.svd(vector, full_matrices=False)[2][0]
        axis = axis * np.sign(np.sum(vector @ axis))
        angle = vector @ axis
        begin = (Rotation.from_rotvec(axis * angle[:, None]).inv() * relative).mean()
    return axis, angle


def _centre(bearing: tuple[Array, Array], borne: tuple[Array, Array], axis: Array, angle: Array) -> Array:
    """Centre (n, 3) [m] of a hinge in the world, nearest to the bearing body's middle along its axis. How the segment is
    turned is taken from the angle (n,) [rad]: the noise of its markers would draw the centre towards them."""
    turn = Rotation.from_rotvec(axis * angle[:, None]).as_matrix()
    relative = bearing[0].transpose(0, 2, 1) @ borne[0]
    first = Rotation.from_matrix(turn.transpose(0, 2, 1) @ relative).mean().as_matrix()
    apart = np.einsum("nji,nj->ni", bearing[0], borne[1] - bearing[1])
    design: NDArray[np.float64] = np.concatenate([turn @ first, np.broadcast_to(-np.eye(3), turn.shape)], 2)
    point = np.linalg.lstsq(design.reshape(-1, 6), -apart.ravel(), rcond=1e-6)[0]
    return bearing[1] + bearing[0] @ point[3:]


def _foretold(course: BSpline, last_s: float, time_s: Array, angles: Sequence[Array]) -> tuple[float, list[Array]]:
    """How late [s] after the cameras the log begins: as makes angles (n,) fit best as polynomials of the course of its
    encoder; and those."""

    def fitted(late_s: float) -> tuple[float, list[Array]]:
        place = course(np.clip(time_s - late_s, 0.0, last_s))
        told = [np.polynomial.Polynomial.fit(place, angle, CURVED)(place) for angle in angles]
        return float(sum(np.sum((a - b) ** 2) for a, b in zip(angles, told, strict=True))), told

    coarse = min(np.arange(-2.0, 2.0, 0.02), key=lambda x: fitted(x)[0])
    best = minimize_scalar(lambda x: fitted(x)[0], bounds=(coarse - 0.02, coarse + 0.02), method="bounded").x
    return float(best), fitted(float(best))[1]
