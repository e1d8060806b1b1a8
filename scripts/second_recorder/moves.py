"""Programs of moves and the reference that the drive follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .laboratory import Laboratory

Array = NDArray[np.float64]
STEP = 0.001  # s of the simulation

FLEXION_SPEEDS = (1.0, 0.45, 0.15, 0.7, 0.27, 1.0, 0.45, 0.15)
FLEXION_B_SPEEDS = (1.0, 0.45, 0.15, 0.7, 0.27)
EXCITATION = (
    (100, 1.0),
    (0, 1.0),
    (50, 1.0),
    (100, 1.0),
    (50, 1.0),
    (0, 1.0),
    (100, 0.5),
    (0, 0.5),
    (50, 0.5),
    (100, 0.5),
    (50, 0.5),
    (0, 0.5),
)

Move = tuple[float, float]


def flexion(speeds: tuple[float, ...]) -> list[Move]:
    """Full range there and back at each speed."""
    return [(target, speed) for speed in speeds for target in (100.0, 0.0)]


@dataclass(frozen=True)
class Program:
    """Sampled reference [%], its rate [%/s], and the commands as they are logged."""

    reference: Array
    rate: Array
    change_time: Array
    target: Array
    speed: Array

    @property
    def duration(self) -> float:
        """Seconds."""
        return len(self.reference) * STEP


def build(moves: list[Move], laboratory: Laboratory) -> Program:
    """Trapezoidal reference through the moves."""
    most, rest = laboratory.acceleration, laboratory.rest
    reference, rate = [np.zeros(round(rest / STEP))], [np.zeros(round(rest / STEP))]
    change, position, time = [0.0], 0.0, rest
    for target, speed in moves:
        distance, top = abs(target - position), laboratory.speed_max * speed
        change.append(time)
        time += distance / top + top / most + laboratory.hold
        count = round(time / STEP) - sum(len(part) for part in reference)
        t = np.arange(1, count + 1) * STEP
        ramp = top / most
        end = distance / top + ramp
        left = np.clip(end - t, 0.0, None)
        covered = np.where(
            t < ramp,
            0.5 * most * t**2,
            np.where(t < end - ramp, top * (t - 0.5 * ramp), distance - 0.5 * most * left**2),
        )
        sign = np.sign(target - position)
        reference.append(position + sign * covered)
        rate.append(sign * np.minimum(np.minimum(most * t, top), most * left))
        position = target
    return Program(
        np.concatenate(reference),
        np.concatenate(rate),
        np.array(change),
        np.array([0.0] + [move[0] for move in moves]),
        np.array([1.0] + [move[1] for move in moves]),
    )
