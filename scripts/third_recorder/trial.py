"""One trial: commands, what acts on the finger from outside, and the motion that follows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from .geometry import Array, unit
from .hand import Finger, Session
from .motor import EVERY, STEP_S, Inputs, Trace, simulate
from .moves import Planned, Pose, Protocol, Strokes, draw_pose, draw_strokes

FREE = -1e6  # [%] held by nobody


@dataclass
class Trial:
    """A simulated trial. start_s: session time; since_s: since the finger's motor first moved; target [%],
    speed_share and current [raw] at the rows of the trace. touched: when [s] an obstacle is there; pushes: middle and
    half length [s] of each."""

    planned: Planned
    finger: Finger
    start_s: float
    since_s: float
    duration_s: float
    pose: Pose
    trace: Trace
    time: Array
    target: Array
    speed_share: Array
    current: Array
    touched: list[float] | None
    pushes: list[list[float]] | None


def run_trial(
    rng: np.random.Generator,
    session: Session,
    protocol: Protocol,
    planned: Planned,
    start_s: float,
    since_s: float,
) -> Trial:
    """Draw and simulate a trial."""
    finger = session.fingers[planned.finger]
    motor = replace(finger.motor, warm_s=since_s)
    clipping = finger.faults.clipping
    strokes = draw_strokes(rng, session, protocol, planned.kind, planned.length_s)
    pose = draw_pose(rng, session, session.laboratory.tilt_deg)
    time = np.arange(int(strokes.duration_s / STEP_S)) * STEP_S
    inputs = commanded(strokes, protocol.low, time, gravity(finger, pose, strokes.duration_s, time))
    if finger.faults.tremor:
        tremor, at = finger.faults.tremor, time + start_s
        inputs.external[:] = tremor.amplitude * np.sin(2 * np.pi * tremor.hz * at + 2.0 * np.sin(0.4 * at))
    touched = touch(rng, finger, planned, strokes.duration_s, inputs, time)
    pushes = push(rng, finger, planned, strokes.duration_s, inputs, time)
    if clipping and clipping.where == "drive" and clipping.level:
        motor.current_limit = clipping.level
    trace = simulate(motor, inputs, protocol.low)
    if not (np.isfinite(trace.position).all() and np.abs(trace.position).max() < 200):
        raise ArithmeticError(f"the simulated drive of {finger.name} ran away")
    rows = len(trace.position)
    return Trial(
        planned,
        finger,
        start_s,
        since_s,
        strokes.duration_s,
        pose,
        trace,
        trace.time,
        inputs.target[::EVERY][:rows],
        inputs.speed_share[::EVERY][:rows],
        read_current(finger, trace, start_s, since_s),
        touched,
        pushes,
    )


def gravity(finger: Finger, pose: Pose, duration_s: float, time: Array) -> tuple[Array, Array]:
    """Components of gravity's direction, dorsal and along the open finger, at times."""
    coarse = np.arange(0, duration_s + 0.2, 0.02)
    turned, _ = pose(coarse)
    down = turned.transpose(0, 2, 1) @ np.array([0, 0, -1.0])
    _, dorsal = finger.linkage.frame(0)
    # along the line between the centres, not square to the axis: the finger's weight sits there
    along = unit(finger.linkage.centres[1] - finger.linkage.centres[0])
    return np.interp(time, coarse, down @ dorsal), np.interp(time, coarse, down @ along)


def commanded(strokes: Strokes, low: float, time: Array, gravity: tuple[Array, Array]) -> Inputs:
    """Inputs of a motor that nothing but its commands and gravity acts on."""
    target, share = np.full(len(time), low), np.full(len(time), strokes.commands[0][2])
    for moment, wanted, speed in strokes.commands:
        step = int(moment / STEP_S)
        target[step:], share[step:] = wanted, speed
    nothing = np.zeros(len(time))
    return Inputs(target, share, nothing, nothing.copy(), *gravity, np.full(len(time), FREE))


