"""Faults of the recording: markers and supports that slip, labels exchanged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry import rotate, turn, unit
from ..influence import Draw, Influence, effect
from ..schedule import TrialPlan

Array = NDArray[np.float64]


def _segment(draw: Draw) -> tuple[str, list[str]]:
    index = int(draw.fixed.get("segment", draw.rng.integers(2)))
    joint = draw.finger.joints[index]
    draw.where["joint"] = joint.name
    return joint.name, list(joint.markers_palm)


def _after(trial: TrialPlan, time_s: Array, moment_s: float) -> Array:
    return trial.start_s + time_s >= moment_s


@effect("marker_slip", "recording", "markers")
def marker_slip(draw: Draw) -> Influence:
    """One marker moves on its segment at some moment and stays there for the rest of the session."""
    segment, labels = _segment(draw)
    k = int(draw.rng.integers(len(labels)))
    draw.where["marker"] = labels[k]
    moment = draw.moment()
    shift = unit(draw.rng.normal(size=3)) * draw.size("distance_m", 1.2e-3, 2.2e-3)

    def slip(trial: TrialPlan, time_s: Array, name: str, points: Array) -> Array:
        if name != segment:
            return points
        out = points.copy()
        out[_after(trial, time_s, moment), k] += shift
        return out

    return Influence(segment=slip)


@effect("support_slip", "recording", "markers")
def support_slip(draw: Draw) -> Influence:
    """All markers of a segment turn together at some moment, as their support gives way."""
    segment, labels = _segment(draw)
    draw.where["markers"] = labels
    moment = draw.moment()
    rotation = turn(draw.rng.normal(size=3), draw.size("angle_rad", 0.05, 0.09))
    shift = unit(draw.rng.normal(size=3)) * draw.size("distance_m", 2e-4, 8e-4)

    def slip(trial: TrialPlan, time_s: Array, name: str, points: Array) -> Array:
        if name != segment:
            return points
        centre = points.mean(axis=1, keepdims=True)
        after = _after(trial, time_s, moment)[:, None, None]
        return np.where(after, rotate(rotation, points - centre) + centre + shift, points)

    return Influence(segment=slip)


@effect("palm_marker_slip", "recording", "markers")
def palm_marker_slip(draw: Draw) -> Influence:
    """A palm marker moves at some moment and stays there, for every later trial of every finger."""
    labels = list(draw.truth.palm_markers_palm)
    k = int(draw.rng.integers(3))
    draw.where["marker"] = labels[k]
    moment = draw.moment()
    shift = unit(draw.rng.normal(size=3)) * draw.size("distance_m", 1.3e-3, 2.4e-3)

    def slip(trial: TrialPlan, time_s: Array, points: Array) -> Array:
        out = points.copy()
        out[_after(trial, time_s, moment), k] += shift
        return out

    return Influence(palm=slip)


@effect("marker_swap", "recording", "markers", ("same_segment", "across"))
def marker_swap(draw: Draw) -> Influence:
    """Two labels are exchanged for a while."""
    proximal, distal = (list(joint.markers_palm) for joint in draw.finger.joints)
    pair = draw.rng.choice(distal if draw.rng.uniform() < 0.5 else proximal, 2, replace=False).tolist()
    if draw.form == "across":
        pair = [str(draw.rng.choice(proximal)), str(draw.rng.choice(distal))]
    draw.where["markers"] = pair
    begin = draw.moment()
    end = draw.note("end_s", begin + draw.size("length_s", 2.0, 6.0))

    def swap(trial: TrialPlan, time_s: Array, markers: dict[str, Array]) -> dict[str, Array]:
        span = _after(trial, time_s, begin) & ~_after(trial, time_s, end)
        out = {label: points.copy() for label, points in markers.items()}
        out[pair[0]][span], out[pair[1]][span] = markers[pair[1]][span], markers[pair[0]][span]
        return out

    return Influence(world=swap)
