"""Current station: the balance of each motor of a hand, from the log alone."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState, sample_interval
from ...effects.current_channel_delay import EFFECT as DELAY
from ...effects.path import from_rest, runs
from ...session import Log, Session, Trial
from ..name.bristles import bristled
from .doubt import LEAST_GIVE, LONGER, with_doubt
from .measurement import coefficients, extremes, frozen, is_measured
from .motion import Motion, estimate_motion, standing_at_turns, sure_acceleration
from .simulated import SimulatedDrive, with_simulated

Array = NDArray[np.float64]

KINDS = ("flexion", "excitation")
LEAST_ROWS = 50  # of a recording: fewer, and no motion is read from it
GIVE_LEAST, GIVE_MOST = 0.02, 1.2  # [%] of the declared Coulomb friction's bristles; beyond, give is presliding
LENGTHS = np.geomspace(GIVE_LEAST, GIVE_MOST, 12).tolist()
# [%] any drive's friction may take to turn over where one of the session's takes more than the second and none takes
# less than the third (healthy ones of a hand, as measured: 0.5 to 0.6)
GIVE_USUAL, GIVE_SOFT, GIVE_SHARP = 0.65, 0.3, 0.1
SETTLE_SAMPLES = (14, 13)  # after a start and before a stop: where acceleration is smeared by the kernel

UNFOLLOWED = 0.25  # of the range: commands that end farther than this from where the motion does are not its own
ROUNDS = 4  # in which the effort required and its square settle
DEAD = 0.2  # of the time in motion of a recording: longer no reading that comes late stands still on end
LATE_SAMPLES = 3  # by which a current may be late, at most
# times smaller must the misfit be beside a late current: of 600 drives it is so where the current is late or the drive
# gives long before it slides, and smaller by 1.046 once elsewhere
LATE_BETTER = 1.05
SETTLE_TRAVEL = 4.0  # [%] some six bristle lengths of a healthy drive


def drive_trials(session: Session) -> dict[str, list[Trial]]:
    """Actuator -> its flexion and excitation trials with a log, in the order of the manifest."""
    out: dict[str, list[Trial]] = {}
    for trial in session.trials:
        if trial.kind in KINDS and trial.log_path is not None and trial.finger is not None:
            actuator = session.finger(trial.finger).actuator
            if actuator is not None:
                out.setdefault(actuator, []).append(trial)
    return out


def count_range(logs: list[Log]) -> tuple[float, float]:
    """Counts at 0 % and 100 % of the range: the commanded extremes, else the recorded ones, where the commands are not
    those that the motion follows (lost, constant, in another unit)."""
    low, high = extremes(logs, "position")
    if all("setpoint" in log.columns for log in logs):
        told_low, told_high = extremes(logs, "setpoint")
        # a glitch reaches farther
        reached = np.nanpercentile(np.concatenate([log.columns["position"] for log in logs]), [1, 99])
        if max(abs(told_low - reached[0]), abs(told_high - reached[1])) < UNFOLLOWED * (reached[1] - reached[0]):
            low, high = told_low, told_high
    return low, max(high, low + 1e-9)


def drive_states(
    session: Session,
    corrections: Mapping[str, Callable[[Array], Array]] | None = None,
    unread: Collection[str] = (),
    simulated: Mapping[str, SimulatedDrive] | None = None,
) -> dict[str, tuple[DriveState, ...]]:
    """DriveStates of every actuator, [%] of its range and raw current; with the bristle length of its friction.

    corrections: actuator -> function that takes its position [%] to what it should have read. unread: actuators to
    leave out. simulated:
    drives whose simulated motion stands for the recorded one where that is not corrected and nothing is missing. A
    current that measures nothing says nothing of friction either: other drives are not compared with it.
    """
    raw = {a: [(t, t.log()) for t in trials] for a, trials in drive_trials(session).items() if a not in unread}
    trusted = {a: d for a, d in (simulated or {}).items() if a not in (corrections or {})}
    prepared = {a: _prepare(a, entries, (corrections or {}).get(a), trusted.get(a)) for a, entries in raw.items()}
    prepared = {a: tuple(states) for a, states in prepared.items() if states}
    return with_gives(prepared, [a for a, states in prepared.items() if is_measured(states)])


def with_gives(
    drives: Mapping[str, tuple[DriveState, ...]],
    trusted: Collection[str],
    late_s: Mapping[str, float] = MappingProxyType({}),
) -> dict[str, tuple[DriveState, ...]]:
    """The states with each drive's bristle length, and what the `trusted` ones say that any drive of the session may
    have: that is the length of another, unless its own is told beside a late current. late_s: of those of which it is
    known how late [s]."""
    own, granted = gives({a: states for a, states in drives.items() if a in trusted})
    others = {a: states for a, states in drives.items() if a not in own}
    own |= {a: Give(min(_beside_late(states, late_s.get(a)), granted), granted) for a, states in others.items()}
    return {
        a: with_required(with_doubt(tuple(with_coulomb(s, own[a].length, own[a].granted) for s in states)))
        for a, states in drives.items()
    }


def _prepare(
    actuator: str,
    entries: list[tuple[Trial, Log]],
    correct: Callable[[Array], Array] | None = None,
    simulated: SimulatedDrive | None = None,
) -> list[DriveState]:
    low, high = count_range([log for _, log in entries])
    history: list[tuple[float, float]] = []  # of all bouts before a trial: time in motion, rest until the next one [s]
    end = None
    first = min(float(log.time_s[0]) for _, log in entries)
    states = []
    for index, (trial, log) in enumerate(entries):
        counts, current = log.column("position"), log.column("current")
        seen = _readable(log)
        if seen.sum() < LEAST_ROWS:
            continue
        time_s, position = log.time_s[seen], 100 * (counts[seen] - low) / (high - low)
        believed = position if correct is None else correct(position)
        motion = standing_at_turns(estimate_motion(time_s, believed, uneven=log.uneven), time_s)
        if simulated is not None and trial.name in simulated.motions:
            motion = with_simulated(motion, time_s, simulated.motions[trial.name]) or motion
        extra = {
            name: _held(log.columns[name])[seen]
            for name in ("setpoint", "speed", "current_limit", "temperature")
            if name in log.columns and np.isfinite(log.columns[name]).any()
        }
        extra["elapsed"] = time_s - first
        if end is not None:
            history[-1] = (history[-1][0], history[-1][1] + max(float(time_s[0]) - end, 0.0))
        extra["history"] = np.array(history).reshape(-1, 2)
        extra["moving"] = motion.moving.astype(float)
        history += bouts(time_s, motion.moving)
        end = float(time_s[-1])
        extra["trial_index"] = np.full(len(time_s), float(index))
        extra["validation_index"] = np.full(len(time_s), float(sum(t.validate for t, _ in entries[:index])))
        still = frozen(current[seen], motion.moving)
        effort = np.where(motion.moving & ~still, current[seen], np.nan)
        extra["frozen"] = still.astype(float)
        extra["bandwidth_s"] = np.full(len(time_s), motion.bandwidth_s)
        extra["position_noise"] = np.full(len(time_s), motion.noise)
        extra["steady"] = steady(time_s, motion).astype(float)
        extra["smoothed"] = np.full(len(time_s), float(motion.smoothed))
        declared = np.stack(
            [
                sure_acceleration(motion),
                motion.velocity,
                np.sign(motion.velocity),
                motion.position,
                np.ones(len(time_s)),
            ],
            axis=-1,
        )
        states.append(
            DriveState(
                trial.name,
                actuator,
                time_s,
                motion.position,
                motion.velocity,
                motion.acceleration,
                effort,
                declared,
                extra=extra,
                validate=trial.validate,
                declared_names=("inertia", "viscous", "coulomb", "spring", "preload"),
            )
        )
    total = max((float(s.elapsed_s[-1]) for s in states), default=0.0)
    return [replace(s, extra={**s.extra, "session_s": np.full(len(s.time_s), total)}) for s in states]


def _readable(log: Log) -> NDArray[np.bool_]:
    """Rows (n,) that hold a position at a time after that of the row before."""
    return np.isfinite(log.column("position")) & np.isfinite(log.time_s) & np.r_[True, np.diff(log.time_s) > 0]


def too_short(session: Session) -> list[str]:
    """What is to be said of recordings that are left out, for they have too few rows to read a motion from."""
    rows = {t.name: int(_readable(t.log()).sum()) for trials in drive_trials(session).values() for t in trials}
    return [
        f"{name}: {n} rows with a position; {LEAST_ROWS} are needed to read a motion, so its current was left out"
        for name, n in rows.items()
        if n < LEAST_ROWS
    ]


def frozen_share(states: Sequence[DriveState]) -> float:
    """Share of the time in motion in which a drive's current stands still."""
    moving, still = (np.concatenate([s.extra[name] for s in states]) > 0 for name in ("moving", "frozen"))
    return float(np.mean(still[moving])) if moving.any() else 0.0


