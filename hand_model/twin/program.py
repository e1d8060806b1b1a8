"""What the laboratory tells the hand to do: setpoint moves with a speed and a current limit, repeated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .truth import Controller

REST_S = 1.6  # at rest, hand open; a recorder that starts up to half a second late still sees a second of it
SPEED_SHARE = {"full": 1.0, "fast": 0.7, "half": 0.5, "medium": 0.45, "low": 0.27, "slow": 0.15}


@dataclass(frozen=True)
class Move:
    """From time_s [s] of the trial on: setpoint_percent [%] at speed_raw, current_limit_raw."""

    time_s: float
    setpoint_percent: float
    speed_raw: float
    current_limit_raw: float = 255.0


@dataclass(frozen=True)
class Program:
    """Moves in order of time, and the length of the trial [s]."""

    moves: tuple[Move, ...]
    duration_s: float


def _program(
    targets: list[tuple[float, str]], controller: Controller, limit: float = 255.0, settle_s: float = 0.45
) -> Program:
    time_s, at, moves = REST_S, 0.0, []
    for target, speed in targets:
        raw = float(round(SPEED_SHARE[speed] * controller.speed_raw_full))
        moves.append(Move(round(time_s, 3), target, raw, limit))
        time_s += abs(target - at) / (controller.speed_full * raw / controller.speed_raw_full) + settle_s
        at = target
    return Program(tuple(moves), time_s)


def flexion(
    controller: Controller,
    cycles: tuple[str, ...] = ("full", "medium", "slow", "fast", "low", "full", "medium", "slow"),
) -> Program:
    """Full cycles open-close-open, one per named speed; the defaults replay the first three."""
    return _program([(target, speed) for speed in cycles for target in (100.0, 0.0)], controller)


def excitation(controller: Controller, middle_percent: float = 50.0) -> Program:
    """The twelve programmed moves: full range and half ranges, at full, then at half speed."""
    path = (100.0, 0.0, middle_percent, 100.0, middle_percent, 0.0)
    return _program([(target, speed) for speed in ("full", "half") for target in path], controller)


def grasp(controller: Controller, speed: str = "half", limit_raw: float = 160.0) -> Program:
    """Close on an object, hold for a second, open; twice."""
    close = _program([(100.0, speed), (0.0, speed)] * 2, controller, limit_raw, settle_s=1.0)
    return replace(close, duration_s=close.duration_s + 0.3)


def commands(program: Program, time_s: np.ndarray, delay_s: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Setpoint [%], speed [raw] and current limit [raw] in force at times (n,) [s], `delay_s` after they were sent."""
    moves = program.moves
    first = Move(0.0, 0.0, moves[0].speed_raw, moves[0].current_limit_raw)
    index = np.searchsorted([m.time_s for m in moves], np.asarray(time_s) - delay_s, side="right")
    table = np.array([[m.setpoint_percent, m.speed_raw, m.current_limit_raw] for m in (first, *moves)])
    return tuple(table[index].T)
