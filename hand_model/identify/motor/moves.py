"""The commanded moves of a log that start with the drive at rest, or creeping within its deadband."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...session import rows_lost
from .grid import NEVER
from .recording import MotorTrial

Array = NDArray[np.float64]

SETTLED = 0.6  # [%]: movement allowed over the samples before a move that starts from rest
SURE = 0.05  # share of what one logged speed is known to, below which no level of speeds is known
AFTER_S = 0.05  # after which a move that is settled counts as over
AWAY = 0.02  # share of a move by which a drive has left a place, well beyond the noise of an encoder
# after a drive has left its place, before it is back at rest, and after that: where it may be sudden
STARTS_S, STOPS_S, RESTS_S = 0.15, 0.3, 0.2
BEFORE = 12  # samples at rest that a move looks back to


@dataclass(frozen=True)
class MoveData:
    """One move from rest: its samples, and what the command says.

    Known only so well, and estimated with the fit: own = when the command took effect (within one sample of the log)
    [s], where the drive rested [%], the speed [share of full] (logged in whole raw units), and the current that held it
    at rest [raw].
    own_sd: (4,) standard deviations. velocity [%/s]: of a drive that creeps before the command; 0 at rest. logged: the
    speed as it is logged.
    seen: velocity before the command as the encoder tells it, and its deviation [%/s].
    """

    trial: str
    index: int
    time_s: Array
    position: Array
    current: Array
    origin: float
    target: float
    limit: float
    own: Array
    own_sd: Array
    velocity: float = 0.0
    logged: float = 1.0
    seen: tuple[float, float] = (0.0, np.inf)

    @cached_property
    def calm_s(self) -> tuple[float, float, float]:
        """When the drive was seen to cruise, from and until, and from when on to rest [s]: where nothing sudden
        happens."""
        return _calm(self)


def moves_from_rest(trial: MotorTrial, sigma: tuple[float, float], speed_full: float) -> tuple[MoveData, ...]:
    """The commanded moves of a log that start with the drive at rest; empty where no setpoint is logged.

    The current of the last sample before a command may be of the command already, as channels are read one after the
    other: it belongs to no move.

    sigma: noise of position [%] and current [raw]. speed_full: raw full scale of the speed column.
    """
    if trial.setpoint is None:
        return ()
    t, p, sigma_position = trial.time_s, trial.position, sigma[0]
    whole = (
        trial.speed is not None
        and speed_full > 1
        and np.allclose(trial.speed * speed_full, np.round(trial.speed * speed_full))
    )
    speed_sd = 1 / (np.sqrt(12) * speed_full) if whole else 1e-4
    change = np.flatnonzero(np.diff(trial.setpoint) != 0)
    lost = rows_lost(t)  # a command among them came nobody knows when
    ends = np.append(change[1:] - 1, len(t) - 1)
    found = []
    for i, j in zip(change, ends, strict=True):
        look = slice(max(0, i - BEFORE + 1), i + 1)
        if (
            j - i < 8
            or lost[i]
            or trial.setpoint[i + 1] == trial.setpoint[i]
            or (rest := _rest(t[look], p[look], sigma_position)) is None
        ):
            continue
        held = trial.current[look][:-1]
        speed = 1.0 if trial.speed is None else float(trial.speed[i + 1])
        limit = np.inf if trial.limit is None else float(trial.limit[i + 1])
        gap = float(t[i + 1] - t[i])
        k = slice(i + 1, j + 1)
        found.append(
            MoveData(
                trial.name,
                int(i),
                t[k] - t[i],
                p[k],
                trial.current[k],
                float(trial.setpoint[i]),
                float(trial.setpoint[i + 1]),
                limit,
                np.array([0.5 * gap, rest[0], speed, held.mean()]),
                np.array([max(gap / np.sqrt(12), 5e-3), rest[1], speed_sd, sigma[1] / np.sqrt(len(held))]),
                rest[2],
                speed,
                rest[3],
            )
        )
    return tuple(found)


def speed_levels(moves: Sequence[MoveData], own: Array) -> dict[float, tuple[float, float]]:
    """What each logged speed stands for [share of full], and its standard deviation, from what a fit found for every
    move, own (moves, 4).

    A log in whole units rounds a speed alike each time, so that moves tell it together; long ones tell more, as the
    square of a duration times its samples.
    """
    found = {}
    for logged in {m.logged for m in moves}:
        k = [i for i, m in enumerate(moves) if m.logged == logged]
        weight = np.array([abs(moves[i].target - moves[i].origin) ** 3 for i in k])
        mean = float(weight @ own[k, 2] / weight.sum())
        sd = float(np.sqrt(weight**2 @ (own[k, 2] - mean) ** 2 * len(k) / max(len(k) - 1, 1)) / weight.sum())
        known = float(min(moves[i].own_sd[2] for i in k))
        found[logged] = mean, known if len(k) == 1 else float(np.clip(sd, SURE * known, known))
    return found


def levelled(moves: Sequence[MoveData], levels: Mapping[float, tuple[float, float]]) -> tuple[MoveData, ...]:
    """The moves with what is known of their speeds: logged speed -> share of full and its deviation; as logged where it
    is not among them."""
    out = []
    for m in moves:
        mean, sd = levels.get(m.logged, (m.own[2], m.own_sd[2]))
        out.append(
            dataclasses.replace(
                m, own=np.array([*m.own[:2], mean, m.own[3]]), own_sd=np.array([*m.own_sd[:2], sd, m.own_sd[3]])
            )
        )
    return tuple(out)


def shortened(m: MoveData, end_s: float) -> MoveData:
    """The move's samples up to `end_s` [s]."""
    k = m.time_s <= end_s
    return dataclasses.replace(m, time_s=m.time_s[k], position=m.position[k], current=m.current[k])


