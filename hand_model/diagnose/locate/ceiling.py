"""Ceiling of a drive: its controller asks for more current than flows.

Where a controller is known, what it asks for follows from what it sees: gain times the way and damping times the speed
by which the drive is behind the reference (a disturbance observer reads the load so: Ohnishi 1996). No model of the
drive is in it: whatever friction or load there is, the controller has to bring it up, and where the current stays
behind, something limits it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..reduction import reduction

if TYPE_CHECKING:
    from ...identify.motor import MotorFit
    from ...identify.motor.moves import MoveData
    from ...identify.motor.recording import MotorTrial

Array = NDArray[np.float64]

MOVES = 0.03  # of the fastest speed: slower, a drive may rest
INSTANT = 2  # column of what a command's instant changes
TICK_S = 4e-3  # to which a reference's changes, and the drive's beside them, are known in time
CHANGE = 1e-3  # of a parameter, by which the reference's derivatives are taken
LOUDER = 1.1  # times the noise of both readings: what they differ by at most, where nothing but a limit is between them
COMMANDED = 0.9  # of a limit that the log tells
FEWEST = 200  # samples in motion
WRONG = 4.0  # standard deviations, from which a row goes wrong
GLITCHES = 5e-4  # share of rows that may: where more flows than a limit lets through, there is none
FREE, COLOURED = 0.8, 0.1  # of the limit, below which nothing is limited; autocorrelation of the rest there, at most
LEVELS, LEAST_QUANTILE = 24, 0.6  # limits tried, and the share of the currents that is below the lowest
PASSING = (1 / 3, 2 / 3)  # of what is beyond a limit: where that is as likely, there is none
ROUNDS = 3  # of telling apart what is limited and what is not
FINER = 5  # times the way between limits is halved
SURE = 1.92  # of log likelihood: what 95 % of chance does not bring (Wilks 1938)


@dataclass(frozen=True)
class Ceiling:
    """limit [raw]; share: of the samples in motion for which more is asked; lost: of what is
    asked, over the noise (root mean square); likelier: log likelihood that it brings. proof: error of the current
    `before` and `after`, and what else a finding's `fit` says of it."""

    limit: float
    share: float
    lost: float
    likelier: float
    proof: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """One recording simulated along its moves. kept_out: whether it is for validation. first_s: of its log [s].
    simulated, slow: (3, n) position [%] and its derivatives as simulated, and what is slow of the recorded less these."""

    trial: MotorTrial
    kept_out: bool
    first_s: float
    data: tuple[MoveData, ...]
    own: Array
    simulated: Array
    slow: Array


@dataclass(frozen=True)
class Asked:
    """Samples in motion of all recordings. sensed, asked: (n,) [raw]; columns (n, k): what parameters of the controller
    change of `asked`; speed (n,): what a move's own does; doubt (n,) [raw]: what an instant that is known to a tick
    means for it while the reference's speed changes; move (n,): numbers; kept_out (n,): of recordings for
    validation, empty where there are none."""

    sensed: Array
    asked: Array
    columns: Array
    speed: Array
    doubt: Array
    move: NDArray[np.int64]
    kept_out: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    def only(self, rows: NDArray[np.bool_]) -> Asked:
        """Some of the samples."""
        return Asked(*(getattr(self, f.name)[rows] for f in fields(self)[:-1]))


def ceiling_of(fit: MotorFit, runs: Sequence[Run], noise: float) -> Ceiling | None:
    """The limit of the current of a drive whose reference is known beforehand; None where what its controller asks and
    the current differ by more than a limit and noise, or where a limit that leaks is as likely.

    noise: of the current and of what is asked together [raw], white. Parameters of the controller are fitted to the
    current, and of each move its instant and its speed.
    """
    asked = _stacked([_behind_reference(fit, run) for run in runs], [run.kept_out for run in runs])
    found = None if asked is None else limit_of(asked, noise)
    if asked is None or found is None or found.likelier <= SURE:
        return found
    held = [run.trial.name for run in runs if run.kept_out]
    return replace(found, proof=foretold(asked, noise, held))


