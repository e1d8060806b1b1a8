"""Hinges that are none: a second rotation, a centre that travels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry import turn, unit
from ..influence import Draw, Influence, effect

Array = NDArray[np.float64]


def _joint(draw: Draw) -> tuple[int, float]:
    """Which joint is affected, and its full angle [rad]."""
    index = int(draw.fixed.get("joint", draw.rng.integers(2)))
    draw.where["joint"] = ("proximal", "distal")[index]
    proximal = float(draw.finger.proximal_rad.sum())
    full = proximal if index == 0 else float(np.polynomial.polynomial.polyval(proximal, draw.finger.distal_rad))
    return index, full


def _none(angle: Array) -> tuple[Array, Array]:
    return np.tile([1.0, 0.0, 0.0, 0.0], (len(angle), 1)), np.zeros((len(angle), 3))


def _across(draw: Draw, index: int) -> Array:
    axis = draw.finger.joints[index].axis_palm
    vector = draw.rng.normal(size=3)
    return unit(vector - axis * (axis @ vector))


@effect("joint_wobble", "kinematics", "markers", ("wave", "bow"))
def joint_wobble(draw: Draw) -> Influence:
    """A second, smaller rotation about an axis across the hinge, a function of its angle."""
    index, full = _joint(draw)
    amplitude = draw.size("amplitude_rad", 0.022, 0.04)
    across, phase = _across(draw, index), draw.uniform("phase_rad", 0.0, 2 * np.pi)

    def pose(joint: int, angle: Array) -> tuple[Array, Array]:
        if joint != index:
            return _none(angle)
        u = angle / full
        if draw.form == "wave":
            tilt = amplitude * (np.sin(2 * np.pi * u + phase) - np.sin(phase))
        else:
            tilt = amplitude * 4.0 * u * (1.0 - u) * (1.3 - 0.6 * u)
        return turn(across, tilt), np.zeros((len(angle), 3))

    return Influence(pose=pose)


@effect("moving_centre", "kinematics", "markers", ("rolling", "cam", "ellipse"))
def moving_centre(draw: Draw) -> Influence:
    """The centre of rotation travels across the axis as the joint turns."""
    index, full = _joint(draw)
    travel = draw.size("travel_m", 1.2e-3, 2.2e-3)
    first = _across(draw, index)
    second = np.cross(draw.finger.joints[index].axis_palm, first)

    def pose(joint: int, angle: Array) -> tuple[Array, Array]:
        if joint != index:
            return _none(angle)
        u = (angle / full)[:, None]
        if draw.form == "rolling":
            shift = u * first
        elif draw.form == "cam":
            shift = u**2 * first
        else:
            shift = 0.6 * (np.sin(np.pi * u) * first + (1.0 - np.cos(np.pi * u)) * second)
        return _none(angle)[0], travel * shift

    return Influence(pose=pose)
