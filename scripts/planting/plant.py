"""What is put into a recording: where it changes log, manifest and markers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_smoothing_spline
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Draw = np.random.Generator
Columns = dict[str, Array]
SPREAD = 4.0  # [counts] of an encoder's noise


@dataclass(frozen=True)
class Motor:
    """coulomb, preload [raw], viscous [raw per %/s], stiffness [raw per %] of the drive; low, high: its counts where the
    finger is open and closed; weight: moments (2,) of the finger's unit weight that go with the cosine and the sine of
    its angle, full_rad: that at 100 %."""

    coulomb: float
    viscous: float
    stiffness: float
    preload: float
    low: float
    high: float
    weight: tuple[float, float] = (1.0, 0.0)
    full_rad: float = 1.4


@dataclass(frozen=True)
class Moving:
    """Of one log: time [s] in the trial, place [%], speed [%/s], and time [s] since the drive was first asked to move."""

    time_s: Array
    place: Array
    speed: Array
    since_s: Array
    number: int


@dataclass(frozen=True)
class Seen:
    """One flexion recording of a finger's markers: time [s] in the trial (n,) and in its log, markers (n, m, 3) [m] in the
    world, their labels; which of them are of the proximal and distal segment and of the palm; of each joint its angle
    [rad], axis (n, 3) in the world and centre (n, 3) [m]; and the load (n,) [raw] that is planted in its drive."""

    time_s: Array
    log_s: Array
    position: Array
    labels: tuple[str, ...]
    segments: tuple[NDArray[np.int64], NDArray[np.int64]]
    palm: NDArray[np.int64]
    angle: tuple[Array, Array]
    axis: tuple[Array, Array]
    centre: tuple[Array, Array]
    palm_turn: Array
    proximal_turn: Array
    load: Array


@dataclass(frozen=True)
class Plant:
    """load: what is added to the current [raw]; columns: other changes of a log; markers: of what cameras saw, (n, m, 3)
    [m]. figures: for the answer."""

    load: Callable[[Moving], Array] | None = None
    columns: Callable[[Columns, Moving], Columns] | None = None
    markers: Callable[[Seen], Array] | None = None
    figures: Mapping[str, Any] = field(default_factory=dict)


def smoothed(time_s: Array, values: Array, noise: float) -> BSpline:
    """The smoothest of a row of splines through values (n,) that leaves no more than their noise."""
    for penalty in 10.0 ** np.arange(-5, -11, -0.5):
        course = make_smoothing_spline(time_s, values, lam=penalty)
        if np.std(values - course(time_s)) <= noise:
            break
    return course


def about(points: Array, vector: Array, centre: Array) -> Array:
    """Points (n, m, 3) turned about centres (n, 3) by rotation vectors (n, 3) [rad]."""
    turn = Rotation.from_rotvec(vector).as_matrix()
    return np.einsum("nij,nmj->nmi", turn, points - centre[:, None]) + centre[:, None]


def turned_over(place: Array, reach: float) -> Array:
    """State (n,) between -1 and 1 that goes along with a place until it yields (Prandtl), -1 before."""
    out, state = np.full(len(place), -1.0), -1.0
    for k in range(1, len(place)):
        out[k] = state = min(max(state + (place[k] - place[k - 1]) / reach, -1.0), 1.0)
    return out