def limit_of(asked: Asked, noise: float) -> Ceiling | None:
    """The likeliest limit between what is asked and what flows; None where these differ by more than that and noise
    [raw], or samples are too few."""
    sigma, unlimited = np.hypot(noise, asked.doubt), _unlimited(asked, noise)
    if unlimited is None:
        return None
    free, sound = unlimited
    size = np.abs(free)
    levels = np.linspace(np.quantile(size, LEAST_QUANTILE), np.max(size), LEVELS + 1)[:-1]

    def fitted(passing: float) -> list[tuple[float, float, float]]:
        """Error, share beyond and limit of all limits tried, finer about the best; best first."""
        tried = [(*_limited(asked, free, sound, level, sigma, passing), level) for level in levels]
        step = float(levels[1] - levels[0])
        for _ in range(FINER):
            step /= 2
            limit = min(tried)[2]
            tried += [
                (*_limited(asked, free, sound, level, sigma, passing), level) for level in (limit - step, limit + step)
            ]
        return sorted(tried)

    tried = fitted(0.0)
    error, share, limit = tried[0]
    beyond = np.mean(np.abs(asked.sensed) > limit + WRONG * noise)
    if np.sqrt(error / len(asked.sensed)) > LOUDER or beyond > GLITCHES:
        return None
    if _coloured(asked, _corrected(asked, sound & (np.abs(free) < limit)), limit):
        return None
    likelier, lost = _told_by_limit(asked, free, _within(asked, free, sound, limit), limit, sigma)
    if likelier > SURE and min(fitted(passing)[0][0] for passing in PASSING) < error + 2 * SURE:
        return None
    return Ceiling(float(limit), share, lost, likelier)


def foretold(asked: Asked, noise: float, held_out: Sequence[str]) -> dict[str, Any]:
    """What a limit is worth on recordings kept out (of these names): error of the current [raw] as asked for, and within
    the limit that the others tell; there the controller's figures are learned where that is not reached. On all, where
    either are too few. noise: of the current and of what is asked together [raw], white."""
    for held in (asked.kept_out, np.ones(len(asked.sensed), bool)):
        if held.size < len(asked.sensed) or not held.any():
            continue
        learned = limit_of(asked if held.all() else asked.only(~held), noise)
        told = asked.only(held)
        unlimited = _unlimited(told, noise)
        if learned is None or unlimited is None:
            continue
        inside = _within(told, *unlimited, learned.limit)
        if len(inside):
            left = told.sensed - np.clip(inside, -learned.limit, learned.limit)
            floor = float(np.sqrt(np.mean(noise**2 + told.doubt**2)))
            fall = reduction([told.sensed - unlimited[0]], [left], [told.move])
            return {**fall, "noise_floor": floor, "held_out": [] if held.all() else list(held_out)}
    return {}


def _unlimited(asked: Asked, noise: float) -> tuple[Array, NDArray[np.bool_]] | None:
    """What is asked for (n,) by a controller learned from all rows but those that go wrong, and which do not; None
    where these are too few."""
    sigma, sound = np.hypot(noise, asked.doubt), np.ones(len(asked.sensed), bool)
    if len(sound) < FEWEST:
        return None
    for _ in range(ROUNDS):
        free = _corrected(asked, sound)
        sound = np.abs(asked.sensed - free) < WRONG * sigma
        if sound.sum() < FEWEST:
            return None
    return free, sound


def _told_by_limit(asked: Asked, free: Array, within: Array, limit: float, sigma: Array) -> tuple[float, float]:
    """Log likelihood that a limit brings but for the move that tells most of it (a reference that is wrong at one kink
    is no limit), and what is lost beyond it, over the noise (root mean square).

    Against the better of the controllers without a limit: that of all samples, and the one learned within the limit.
    """
    limited = _bounded((asked.sensed - np.clip(within, -limit, limit)) / sigma)
    plain = min((_bounded((asked.sensed - current) / sigma) for current in (free, within)), key=np.sum)
    told = np.bincount(asked.move, plain - limited) / 2
    total = float(told.sum())
    return total - float(max(told.max(), 0.0)), float(np.sqrt(max(2 * total, 0.0) / len(plain)))


