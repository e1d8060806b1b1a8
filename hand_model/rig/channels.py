"""Is a channel what it is said to be? Asked before anything is fitted to it.

A torque that is a few sinusoids of time, a static function of the position, or another channel over again is a
command; one that does not move is dead; one that stands on its limits clips; one without the sign of the motion it
drives is unsigned.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .balance import Rows
from .clipping import limits
from .commanded import SAME, controller_left, copied, copy_left, linear, rms, sinusoids_left, static_left
from .declared import DeclaredFit
from .model import RigModel, RigTrial
from .planned import planned
from .states import fill_gaps
from .unloaded import left_beside_declared, unloaded

Array = NDArray[np.float64]
STRANGE = 0.7  # share of an effort that may stay unexplained before it is said to explain nothing
UNSIGNED = "has no sign: it follows the size of the expected effort"
BOTH_LIMITS, ONE_LIMIT = "stands on its limits, the same both ways", "stands on a limit, one way alone"
REPEATS = "repeats the channel"
DEAD = "never changes: dead"
SINUSOID = "is a sinusoid of time"
LEAST_TURNS = 4  # changes of sign that must be seen before a channel is said to have none
EXACTLY = 0.5  # of SAME: the law of a controller tells a true torque as closely as its sensor is quiet
APART_FROM_MOTION = 0.25  # of the rms of an effort, at least, the declared model leaves of one that is not given
APART = 0.1  # of SAME: a copy in few recordings among others that are none is plainly one


@dataclass(frozen=True)
class ChannelIssue:
    """What is wrong with a channel. kind: an effect name of the findings; refuse: not to be fitted; share: how closely
    (residual over rms, or share of samples)."""

    kind: str
    channel: str
    joint: str | None
    trials: tuple[str, ...]
    reason: str
    refuse: bool
    share: float


def check_channels(rig: RigModel) -> tuple[ChannelIssue, ...]:
    """All issues with the effort, voltage and position channels of a rig."""
    issues: list[ChannelIssue] = []
    column = {(kind, name, attribute): c for c, (kind, name, attribute) in rig.quantity.items()}
    for drive in rig.drives:
        channel = column.get(("actuator", drive.name, "force")) or column.get(("actuator", drive.name, "ctrl"))
        if channel is None:
            continue
        issues += _check_effort(rig, drive.joint, channel)
    for joint in rig.joints:
        issues += _check_position(rig, joint, column.get(("joint", joint, "position"), joint))
    return tuple(issues)


def _check_effort(rig: RigModel, joint: str, channel: str) -> list[ChannelIssue]:
    found: dict[tuple[str, str], list[tuple[str, float, str]]] = {}
    usable = [t for t in rig.trials if joint in t.live and (joint in t.effort or joint in t.voltage)]
    for trial in usable:
        raw = trial.effort.get(joint, trial.voltage.get(joint))
        values = fill_gaps(trial.time_s, raw)
        if np.ptp(values) <= 1e-9 * (np.abs(values).max() + 1e-12):
            if np.ptp(trial.position[joint]) > 0:
                found.setdefault(("command_as_measurement", DEAD), []).append((trial.name, 0.0, DEAD))
            continue
        measured = joint in trial.effort
        for kind, share, reason in _looks(trial, joint, values, measured):
            found.setdefault((kind, reason), []).append((trial.name, share, reason))
    ends = [("current_saturation", reason) for reason in (BOTH_LIMITS, ONE_LIMIT)]
    if all(e in found for e in ends):  # which of its limits a recording comes to is not the channel's
        found[ends[0]] += found.pop(ends[1])
    return _gather(rig, joint, channel, found, len(usable))


def _looks(trial: RigTrial, joint: str, values: Array, measured: bool) -> list[tuple[str, float, str]]:
    out: list[tuple[str, float, str]] = []
    if not measured:  # a control that stands on its limits is what was put in
        return out
    low, high = limits(trial, joint)
    if np.isfinite([low, high]).any():
        both = np.isfinite([low, high]).all()
        share = float(np.mean((values == low) | (values == high)))
        out.append(("current_saturation", share, BOTH_LIMITS if both else ONE_LIMIT))
    share = sinusoids_left(trial.time_s, values)
    if share < SAME and not linear(trial, joint, values):
        out.append(("command_as_measurement", share, SINUSOID))
    share = static_left(trial, joint, values)
    if share < SAME:
        out.append(("command_as_measurement", share, "is a static function of the position"))
    for name, other in trial.extra.items():
        share, late = copied(values, fill_gaps(trial.time_s, other))
        if share < SAME:
            when = f", {late} sample{'s' if late > 1 else ''} late" if late else ""
            out.append(("command_as_measurement", share, f'{REPEATS} "{name}"{when}'))
    return out


def _gather(rig: RigModel, joint: str, channel: str, found: dict, usable: int) -> list[ChannelIssue]:
    """One issue per kind and reason; a command in half of the recordings or more is one in all, by what most of them
    show: the column is the same. A sinusoid in fewer is what a joint that swings so takes."""
    out = []
    commands = {key: hits for key, hits in found.items() if key[0] == "command_as_measurement"}
    flagged = {n for hits in commands.values() for n, _, _ in hits}
    whole = usable > 0 and len(flagged) >= 0.5 * usable
    plainest = max(commands, key=lambda key: len(commands[key]), default=None)
    for (kind, reason), hits in found.items():
        if whole and (kind, reason) in commands and (kind, reason) != plainest:
            continue
        if reason == SINUSOID and not whole or kind == "current_saturation" and whole:
            continue  # what is asked for may have limits
        if reason.startswith(REPEATS) and not whole and max(s for _, s, _ in hits) > APART * SAME:
            continue  # in most recordings it differs from its command, and in these not by much less
        trials = tuple(dict.fromkeys(n for n, _, _ in hits))
        if kind == "command_as_measurement" and whole:
            trials = tuple(t.name for t in rig.trials)
        share = float(np.median([s for _, s, _ in hits]))
        refuse = kind == "command_as_measurement"
        closely = "" if reason == DEAD else f" (to {100 * share:.2g} %)"
        out.append(ChannelIssue(kind, channel, joint, trials, f"{channel} {reason}{closely}", refuse, share))
    return out


def check_balance(rig: RigModel, fit: DeclaredFit) -> tuple[ChannelIssue, ...]:
    """Issues that only the balance shows: an unsigned effort, a computed one, one that explains nothing of the
    motion."""
    force, told = (
        {name: c for c, (kind, name, attribute) in rig.quantity.items() if kind == "actuator" and attribute == a}
        for a in ("force", "ctrl")
    )
    start = np.array([c.value for c in fit.columns])
    live = {(t.name, j) for t in rig.trials for j in t.live}
    trials = {t.name: t for t in rig.trials}
    looks: list[tuple[str, Rows, str, float]] = []
    for row in fit.rows:
        drive = rig.drive(row.joint)
        name = (
            None if drive is None or (row.trial, row.joint) not in live else force.get(drive.name, told.get(drive.name))
        )
        if name is None or row.moving.sum() < 30:
            continue
        if not {row.joint} & {*trials[row.trial].effort, *trials[row.trial].voltage}:
            continue  # a servo's effort, reckoned from its target, is no channel
        y, x = row.effort[row.moving], row.columns[row.moving]
        one_sided = np.any(trials[row.trial].clipped.get(row.joint, False))  # of what is left, not of what was measured
        if not one_sided and (share := _unsigned(trials[row.trial], row, start)) is not None:
            looks.append((name, row, UNSIGNED, share))
        elif drive.name not in force:  # what was put in may be any function, and need not explain anything
            continue
        elif (share := _static(row, x, start)) is not None:
            looks.append(
                (
                    name,
                    row,
                    "is a static function of the position, without the friction and inertia of the motion",
                    share,
                )
            )
        elif rms(y) > fit.scale[row.joint] and _stranger(fit, row) and (share := _own_fit(fit, row)) > STRANGE:
            looks.append((name, row, "explains nothing of the motion, though it does in other recordings", share))
    channels = {r.joint: force[d.name] for r in fit.rows if (d := rig.drive(r.joint)) and d.name in force}
    looks += _asked_for(trials, fit, channels)
    looks += _planned(rig, fit, channels)
    looks += _unloaded(trials, fit, channels)
    lacking = {row.joint: (name, share) for name, row, reason, share in looks if reason == UNSIGNED}
    known = {(row.trial, row.joint) for _, row, _, _ in looks}
    # A column that has no sign has none in recordings either whose efforts all go one way.
    looks += [
        (lacking[r.joint][0], r, UNSIGNED, lacking[r.joint][1])
        for r in fit.rows
        if r.joint in lacking and (r.trial, r.joint) in live - known
    ]
    out = []
    for name, joint, reason in dict.fromkeys((name, row.joint, reason) for name, row, reason, _ in looks):
        hits = [(row.trial, share) for n, row, r, share in looks if (n, row.joint, r) == (name, joint, reason)]
        out.append(
            ChannelIssue(
                "command_as_measurement",
                name,
                joint,
                tuple(t for t, _ in hits),
                f"{name} {reason}",
                True,
                float(np.median([share for _, share in hits])),
            )
        )
    return tuple(out)


def _asked_for(
    trials: Mapping[str, RigTrial], fit: DeclaredFit, channels: Mapping[str, str]
) -> list[tuple[str, Rows, str, float]]:
    """Efforts (channels: joint -> column) that in most recordings are what a controller asks for, and that the motion
    does not explain: of a drive that gives it a controller's law is as true, and of one that does not it is all there
    is."""
    out = []
    for joint, name in channels.items():
        rows = [r for r in fit.rows if r.joint == joint and joint in trials[r.trial].effort]
        told = [(r, controller_left(trials[r.trial], joint)) for r in rows]
        strange = [fit.quality[r.trial, joint] > APART_FROM_MOTION and share < EXACTLY * SAME for r, share in told]
        if np.mean(strange or [False]) > 0.5:
            out += [
                (name, row, "is what a controller asks for, and is not what the motion takes", share)
                for row, share in told
            ]
    return out


def _planned(rig: RigModel, fit: DeclaredFit, channels: Mapping[str, str]) -> list[tuple[str, Rows, str, float]]:
    """Efforts (channels: joint -> column) that in most recordings are what the declared machine would take along its
    targets, and that the motion as it was does not explain as well."""
    along, out = planned(rig, fit), []
    for joint, name in channels.items():
        rows = [r for r in fit.rows if r.joint == joint]
        shares = {r.trial: along[r.trial, joint] for r in rows if along.get((r.trial, joint), 1.0) < EXACTLY * SAME}
        if len(shares) > 0.5 * len(rows):
            typical = float(np.median([*shares.values()]))
            reason = "is what the planned motion would take, and is not what the motion takes"
            out += [(name, row, reason, shares.get(row.trial, typical)) for row in rows]
    return out


def _unloaded(
    trials: Mapping[str, RigTrial], fit: DeclaredFit, channels: Mapping[str, str]
) -> list[tuple[str, Rows, str, float]]:
    """Efforts (channels: joint -> column) that do not show the loads of the recordings' own bodies."""
    out = []
    for joint, name in channels.items():
        rows = [r for r in fit.rows if r.joint == joint and joint in trials[r.trial].effort]
        if rows and (share := unloaded(rows)) is not None:
            out += [
                (name, row, "does not carry the loads that the recordings are told to carry", share) for row in rows
            ]
    return out


