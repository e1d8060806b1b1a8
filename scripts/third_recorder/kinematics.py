"""A finger's two joints behind its motor: from motor position to joint angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from .geometry import Array, unit
from .motor import ROW_S, Motor, Trace

SOFT = 1e-5  # rounding of a corner in units of the range, squared


@dataclass(frozen=True)
class Wobble:
    """A joint's axis tilts by an amplitude [rad] about a direction across it [rad from the finger's own], with the
    angle (waves per range, phase) or with the direction of motion."""

    joint: int
    amplitude: float
    across: float
    waves: float
    phase: float
    follows: str


@dataclass(frozen=True)
class MovingCentre:
    """A joint's centre travels [mm] towards a direction across its axis [rad], with a power of the angle."""

    joint: int
    path_mm: float
    towards: float
    power: float


@dataclass
class Linkage:
    """Axes, centres [mm] and full angles [rad] of the proximal and the distal joint in the landmark frame, hand open;
    polynomials without constant of the proximal angle over motor position (3) and of the distal over the proximal (4).
    What is None is not there."""

    axes: Array
    centres: Array
    full: Array
    drive: Array
    coupling: Array
    drive_play: float | None = None  # [%]
    give_share: float | None = None  # of the friction that sits on the finger's side of the give
    give: float | None = None  # [rad/raw] between motor and proximal joint
    linkage_play: float | None = None  # [rad]
    linkage_share: float | None = None
    linkage_give: float | None = None  # [rad/raw] between the joints
    deadband: float | None = None  # share of the range in which the distal joint stays
    stop: float | None = None  # share of its range at which the distal joint stops
    wobble: Wobble | None = None
    moving_centre: MovingCentre | None = None
    creep: tuple[float, float] | None = None  # [rad], time constant [s]

    def frame(self, joint: int) -> tuple[Array, Array]:
        """Unit vectors along the finger and dorsal, across the axis of a joint."""
        along, axis = unit(self.centres[1] - self.centres[0]), self.axes[joint]
        along = unit(along - axis * (axis @ along))
        return along, np.cross(along, axis)


def play(driver: Array, width: float) -> Array:
    """What follows a driver through a gap of a width, both in the same unit; it lies a fifth of the gap from one side
    at first."""
    at = driver[0] - 0.3 * width
    half = width / 2
    out = np.empty_like(driver)
    for i, x in enumerate(driver.tolist()):
        if at < x - half:
            at = x - half
        elif at > x + half:
            at = x + half
        out[i] = at
    return out


def joint_angles(linkage: Linkage, motor: Motor, trace: Trace) -> tuple[Array, Array]:
    """Proximal and distal angle [rad] at the rows of a trace."""
    proximal = proximal_angle(linkage, motor, trace)
    driver = play(proximal, linkage.linkage_play) if linkage.linkage_play else proximal
    y = driver / linkage.full[0]
    if linkage.deadband:
        past = y - linkage.deadband
        y = 0.5 * (past + np.sqrt(past * past + SOFT)) / (1 - linkage.deadband)
    d = linkage.coupling
    distal = linkage.full[1] * (d[0] * y + d[1] * y**2 + d[2] * y**3 + d[3] * y**4)
    if linkage.stop:
        end = linkage.stop * linkage.full[1]
        left = end - distal
        distal = end - 0.5 * (left + np.sqrt(left * left + 4 * SOFT))
    if linkage.linkage_give:
        rubbing = linkage.linkage_share * trace.friction + 0.8 * motor.viscous * trace.speed
        distal = distal - linkage.linkage_give * (rubbing + motor.stiffness * 0.5 * (trace.position - 50))
    return proximal, distal


def proximal_angle(linkage: Linkage, motor: Motor, trace: Trace) -> Array:
    """Angle [rad] of the proximal joint behind play, creep and give of its drive."""
    x = (trace.position + trace.lift) / 100
    if linkage.drive_play:
        x = play(x, linkage.drive_play / 100)
    c = linkage.drive
    angle = linkage.full[0] * (c[0] * x + c[1] * x**2 + c[2] * x**3)
    if linkage.creep:
        size, time_s = linkage.creep
        a = ROW_S / time_s
        angle = angle - size * 2 * (x - lfilter([a], [1, -(1 - a)], x))
    if linkage.give:
        rubbing = linkage.give_share * trace.friction + 0.9 * motor.viscous * trace.speed
        angle = angle - linkage.give * (rubbing + motor.stiffness * (trace.position - 50))
    return angle
