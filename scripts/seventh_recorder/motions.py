"""The programmed moves: trapezoidal references, measured from the foreign sessions."""

from dataclasses import dataclass

import numpy as np

from .stepper import STEP_S

FULL_SPEED = 115.0
FLEXION_SPEEDS = (1.0, 0.45, 0.15, 0.7, 0.27, 1.0, 0.45, 0.15)


@dataclass(frozen=True)
class Pace:
    """Timing of a session: rest before the first move (s), pause after each (s), acceleration (%/s^2), full speed."""

    rest: float
    pause: float
    acceleration: float
    full_speed: float


PACE = Pace(1.2, 0.35, 900.0, FULL_SPEED)


@dataclass(frozen=True)
class Move:
    """One move to a target in % at a fraction of the full speed."""

    target: float
    fraction: float


@dataclass(frozen=True)
class Programme:
    """A reference every STEP_S with the commands that stand in the log: start time, target in %, speed fraction."""

    position: np.ndarray
    speed: np.ndarray
    commands: tuple[tuple[float, float, float], ...]

    @property
    def duration(self) -> float:
        """Length in s."""
        return len(self.position) * STEP_S


def flexion_moves(speeds: tuple[float, ...]) -> list[Move]:
    """Full strokes there and back at each speed."""
    return [Move(target, fraction) for fraction in speeds for target in (100.0, 0.0)]


def excitation_moves() -> list[Move]:
    """The twelve moves: full range, half ranges, at full and at half speed."""
    return [Move(target, fraction) for fraction in (1.0, 0.5) for target in (100.0, 0.0, 50.0, 100.0, 50.0, 0.0)]


def programme(moves: list[Move], pace: Pace) -> Programme:
    """The reference of a list of moves."""
    rest = round(pace.rest / STEP_S)
    positions, speeds, done = [np.zeros(rest)], [np.zeros(rest)], rest
    commands = [(0.0, 0.0, moves[0].fraction)]
    start, here = pace.rest, 0.0
    for move in moves:
        commands.append((start, move.target, move.fraction))
        speed, way = move.fraction * pace.full_speed, abs(move.target - here)
        ramp, moving = speed / pace.acceleration, way / speed + speed / pace.acceleration
        end = start + moving + pace.pause
        count = round(end / STEP_S) - done
        t = (np.arange(count) + done) * STEP_S - start
        left = np.clip(moving - t, 0, None)
        path = np.where(t < ramp, pace.acceleration * t**2 / 2, speed * (t - ramp / 2))
        path = np.where(left < ramp, way - pace.acceleration * left**2 / 2, path)
        sign = np.sign(move.target - here)
        positions.append(here + sign * np.clip(path, 0, way))
        speeds.append(sign * np.clip(pace.acceleration * np.minimum(t, left), 0, speed))
        start, here, done = end, move.target, done + count
    return Programme(np.concatenate(positions), np.concatenate(speeds), tuple(commands))