def dead_in(states: Sequence[DriveState]) -> tuple[str, ...]:
    """Recordings of a drive whose current stands still on end for so much of the motion that it is dead there, and not
    read late now and then."""
    out = []
    for state in states:
        moving = state.extra["moving"] > 0
        longest = max((int(np.sum(moving[a:b])) for a, b in runs(state.extra["frozen"] > 0)), default=0)
        if longest > DEAD * np.sum(moving):
            out.append(state.trial)
    return tuple(out)


def stand_still(states: Sequence[DriveState]) -> list[str]:
    """What is to be said of currents that stand still while their drive moves."""
    out = []
    for state in states:
        whiles = runs(state.extra["frozen"] > 0)
        if whiles:
            longest = max(float(state.time_s[b - 1] - state.time_s[a]) for a, b in whiles)
            times = "once" if len(whiles) == 1 else f"{len(whiles)} times"
            out.append(
                f"{state.trial}: the current stands still {times} while the motor moves, for up to {longest:.2g} s: those "
                "readings were left out"
            )
    return out


def _held(values: Array) -> Array:
    """A column (n,) in which a lost sample holds the value before it, or the first one."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    return values[np.where(last < 0, int(np.argmax(np.isfinite(values))), last)]


def bouts(time_s: Array, moving: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Time in motion and at rest after it [s] of each bout of a recording, in order; a rest before the first counts as
    a bout of no motion. time_s, moving: (n,)."""
    step = np.diff(time_s, prepend=time_s[0])
    begin = np.unique(np.r_[0, np.flatnonzero(np.diff(moving.astype(int)) > 0) + 1])
    return [
        (float(step[a:b][moving[a:b]].sum()), float(step[a:b][~moving[a:b]].sum()))
        for a, b in zip(begin, np.r_[begin[1:], len(time_s)], strict=True)
    ]