def touch(
    rng: np.random.Generator, finger: Finger, planned: Planned, duration_s: float, inputs: Inputs, time: Array
) -> list[float] | None:
    """Put an obstacle there for a while, in flexions and every second excitation; returns the while [s]."""
    share = finger.faults.touched_share
    if share is None or not (planned.kind == "flexion" or planned.number % 2 == 1):
        return None
    begin = rng.uniform(0.15, 0.9 - share)
    there = np.where((time > begin * duration_s) & (time < (begin + share) * duration_s), 1.0, 0.0)
    inputs.touching[:] = lfilter([0.001], [1, -0.999], there)  # within a quarter of a second
    return [begin * duration_s, (begin + share) * duration_s]


def push(
    rng: np.random.Generator, finger: Finger, planned: Planned, duration_s: float, inputs: Inputs, time: Array
) -> list[list[float]] | None:
    """Let a hand push the finger beyond its drive for moments of a flexion; returns their middles and half lengths
    [s]."""
    lift = finger.faults.lift
    if lift is None or planned.kind != "flexion":
        return None
    pushes = []
    free = simulate(finger.motor, inputs, inputs.target[0]).position  # where the drive would be
    rows = np.arange(len(free)) * STEP_S * EVERY
    count = int(rng.integers(4, 8))
    for middle in np.sort(rng.uniform(0.12, 0.9, count)) * duration_s:
        half = rng.uniform(0.7, 1.6)
        if np.interp(middle, rows, free) > 80:
            continue  # no room left to push it on
        u = (time - middle) / half
        shape = np.where(np.abs(u) < 1, np.cos(np.pi / 2 * np.clip(u, -1, 1)) ** 2, 0)
        held = shape > 0
        inputs.pushed_to[held] = np.interp(time[held], rows, free) + lift * shape[held] * 1.4 - 0.4 * lift
        pushes.append([middle, half])
    return pushes


def read_current(finger: Finger, trace: Trace, start_s: float, since_s: float) -> Array:
    """What the drive's sensor makes of its current [raw]."""
    current, warming, wander = trace.current.copy(), finger.faults.current_gain, finger.faults.wander
    if warming:
        current = current * (1 + warming.rise * (1 - np.exp(-(since_s + trace.time) / warming.time_s)))
    if wander:
        current = current + wander.amplitude * np.sin(2 * np.pi * wander.hz * (start_s + trace.time) + wander.phase)
    return current


def set_clipping_levels(session: Session, protocol: Protocol) -> None:
    """Level of a current that clips, from a dry run: a share of the motion is to lie above it."""
    for finger in session.fingers.values():
        clipping = finger.faults.clipping
        if clipping is None:
            continue
        rng = np.random.default_rng(5)  # of its own: the session's draws stay the same without it
        trial = run_trial(rng, session, protocol, Planned("flexion", finger.name, 30, None, 0), 0, 0)
        moving = np.abs(trial.trace.speed) > 3
        noise = session.laboratory.current_noise * rng.normal(size=moving.sum())
        current = np.abs(trial.current[moving] + noise)
        clipping.level = float(np.round(np.quantile(current, 1 - clipping.share * 1.3)))
        if clipping.where == "drive":  # or the motor would stand still
            half = float(np.round(np.quantile(trial.current[moving], 0.5) * 1.12))
            clipping.level = max(clipping.level, half)


def run_trials(rng: np.random.Generator, session: Session, protocol: Protocol) -> list[Trial]:
    """All trials of a session, one after the other; slips get their session times."""
    trials: list[Trial] = []
    first: dict[str, float] = {}
    time_s = 30.0
    for planned, gap_s in zip(protocol.trials, protocol.gaps_s, strict=True):
        since_s = time_s - first.setdefault(planned.finger, time_s)
        trial = run_trial(rng, session, protocol, planned, time_s, since_s)
        trials.append(trial)
        time_s += trial.duration_s + gap_s
    for slip in session.faults.slips:
        shown = next(
            trial for trial in trials if trial.planned.kind == "flexion" and trial.planned.finger == slip.finger
        )
        slip.session_s = shown.start_s + slip.fraction * shown.duration_s
    return trials
