"""What the hand is told to do: setpoints and speeds over time."""

import numpy as np

from eighth_recorder.simulate import GRID

PAUSE = 1.2
FLEXION = (255, 115, 38, 178, 69, 255, 115, 38)
FLEXION_SHORT = (255, 115, 38, 178, 69)
FLEXION_BRIEF = (255, 115, 51)
EXCITATION = (
    (100, 255),
    (0, 255),
    (50, 255),
    (100, 255),
    (50, 255),
    (0, 255),
    (100, 128),
    (0, 128),
    (50, 128),
    (100, 128),
    (50, 128),
    (0, 128),
)


def targets_of(kind: str, repeat: bool, short: bool) -> list[tuple[float, int]]:
    """(target in %, speed 0..255) of every move."""
    if kind == "excitation":
        return list(EXCITATION)
    speeds = (FLEXION_BRIEF if repeat else FLEXION_SHORT) if short else (FLEXION_SHORT if repeat else FLEXION)
    return [(target, speed) for speed in speeds for target in (100, 0)]


def schedule(moves, full_speed: float) -> dict[str, np.ndarray]:
    """Setpoint [%], pace [%/s] and raw speed on the 1 ms grid."""
    target, speed, now = [np.zeros(round(PAUSE / GRID))], [np.full(round(PAUSE / GRID), moves[0][1])], 0.0
    for goal, raw in moves:
        n = round((0.48 + 0.955 * abs(goal - now) / (full_speed * raw / 255)) / GRID)
        target.append(np.full(n, float(goal)))
        speed.append(np.full(n, raw))
        now = goal
    target, speed = np.concatenate(target), np.concatenate(speed)
    return {"target": target, "speed": speed, "pace": full_speed * speed / 255.0}
