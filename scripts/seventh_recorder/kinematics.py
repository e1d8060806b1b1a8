"""From the drive's run to marker positions in the palm frame."""

import numpy as np
from scipy.spatial.transform import Rotation

from .plan import Plan
from .stepper import Run


def play(x: np.ndarray, width: float, give: float = 0.0) -> np.ndarray:
    """Lost motion of this full width; with give > 0 the flanks are soft (same unit as x)."""
    out, y, half = np.empty_like(x), float(x[0]), width / 2
    for i, value in enumerate(x):
        out[i] = y = min(max(y, value - half), value + half)
    return out if give <= 0 else out + (x - out) * np.tanh(np.abs(x - out) / give) * 0.3


def curve(first: float, second: float, x: np.ndarray) -> np.ndarray:
    """A joint's share of its full angle at the share x of what drives it: a cubic through both ends."""
    return first * x + second * x**2 + (1 - first - second) * x**3


def angles(plan: Plan, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Proximal and distal angle in rad at every instant of a run."""
    finger, position = plan.finger, run.finger.copy()
    for step in plan.finger_steps:
        position = step(position, run)
    a, b, c, d = finger.coef
    proximal = finger.angle_full[0] * curve(a, b, position / 100)
    driving = proximal.copy()
    for step in plan.proximal_steps:
        driving = step(driving, run)
    distal = finger.angle_full[1] * curve(c, d, driving / finger.angle_full[0])
    for step in plan.distal_steps:
        distal = step(distal, run)
    return proximal, distal


def _joint(plan: Plan, joint: int, angle: np.ndarray, run: Run, keep: np.ndarray) -> tuple[Rotation, np.ndarray]:
    """Rotation of one joint and travel of its centre (mm) at the kept instants."""
    axis = plan.finger.axes[joint]
    turn = Rotation.from_rotvec(angle[keep, None] * axis)
    across = np.cross(axis, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    for which, wobble in plan.wobbles:
        if which == joint:
            turn = turn * Rotation.from_rotvec(wobble(angle, run)[keep, None] * across)
    travel = np.zeros((len(turn), 3))
    for which, shift in plan.shifts:
        if which == joint:
            travel += shift(angle[keep] / plan.finger.angle_full[joint])
    return turn, travel


def markers_in_palm(plan: Plan, run: Run, times: np.ndarray) -> np.ndarray:
    """(frames, 6, 3) in mm in the palm frame: rigid segments on the two hinges, then what moves markers."""
    keep = np.clip(np.searchsorted(run.time, times - 1e-9), 0, len(run.time) - 1)
    proximal, distal = angles(plan, run)
    finger = plan.finger
    turn_1, travel_1 = _joint(plan, 0, proximal, run, keep)
    turn_2, travel_2 = _joint(plan, 1, distal, run, keep)

    def by_proximal(points: np.ndarray) -> np.ndarray:
        return turn_1.apply(points - finger.centres[0]) + finger.centres[0] + travel_1

    out = np.empty((len(times), 6, 3))
    for i in range(3):
        out[:, i] = by_proximal(np.tile(finger.markers[0, i], (len(times), 1)))
        on_distal = turn_2.apply(finger.markers[1, i] - finger.centres[1]) + finger.centres[1] + travel_2
        out[:, 3 + i] = by_proximal(on_distal)
    for step in plan.marker_steps:
        out = step(out, times, run.speed[keep])
    return out