def opposes(states: tuple[DriveState, ...]) -> bool:
    """Whether friction would drive the motion: the current and the position of a drive have opposite signs. Of steady
    samples, by ten standard errors."""
    use = [s.extra["steady"] > 0 for s in states]
    effort = np.concatenate([s.effort[u] for s, u in zip(states, use, strict=True)])
    columns = np.concatenate([s.declared[u] for s, u in zip(states, use, strict=True)])[np.isfinite(effort)]
    effort = effort[np.isfinite(effort)]
    if len(effort) < 50:
        return False
    beta = coefficients(columns, effort)
    scale = np.linalg.norm(columns, axis=0) + 1e-12
    spread = np.linalg.pinv((columns / scale).T @ (columns / scale))[2, 2] * np.var(effort - columns @ beta)
    return bool(beta[2] < -10 * np.sqrt(spread) / scale[2])


def steady(time_s: Array, motion: Motion) -> NDArray[np.bool_]:
    """Samples (n,) in motion and away from starts and stops: the state estimate is not smeared and, after a travel of
    several bristle lengths, friction has turned over."""
    step = float(np.median(np.diff(time_s)))
    after, before = SETTLE_SAMPLES
    settled = motion.moving
    if motion.smoothed:
        settled = settled & (motion.since_start_s > after * step) & (motion.until_stop_s > before * step)
    return settled & (from_rest(motion.position, motion.moving) > SETTLE_TRAVEL)


def with_coulomb(state: DriveState, give: float, granted: float) -> DriveState:
    """The state with a Dahl column of that bristle length [%] as its Coulomb friction. granted: the longest that is no
    presliding."""
    state = bristled(state, give)
    return replace(state, extra={**state.extra, "granted": np.full(len(state.time_s), granted)})