def _unsigned(trial: RigTrial, row: Rows, start: Array) -> float | None:
    """Share of an effort without sign that the size of the one that the declared start (P,) expects leaves (moving
    samples of both), where that is far less than its value, or where the effort turns back at zero; None where it has a
    sign."""
    effort, expected = row.effort[row.moving], row.columns[row.moving] @ start
    raw = fill_gaps(trial.time_s, trial.effort.get(row.joint, trial.voltage.get(row.joint)))
    side = np.sign(effort.mean())
    if (side * effort).min() <= -0.05 * (side * effort).max() or expected.min() >= -0.3 * expected.max():
        return None
    share = copy_left(side * effort, np.abs(expected))
    lost = share < 0.5 * copy_left(effort, expected) or _turns_back_at_zero(trial.time_s, side * raw, row, start)
    return share if lost else None


def _turns_back_at_zero(time_s: Array, effort: Array, row: Rows, start: Array) -> bool:
    """Whether an effort (n,) at time_s touches zero between the strokes of the effort that the declared start (P,)
    expects, and goes up again on the same side: between the middles of one stroke and of the next it falls to a third
    of both. A force that truly reverses goes through zero; one with an offset goes from one level to another."""
    expected = np.interp(time_s, row.time_s, row.full_columns @ start - row.load_known)
    large = np.flatnonzero(np.abs(expected) > 0.5 * np.median(np.abs(expected)))
    turns = [(a + b) // 2 for a, b in pairwise(large) if expected[a] * expected[b] < 0]
    if len(turns) < LEAST_TURNS:
        return False
    strokes = list(pairwise([0, *turns, len(effort) - 1]))
    level = [np.median(effort[a : b + 1]) for a, b in strokes]
    least = [effort[(a + b) // 2 : (b + c) // 2 + 1].min() for (a, b), (_, c) in pairwise(strokes)]
    return bool(np.mean([low < min(pair) / 3 for low, pair in zip(least, pairwise(level), strict=True)]) > 0.8)


def _stranger(fit: DeclaredFit, row: Rows) -> bool:
    """Whether a recording is left unexplained while most others of its joint are explained."""
    others = [share for (trial, joint), share in fit.quality.items() if joint == row.joint and trial != row.trial]
    return bool(others) and fit.quality[row.trial, row.joint] > STRANGE and float(np.median(others)) < 0.5


def _own_fit(fit: DeclaredFit, row: Rows) -> float:
    """Share of the effort that the declared columns leave when fitted to this recording alone, offset included."""
    y = row.effort[row.moving]
    return rms(left_beside_declared([row], y)) / max(rms(y), 1e-300)


def _static(row: Rows, x: Array, start: Array) -> float | None:
    """Share that a static function of position leaves, where it is tiny beside what friction and inertia should add."""
    q, y = row.position[:: row.step][row.moving], row.effort[row.moving]
    static = np.stack([np.ones_like(q), q, q**2, q**3, np.sin(q), np.cos(q)], 1)
    static = static / (np.abs(static).max(0) + 1e-300)
    left = rms(y - static @ np.linalg.lstsq(static, y, rcond=1e-10)[0]) / max(rms(y), 1e-300)
    expected = x @ start
    moving = rms(expected - static @ np.linalg.lstsq(static, expected, rcond=1e-10)[0]) / max(rms(expected), 1e-300)
    return left if left < SAME and moving > 5 * left else None


def _check_position(rig: RigModel, joint: str, channel: str) -> list[ChannelIssue]:
    """Jumps by a whole turn within one sample (a counter not unwrapped) and encoders that never move."""
    wrapped, dead = [], []
    for trial in rig.trials:
        if joint not in trial.position:
            continue
        q = fill_gaps(trial.time_s, trial.position[joint])
        step = np.abs(np.diff(q))
        typical = float(np.percentile(step, 99)) if len(step) else 0.0
        if joint not in rig.slides and np.any(np.abs(step - 2 * np.pi) < 0.3) and typical < 1.0:
            wrapped.append(trial.name)
        if np.ptp(q) == 0:
            dead.append(trial.name)
    out = []
    if wrapped:
        out.append(
            ChannelIssue(
                "command_as_measurement",
                channel,
                joint,
                tuple(wrapped),
                f"{channel} jumps by a whole turn: it is not unwrapped",
                True,
                1.0,
            )
        )
    if dead and len(dead) == len(rig.trials):
        out.append(ChannelIssue("command_as_measurement", channel, joint, tuple(dead), f"{channel} {DEAD}", True, 1.0))
    return out
