"""From a plan and a trial to what truly happened, and to the noise-free or noisy log."""

from copy import copy
from dataclasses import dataclass

import numpy as np

from fifth_recorder.dynamics import Dynamics
from fifth_recorder.plan import Frames, Motion, Plan, Rows, Signals, Trial
from fifth_recorder.stepper import COLUMNS, DT, STATES, Drive, step
from fifth_recorder.strokes import reference

TAIL = 0.03  # s recorded past the end
AT = {name: i for i, name in enumerate(COLUMNS)}


@dataclass
class Happening:
    """One trial as it happened: motor columns on the DT grid, the motion it caused, and what could be logged."""

    trial: Trial
    columns: np.ndarray
    motion: Motion
    signals: Signals


def happen(plan: Plan, trials: list[Trial], calm: list["Happening"] | None = None) -> list[Happening]:
    """All trials of a finger in the order of recording; heat carries over from one to the next.

    `calm`, the trials of the same motor unhindered, saves stepping when nothing acts on the motor.
    """
    if calm and not plan.acts_on_motor():
        return [_log(plan, q.trial, q.columns, q.signals.xref, np.zeros(len(q.columns)), plan.dyn) for q in calm]
    done, heat, last = [], 0.0, 0.0
    for trial in sorted(trials, key=lambda q: q.at):
        lab, n_moves = plan.lab, len(trial.moves)
        dyn = copy(plan.dyn)
        for hook in plan.per_trial:
            hook(dyn, trial)
        late = trial.rng(1).uniform(0, lab.command_jitter, n_moves)
        for hook in plan.delay:
            late = late + hook(trial)
        track = reference(trial.moves, trial.end + TAIL, lab.full_speed, lab.accel, lab.shape, late)
        zero = np.zeros(len(track["xref"]))
        drive = Drive(
            **track, load=zero.copy(), friction=zero.copy(), spring=zero.copy(), contact=zero.copy(), heat=zero.copy()
        )
        t = np.arange(len(zero)) * DT
        for hook in plan.drive:
            hook(drive, trial, t)
        state = np.zeros(STATES)
        state[8] = heat * np.exp(-max(trial.at - last, 0.0) / dyn.heat_power_fall)
        c = step(dyn, drive, state)
        heat, last = state[8], trial.at + trial.end
        done.append(_log(plan, trial, c, track["xref"], drive.heat + dyn.heat_power * c[:, AT["heat"]], dyn))
    return done


def _log(plan: Plan, trial: Trial, c: np.ndarray, xref: np.ndarray, heat: np.ndarray, dyn: Dynamics) -> Happening:
    t = np.arange(len(c)) * DT
    told = np.zeros(len(t))
    for move in trial.moves:
        told[t >= move.at] = move.target
    signals = Signals(trial, t, c[:, AT["x"]].copy(), c[:, AT["u"]].copy(), c[:, AT["v"]], told, xref, {"heat": heat})
    for hook in plan.signals:
        hook(signals)
    return Happening(trial, c, _move(plan, trial, t, c, dyn), signals)


def _move(plan: Plan, trial: Trial, t: np.ndarray, c: np.ndarray, dyn: Dynamics) -> Motion:
    x = c[:, AT["x"]]
    load = dyn.k * x + dyn.tau0 + 0.5 * c[:, AT["friction"]] + c[:, AT["extra"]]
    motion = Motion(trial, t, c[:, AT["v"]], load, c[:, AT["contact"]], x / 100.0, x, x, x)
    for hook in plan.input:
        hook(motion)
    motion.q1 = plan.finger.proximal(motion.s)
    for hook in plan.proximal:
        hook(motion)
    motion.link = motion.q1
    for hook in plan.link:
        hook(motion)
    motion.q2 = plan.finger.distal(motion.link)
    for hook in plan.distal:
        hook(motion)
    motion.shift = [np.zeros((1, 3)), np.zeros((1, 3))]
    for hook in plan.pose:
        hook(motion)
    return motion


def row_times(plan: Plan, trial: Trial) -> np.ndarray:
    """When the log's rows are sampled, s of the trial."""
    lab, rng = plan.lab, trial.rng(2)
    n = int(trial.end / lab.log_step * 1.3) + 20
    t = np.cumsum(lab.log_step * (1.0 + rng.uniform(-lab.log_jitter, lab.log_jitter, n)))
    t = t[t < trial.end]
    return t[rng.random(len(t)) >= lab.lost_rows]


def log_rows(plan: Plan, happening: Happening, noisy: bool) -> Rows:
    """The log of a trial; without noise it is neither rounded nor jittered."""
    lab, trial, s = plan.lab, happening.trial, happening.signals
    t = row_times(plan, trial)
    low, high = plan.finger.counts
    scale = (high - low) / 100.0
    position, current = low + np.interp(t, s.t, s.x) * scale, np.interp(t, s.t, s.u)
    last = np.searchsorted(s.t, t, side="right") - 1
    speed = np.full(len(t), float(lab.speed_full))
    for move in trial.moves:
        speed[t >= move.at] = float(int(move.speed * lab.speed_full + 0.5))
    rows = Rows(trial, t, position, current, low + s.setpoint[last] * scale, speed, noisy)
    if noisy:
        rng = trial.rng(3)
        rows.position = rows.position + rng.normal(0, lab.count_noise, len(t))
        rows.current = rows.current + rng.normal(0, lab.current_noise, len(t))
    for hook in plan.rows:
        hook(rows)
    if noisy and lab.packet > 1:
        arrival = (np.arange(len(t)) // lab.packet + 1) * lab.packet - 1
        rows.time = rows.time[np.minimum(arrival, len(t) - 1)] + 2e-4 * (np.arange(len(t)) % lab.packet)
    return rows


def turn(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) about a unit axis by angles (n), rad."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * k + (1 - c) * (k @ k)


def frame_times(plan: Plan, trial: Trial) -> np.ndarray:
    """Times (s of the trial) at which the cameras took the frames of the file."""
    t = np.arange(int((trial.end + 0.015) * plan.lab.mocap_rate)) / plan.lab.mocap_rate
    for hook in plan.frames:
        t = hook(trial, t)
    return t


def palm_frames(plan: Plan, palm: np.ndarray, happening: Happening, t: np.ndarray) -> Frames:
    """Marker positions in the palm frame at times t, with whatever happens to markers there."""
    f, m = plan.finger, happening.motion
    at = np.clip((t / DT).astype(int), 0, len(m.t) - 1)
    q1, q2 = np.interp(t, m.t, m.q1), np.interp(t, m.t, m.q2)
    r1, r2 = turn(f.axes[0], q1), turn(f.axes[1], q2)
    for joint, axis, angle in m.wobble:
        w = turn(axis, np.interp(t, m.t, angle))
        if joint == 0:
            r1 = r1 @ w
        else:
            r2 = r2 @ w
    shift = [np.broadcast_to(q, (len(m.t), 3))[at] for q in m.shift]
    c1 = f.centres[0] + shift[0]
    points = np.empty((len(t), 9, 3))
    points[:, :3] = palm
    points[:, 3:6] = c1[:, None] + np.einsum("tij,nj->tni", r1, f.markers[0] - f.centres[0])
    inner = (f.centres[1] + shift[1])[:, None] + np.einsum("tij,nj->tni", r2, f.markers[1] - f.centres[1])
    points[:, 6:] = c1[:, None] + np.einsum("tij,tnj->tni", r1, inner - f.centres[0])
    frames = Frames(happening.trial, t, points, q1, r1, r1 @ r2, np.interp(t, m.t, m.load))
    for hook in plan.markers:
        hook(frames)
    return frames