def _limited(
    asked: Asked, start: Array, sound: NDArray[np.bool_], limit: float, sigma: Array, passing: float
) -> tuple[float, float]:
    """Weighted squared error with a limit beyond which a share is still `passing`, and the share of samples beyond it:
    the controller's parameters are learned where it is not reached, from rows that are `sound`."""
    current = _within(asked, start, sound, limit)
    if not len(current):
        return np.inf, 1.0
    within_limit = np.clip(current, -limit, limit)
    flows = within_limit + passing * (current - within_limit)
    error = _squares((asked.sensed - flows) / sigma)
    return error, float(np.mean(np.abs(current) > limit))


def _within(asked: Asked, start: Array, sound: NDArray[np.bool_], limit: float) -> Array:
    """What is asked for (n,) by a controller learned from the rows within a limit; (0,) where these are too few."""
    current = start
    for _ in range(ROUNDS):
        within = sound & (np.abs(current) < limit)
        if within.sum() < FEWEST:
            return start[:0]
        current = _corrected(asked, within)
    return current


def _coloured(asked: Asked, current: Array, limit: float) -> bool:
    """Whether what is asked and what flows differ by more than white noise where no limit is near: another controller
    asks then."""
    rest, near = asked.sensed - current, (asked.move[1:] == asked.move[:-1]) & (np.abs(current[1:]) < FREE * limit)
    bound = WRONG * np.median(np.abs(rest)) / 0.6745
    rest = np.clip(rest, -bound, bound)
    if near.sum() < FEWEST:
        return True
    return float(np.mean((rest[1:] * rest[:-1])[near])) > COLOURED * float(np.var(rest[1:][near]))


def _squares(rest: Array) -> float:
    """Sum of squares of what is left over its deviation (n,), as bounded."""
    return float(np.sum(_bounded(rest)))


def _bounded(rest: Array) -> Array:
    """Squares (n,) of what is left over its deviation, of rows that go wrong bounded: one of them must not be what a
    limit explains."""
    return np.minimum(rest**2, WRONG**2)


def _corrected(asked: Asked, use: NDArray[np.bool_]) -> Array:
    """What is asked for (n,), with the controller's parameters as the current has them in the samples `use`."""
    apart, scale = asked.sensed - asked.asked, np.linalg.norm(asked.columns[use], axis=0) + 1e-300
    rest = apart - asked.columns @ (np.linalg.lstsq((asked.columns / scale)[use], apart[use], rcond=1e-6)[0] / scale)
    rest = rest - _of_each(rest, asked.columns[:, INSTANT], asked.move, use)
    return asked.sensed - (rest - _of_each(rest, asked.speed, asked.move, use))


def _of_each(rest: Array, column: Array, move: NDArray[np.int64], use: NDArray[np.bool_]) -> Array:
    """What a column (n,) of its own for each move takes of the rest (n,)."""
    size = np.maximum(np.bincount(move, column**2 * use), 1e-12)
    return (np.bincount(move, rest * column * use) / size)[move] * column


def _stacked(parts: Sequence[tuple[Mapping[str, Array], Array]], kept_out: Sequence[bool]) -> Asked | None:
    """All recordings' samples in motion of which everything is known; a speed that was told is a column of its own. None where they
    are too few."""
    joined = {name: np.concatenate([p[name] for p, _ in parts]) for name in parts[0][0]}
    record = np.concatenate([np.full(len(p["sensed"]), i) for i, (p, _) in enumerate(parts)])
    columns = np.concatenate([c for _, c in parts])
    known = np.isfinite(columns).all(1) & np.all([np.isfinite(x) for x in joined.values()], axis=0)
    speed = np.abs(joined["velocity"])
    use = known & (speed > MOVES * np.max(speed, where=known, initial=0.0))
    if use.sum() < FEWEST:
        return None
    told = np.stack([joined["speed"] * (joined["logged"] == x) for x in np.unique(joined["logged"][use])], axis=1)
    _, move = np.unique(np.stack([record, joined["move"]])[:, use], axis=1, return_inverse=True)
    return Asked(
        joined["sensed"][use],
        joined["asked"][use],
        np.c_[columns, told, *_bent(joined["asked"])][use],
        joined["speed"][use],
        joined["doubt"][use],
        move.ravel(),
        np.array(kept_out)[record[use]],
    )