def without_rest(m: MoveData) -> MoveData:
    """The move until AFTER_S after it is within SETTLED of where it ends."""
    far = np.flatnonzero(np.abs(m.position - m.position[-3:].mean()) > SETTLED)
    return shortened(m, float(m.time_s[far[-1]]) + AFTER_S) if len(far) else m


def _calm(m: MoveData) -> tuple[float, float, float]:
    t, p = m.time_s, m.position
    end = float(p[-3:].mean())
    away = max(SETTLED, AWAY * abs(end - float(p[0])))
    gone, far = np.flatnonzero(np.abs(p - p[0]) > away), np.flatnonzero(np.abs(p - end) > away)
    if len(gone) == 0 or len(far) == 0:
        return NEVER, NEVER, NEVER
    stopped = float(t[far[-1]])
    rests = len(p) > far[-1] + 4
    return (
        float(max(t[gone[0]], m.own[0])) + STARTS_S,
        (stopped - STOPS_S if rests else NEVER),
        (stopped + RESTS_S if rests else NEVER),
    )


def _rest(t: Array, p: Array, sigma: float) -> tuple[float, float, float, tuple[float, float]] | None:
    """Position [%] at the last of samples before a command, its deviation [%], the velocity [%/s] of a steady creep,
    and the slope with its deviation.

    0 where none is told from rest; None where the drive is not settled.
    """
    n = len(p)
    if n < 4 or np.ptp(p) > SETTLED + 5 * sigma:
        return None
    x = t - t.mean()
    slope, slope_sd = float(x @ p / (x @ x)), sigma / float(np.sqrt(x @ x))
    creeps = abs(slope) > 4 * slope_sd
    if np.sqrt(np.mean((p - p.mean() - slope * x) ** 2)) > 2 * sigma:
        return None
    return float(p.mean() + slope * x[-1]), 2 * sigma / np.sqrt(n), slope if creeps else 0.0, (slope, slope_sd)
