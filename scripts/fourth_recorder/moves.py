"""What a finger is told to do in each trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .geometry import Array
from .laboratory import Laboratory

EXCITATION = (100.0, 0.0, 50.0, 100.0, 50.0, 0.0)  # [%]


@dataclass(frozen=True)
class Move:
    """To a target [%] at a share of the top speed."""

    target: float
    share: float


@dataclass(frozen=True)
class Planned:
    """A trial of one finger. begun_s: since the motor first moved; validate: kept out of the fit."""

    kind: str
    suffix: str
    moves: tuple[Move, ...]
    begun_s: float
    validate: bool


def plan_trials(laboratory: Laboratory) -> list[Planned]:
    """Two flexion trials and some of excitation, the same for every finger."""
    cycles = tuple(Move(target, share) for share in laboratory.speeds for target in (100.0, 0.0))
    excitation = tuple(Move(target, share) for share in (1.0, 0.5) for target in EXCITATION)
    trials = [
        Planned("flexion", "", cycles, 0.0, False),
        Planned("flexion", "_b", cycles[: 2 * laboratory.repeated_cycles], 120.0, True),
    ]
    last = laboratory.excitations - 1
    return trials + [
        Planned("excitation", f"_{i + 1}", excitation, 180.0 + 45 * i, i == last) for i in range(laboratory.excitations)
    ]


def schedule(laboratory: Laboratory, moves: Sequence[Move]) -> tuple[tuple[float, ...], float]:
    """When each move starts, and when all is done [s]."""
    time, starts, place = laboratory.wait_s, [], 0.0
    for move in moves:
        starts.append(time)
        speed = laboratory.top_speed * move.share
        time += abs(move.target - place) / speed + speed / laboratory.acceleration + laboratory.dwell_s
        place = move.target
    return tuple(starts), time


def commands(moves: Sequence[Move], starts: Sequence[float], times: Array) -> tuple[Array, Array]:
    """Target [%] and share of the top speed commanded at times [s]."""
    target, share = np.zeros_like(times), np.full_like(times, moves[0].share)
    for move, start in zip(moves, starts, strict=True):
        target[times >= start] = move.target
        share[times >= start] = move.share
    return target, share