def _bent(asked: Array) -> tuple[Array, Array]:
    """Squares (n,) of what is asked for [100 raw^2], without and with its sign: what a controller that is slightly
    another asks for otherwise, and no limit."""
    return 1e-2 * asked**2, 1e-2 * asked * np.abs(asked)


def _behind_reference(fit: MotorFit, run: Run) -> tuple[dict[str, Array], Array]:
    """What the controller asks along one recording, and what changes it (n, 7): the simulated current, and what gain and
    damping make of the recorded motion's being elsewhere; nan between moves."""
    from ...identify.motor.residuals import simulate_moves

    found, trial = fit.output_error, run.trial
    q, n = found.values, len(trial.time_s)
    asked, speed, logged, move, doubt = np.full((5, n), np.nan)
    columns = np.full((n, 7), np.nan)
    damping = q["damping"] - q["gain"] * q["delay"]
    velocity = run.simulated[1] + run.slow[1]
    for j, (m, y) in enumerate(zip(run.data, simulate_moves(run.data, q, run.own, found.controller), strict=True)):
        rows = slice(m.index + 1, m.index + 1 + len(m.time_s))
        commanded = np.abs(y[:, 1]) > COMMANDED * m.limit  # a limit that was asked for is none of the drive's
        asked[rows], move[rows], logged[rows] = np.where(commanded, np.nan, y[:, 1]), j, m.logged
        changed = _derivatives(m, run.own[j], q, trial.position[rows], velocity[rows])
        *controller, speed[rows] = changed
        columns[rows] = np.stack(controller, axis=1)
        doubt[rows] = q["damping"] * TICK_S * _beside(np.abs(np.gradient(columns[rows, INSTANT], m.time_s)))
    asked -= q["gain"] * (trial.position - run.simulated[0]) + damping * run.slow[1]
    parts = {"sensed": trial.current, "asked": asked, "speed": speed, "logged": logged, "move": move, "doubt": doubt}
    return {**parts, "velocity": velocity}, columns


def _beside(values: Array) -> Array:
    """The largest of each value (n,) and its neighbours."""
    return np.max(np.stack([values, np.r_[values[1:], values[-1]], np.r_[values[0], values[:-1]]]), axis=0)


def _derivatives(m: MoveData, own: Array, q: Mapping[str, float], position: Array, velocity: Array) -> Iterator[Array]:
    """Of what is asked in one move by gain, damping, the instant, a zero, speed, rise and fall, and by the move's own
    speed, (n,) each."""
    r, w = _reference(m, own, q)
    base = q["gain"] * r + q["damping"] * w
    yield from (r - position, w - velocity, w, np.ones(len(r)))
    others = [({**q, name: q[name] * (1 + CHANGE)}, 1.0) for name in ("speed_full", "rise", "fall")]
    for values, faster in (*others, (q, 1 + CHANGE)):
        other_r, other_w = _reference(m, own, values, faster)
        yield (q["gain"] * other_r + q["damping"] * other_w - base) / CHANGE


def _reference(m: MoveData, own: Array, values: Mapping[str, float], faster: float = 1.0) -> tuple[Array, Array]:
    from ...identify.motor.batch import Moves
    from ...identify.motor.profile import profile

    one = np.ones(1)
    moves = Moves(own[:1], m.origin * one, m.target * one, faster * own[2:3], one * m.limit, one * own[1], 0 * one, one)
    r, w = profile(m.time_s, moves, {k: v * one for k, v in values.items()})
    return r[:, 0], w[:, 0]
