"""The state in which a move leaves the drive to the next one: within its deadband a cascade creeps on.

Where the integral of a position loop holds, a drive goes on at what its last push allows, for seconds: too slowly for
its encoder to tell from rest, fast enough that the next move begins some milliseconds earlier or later.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .moves import MoveData
from .residuals import simulate_moves

Array = NDArray[np.float64]

LEAST = 1e-3  # [%/s] below which a drive rests
SURE = 0.1  # share of what the encoder tells of a begin that the simulated one is off
ODD = 4.0  # standard deviations of the velocity seen, beyond which it is believed rather than the simulated one


def end_state(time_s: Array, simulated: Array) -> tuple[float, float, float]:
    """Position [%], current [raw] and velocity [%/s] at the end of a simulated move, at times (n,) [s]: position and
    current (n, 2)."""
    creep = float((simulated[-1, 0] - simulated[-4, 0]) / (time_s[-1] - time_s[-4]))
    return float(simulated[-1, 0]), float(simulated[-1, 1]), creep if abs(creep) > LEAST else 0.0


def follows(m: MoveData, before: MoveData) -> bool:
    """Whether a move begins where the one before ends."""
    return m.trial == before.trial and m.index == before.index + 1 + len(before.time_s)


def begins(
    data: Sequence[MoveData], values: Mapping[str, float], own: Array, controller: str
) -> list[tuple[float, float, float] | None]:
    """Position [%], current [raw] and velocity [%/s] with which whole moves of a cascade begin; None for a first move,
    for one that is seen to move otherwise, and for a controller that lets nothing creep."""
    found: list[tuple[float, float, float] | None] = [None] * len(data)
    if controller != "cascade":
        return found
    simulated = simulate_moves(data, values, own, controller, calm=True)
    for i in range(1, len(data)):
        if follows(data[i], data[i - 1]):
            state = end_state(data[i - 1].time_s, simulated[i - 1])
            found[i] = state if abs(state[2] - data[i].seen[0]) < ODD * data[i].seen[1] else None
    return found


def creeping(data: Sequence[MoveData], states: Sequence[tuple[float, float, float] | None]) -> tuple[MoveData, ...]:
    """The moves with the velocities of these states at their begin."""
    return tuple(m if s is None else dataclasses.replace(m, velocity=s[2]) for m, s in zip(data, states, strict=True))


def continued(data: Sequence[MoveData], states: Sequence[tuple[float, float, float] | None]) -> tuple[MoveData, ...]:
    """The moves with these states at their begin, known as well as the simulation: when a command took effect is to be
    told from there."""
    out = []
    for m, s in zip(data, states, strict=True):
        if s is not None:
            own, own_sd = np.array([m.own[0], s[0], m.own[2], s[1]]), m.own_sd * [1.0, SURE, 1.0, SURE]
            m = dataclasses.replace(m, own=own, own_sd=own_sd, velocity=s[2])
        out.append(m)
    return tuple(out)
