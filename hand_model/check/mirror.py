"""Left and right as mirror images."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..description import Description
from ..hand import Hand
from ..rotation import angle_between
from .finding import Finding

Array = NDArray[np.float64]

ACROSS = np.array([1.0, -1.0, 1.0])  # the palm's plane of symmetry is x-z
SIGMAS = 3.0


def mirrored(axis_palm: Array, centre_palm: Array) -> tuple[Array, Array]:
    """Axis and centre (3,) of the other hand's joint: a position is reflected, an axis (of a turn) reflected and
    reversed."""
    return -ACROSS * axis_palm, ACROSS * centre_palm


def mirror_differences(one: Hand, other: Hand) -> dict[tuple[str, str], tuple[float, float, float, float]]:
    """(finger, joint) -> axis difference [rad], its standard deviation [rad], centre difference [m], its standard
    deviation [m], for the joints that both hands have; deviations from both covariances."""
    out = {}
    fingers = {f.name: f for f in other.fingers}
    for finger in one.fingers:
        joints = {j.name: j for j in fingers[finger.name].joints} if finger.name in fingers else {}
        for joint in finger.joints:
            if joint.name in joints:
                twin = joints[joint.name]
                axis, centre = mirrored(twin.axis_palm, twin.centre_palm)
                variance = np.diagonal(joint.covariance) + np.diagonal(twin.covariance)
                spread = np.sqrt(variance[:3].sum()), np.sqrt(variance[3:].sum())
                turn, shift = (
                    float(angle_between(joint.axis_palm, axis)),
                    float(np.linalg.norm(joint.centre_palm - centre)),
                )
                out[finger.name, joint.name] = (turn, float(spread[0]), shift, float(spread[1]))
    return out


def mirror(description: Description, other: Description) -> Finding:
    """Every joint's axis and centre is the mirror image of the other side's, within three standard deviations of what
    both files state."""
    if {description.side, other.side} != {"left", "right"}:
        return Finding(
            "mirror", False, None, f"a left and a right hand are needed, not {description.side} and {other.side}"
        )
    differences = mirror_differences(description.hand, other.hand)
    if not differences:
        return Finding("mirror", False, None, "the two hands share no joint")
    problems = [
        (
            f"{finger} {joint}: {np.degrees(turn):.2g} deg (sd {np.degrees(a):.2g}), "
            f"{shift * 1e3:.2g} mm (sd {c * 1e3:.2g})"
        )
        for (finger, joint), (turn, a, shift, c) in differences.items()
        if turn > SIGMAS * a + 1e-9 or shift > SIGMAS * c + 1e-9
    ]
    turns, shifts = np.array([d[0] for d in differences.values()]), np.array([d[2] for d in differences.values()])
    said = (
        f"{len(differences)} joints: axes {np.degrees(np.median(turns)):.2g} deg apart in the median, "
        f"centres {np.median(shifts) * 1e3:.2g} mm"
    )
    said += ", within what both files state" if not problems else "; beyond what they state: " + "; ".join(problems[:5])
    return Finding("mirror", not problems, float(np.degrees(turns.max())), said)