def with_required(states: tuple[DriveState, ...]) -> tuple[DriveState, ...]:
    """The states with the effort "required" (n,) by the declared model fitted to all of them, and by what a drive that
    sags asks for beyond: the square of that effort, as far as it helps."""
    seen = [np.isfinite(s.effort) for s in states]
    ends = np.cumsum([len(s.effort) for s in states])[:-1]
    declared, told = np.concatenate([s.declared for s in states]), np.concatenate(seen)
    effort = np.concatenate([s.effort for s in states])[told]
    required = declared @ coefficients(declared[told], effort)
    for _ in range(ROUNDS):
        columns = np.column_stack([declared, required * np.abs(required)])
        beta = coefficients(columns[told], effort)
        if beta[-1] <= 0:
            break
        required = columns @ beta
    parts = np.split(required, ends)
    return tuple(replace(s, extra={**s.extra, "required": own}) for s, own in zip(states, parts, strict=True))


@dataclass(frozen=True)
class Give:
    """length: of a drive's bristles [%]. granted: the longest that is no effect [%]."""

    length: float
    granted: float


def gives(prepared: Mapping[str, Sequence[DriveState]]) -> tuple[dict[str, Give], float]:
    """Bristles of each drive's declared Coulomb friction, and what any other drive of the session is granted.

    Coulomb friction turns over within a small distance in any drive; the drive that gives least shows how small (of three
    and more the next one: the odd one out is no measure for the others): bristles may be as long as its own, or as
    stiff, so that they are as much longer as friction is larger (Canudas de Wit 1995).
    What a drive gives clearly beyond that is presliding, an effect.
    """
    fits = {a: min((*_misfits(states, x)[0], x) for x in LENGTHS) for a, states in prepared.items()}
    best = {a: (length, max(friction, 0.0)) for a, (_, friction, length) in fits.items()}
    lengths = [length for length, _ in best.values()]
    least = _least(lengths, GIVE_LEAST)
    soft = max(lengths, default=0.0) > GIVE_SOFT and min(lengths) > GIVE_SHARP
    usual = GIVE_USUAL if soft else LEAST_GIVE
    softness = _least([length / f for length, f in best.values() if f > 0], 0.0)  # of the stiffest drive [%/raw]

    def granted(friction: float) -> float:
        return max(LONGER * max(least, softness * friction), usual)

    return {a: Give(min(x, granted(f)), granted(f)) for a, (x, f) in best.items()}, granted(0.0)


def _least(values: Sequence[float], none: float) -> float:
    """The least of one or two values, the next of more."""
    return sorted(values)[len(values) > 2] if values else none


def _beside_late(states: Sequence[DriveState], late_s: float | None = None) -> float:
    """Likeliest length [%] of a drive's bristles beside a current that late [s]; where it is not known how late, infinite
    unless beside a late one it is plainly likelier than beside a prompt one."""
    if late_s is not None:
        return min(LENGTHS, key=lambda x: _misfits(states, x, (late_s / sample_interval(states),))[0])
    fits = [(_misfits(states, x, range(LATE_SAMPLES + 1)), x) for x in LENGTHS]
    prompt = min(error for ((error, _), *_), _ in fits)
    late, length = min((min(rest)[0], x) for (_, *rest), x in fits)
    return length if prompt > LATE_BETTER * late else float("inf")


def _misfits(states: Sequence[DriveState], give: float, delays: Iterable[float] = (0,)) -> list[tuple[float, float]]:
    """Squared error of the declared balance with bristles of that length [%], and its Coulomb friction, with a current
    that is late by each of `delays` [sample intervals]."""
    bent = [bristled(state, give) for state in states]
    effort = np.concatenate([s.effort for s in bent])
    seen, step = np.isfinite(effort), sample_interval(bent)
    out = []
    for samples in delays:
        late = {"form": 0.0, "delay": samples * step}
        declared = np.concatenate([DELAY.warp(s, s.declared, late) if samples else s.declared for s in bent])[seen]
        found = coefficients(declared, effort[seen])
        out.append((float(np.sum((effort[seen] - declared @ found) ** 2)), float(found[2])))
    return out
