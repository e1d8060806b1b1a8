"""Linkages: the polynomial that MJCF enforces, the straight line that URDF's <mimic> can hold, and what that loses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import HandFileError, did_you_mean
from ..hand import Finger
from ..kinematics import displace, finger_angles

Array = NDArray[np.float64]

ORDER = 4  # MuJoCo's polycoef holds five coefficients
SAMPLES = 201


@dataclass(frozen=True)
class Linkage:
    """One linkage of a finger: follower = sum_i coefficients[i] driver^i [rad], and its line for URDF.

    source: the independent joint that the line starts from (mimics are never chained). multiplier [-], offset [rad]:
    the least-squares line over the source's range with both ends within the follower's range.
    loss_rad, loss_tip_m: largest departure of that line from the polynomial, in angle [rad] and at the fingertip [m].
    """

    driver: str
    follower: str
    coefficients: Array
    source: str
    multiplier: float
    offset: float
    loss_rad: float
    loss_tip_m: float


def checked(finger: Finger) -> Finger:
    """The finger, its couplings in an order in which every driver comes first.

    Raises HandFileError for unknown joints, two couplings on one joint, circles, or more than five coefficients.
    """
    names = [joint.name for joint in finger.joints]
    where = f'finger "{finger.name}"'
    followers = [c.follower for c in finger.couplings]
    for coupling in finger.couplings:
        for name in (coupling.driver, coupling.follower):
            if name not in names:
                raise HandFileError(f'{where}: a coupling names joint "{name}"; {did_you_mean(name, names)}')
        if followers.count(coupling.follower) > 1:
            raise HandFileError(f'{where}: joint "{coupling.follower}" follows in two couplings; one is possible')
        coefficients = np.asarray(coupling.coefficients, float)
        if not (1 <= len(coefficients) <= ORDER + 1 and np.isfinite(coefficients).all()):
            raise HandFileError(f'{where}: the coupling of "{coupling.follower}" needs one to five finite coefficients')
    done = [name for name in names if name not in followers]
    waiting, ordered = list(finger.couplings), []
    while waiting:
        ready = [c for c in waiting if c.driver in done]
        if not ready:
            raise HandFileError(f"{where}: its couplings form a circle ({', '.join(c.follower for c in waiting)})")
        ordered += ready
        done += [c.follower for c in ready]
        waiting = [c for c in waiting if c not in ready]
    return replace(finger, couplings=tuple(ordered))


def source_of(finger: Finger, joint: str) -> str:
    """The independent joint at the start of a joint's chain of couplings (itself where it follows nothing)."""
    drivers = {c.follower: c.driver for c in finger.couplings}
    while joint in drivers:
        joint = drivers[joint]
    return joint


def limits(finger: Finger) -> dict[str, tuple[float, float]]:
    """Range (low, high) [rad] of every joint: as recorded, widened to what its polynomial reaches over its driver's
    range.

    A range without width is opened by 1e-3 rad to both sides, since neither format accepts it.
    """
    out: dict[str, tuple[float, float]] = {}
    for joint in finger.joints:
        low, high = sorted(float(v) for v in joint.range_rad)
        if not np.isfinite([low, high]).all():
            raise HandFileError(f'finger "{finger.name}": the range of joint "{joint.name}" is not finite')
        out[joint.name] = (low - 1e-3, high + 1e-3) if high - low < 1e-6 else (low, high)
    for coupling in finger.couplings:
        low, high = out[coupling.follower]
        reached = coupling.follower_rad(np.linspace(*out[coupling.driver], SAMPLES))
        out[coupling.follower] = (min(low, float(reached.min())), max(high, float(reached.max())))
    return out


def linkages(finger: Finger) -> tuple[Linkage, ...]:
    """All linkages of a checked finger that carries tips, with their lines and losses."""
    from scipy.optimize import lsq_linear

    bounds = limits(finger)
    found: list[Linkage] = []
    for coupling in finger.couplings:
        source = source_of(finger, coupling.follower)
        low, high = bounds[source]
        driver = np.linspace(low, high, SAMPLES)
        exact = finger_angles(finger, {source: driver})
        column = [j.name for j in finger.joints].index(coupling.follower)
        share = (driver - low) / (high - low)
        # the unknowns are the line's values at both ends: box bounds on them keep the whole line within the limits
        floor, ceiling = bounds[coupling.follower]
        ends = lsq_linear(np.stack([1 - share, share], 1), exact[:, column], (floor, max(ceiling, floor + 1e-9))).x
        multiplier = float((ends[1] - ends[0]) / (high - low))
        offset = float(ends[0] - multiplier * low)
        line = exact.copy()
        line[:, column] = multiplier * driver + offset
        found.append(
            Linkage(
                coupling.driver,
                coupling.follower,
                np.asarray(coupling.coefficients, float),
                source,
                multiplier,
                offset,
                float(np.abs(line - exact).max()),
                float(np.linalg.norm(_tip(finger, line) - _tip(finger, exact), axis=-1).max()),
            )
        )
    return tuple(found)


def _tip(finger: Finger, angles: Array) -> Array:
    last = len(finger.joints) - 1
    return displace(finger, angles).points(last, finger.joints[last].tip_palm)[:, 0]
