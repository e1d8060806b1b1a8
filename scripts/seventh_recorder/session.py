"""Records one session folder of a hand."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .hand import Hand
from .kinematics import markers_in_palm
from .log_channel import write_log
from .manifest import manifest
from .mocap import RATE, Room, write_c3d
from .motions import FLEXION_SPEEDS, PACE, Pace, Programme, excitation_moves, flexion_moves, programme
from .plan import Plan
from .stepper import STEP_S, Run, run_drive


@dataclass(frozen=True)
class Trial:
    """One recorded trial of a finger: file stem, when it starts (s after the finger's first), what moves."""

    stem: str
    kind: str
    starts: float
    moves: Programme
    validate: bool


def finger_trials(name: str, short: bool, pace: Pace, rng: np.random.Generator) -> list[Trial]:
    """The five trials of a finger (four when short)."""
    full, half = (5, 3) if short else (8, 5)
    layout = [(f"flexion_{name}", "flexion", full, False), (f"flexion_{name}_b", "flexion", half, True)]
    last = 2 if short else 3
    layout += [(f"excitation_{name}_{i}", "excitation", 0, i == last) for i in range(1, last + 1)]
    nominal = (0.0, 120.0, 178.0, 224.0, 271.0)
    trials = []
    for (stem, kind, speeds, validate), start in zip(layout, nominal, strict=False):
        moves = flexion_moves(FLEXION_SPEEDS[:speeds]) if speeds else excitation_moves()
        trials.append(Trial(stem, kind, start + rng.normal(0, 1.8), programme(moves, pace), validate))
    return trials


def drive_trial(plan: Plan, trial: Trial, rng: np.random.Generator) -> Run:
    """Run a finger's drive through a trial."""
    scalars = plan.finger.motor | plan.drive
    scalars["on_time"] = 0.0 if plan.cools_between else max(trial.starts, 0.0)
    if plan.touch_trials and not any(part in trial.stem + "." for part in plan.touch_trials):
        scalars["touch_k"] = scalars["touch_c"] = 0.0
    scalars["touch_from"] = scalars.get("touch_from", 0.0) * trial.moves.duration
    scalars["touch_to"] = scalars.get("touch_to", 0.0) * trial.moves.duration
    count = len(trial.moves.position)
    lag = round(plan.command_delay(rng) / STEP_S)
    late = [np.concatenate([np.full(lag, x[0]), x[: count - lag]]) for x in (trial.moves.position, trial.moves.speed)]
    noise = np.cumsum(rng.normal(0, 1, (count + 199) // 200 + 1) * 0.35)
    extra = plan.random_load * np.interp(np.arange(count) / 200, np.arange(len(noise)), np.sin(noise))
    return run_drive(scalars, (late[0], late[1]), extra, plan.load_table, plan.friction_table)


def flexion_markers(plan: Plan, run: Run, trial: Trial, hand: Hand, room: Room, rng: np.random.Generator) -> np.ndarray:
    """The nine markers of a flexion trial as seen."""
    times = np.arange(round(trial.moves.duration * RATE)) / RATE
    palm = np.broadcast_to(hand.palm, (len(times), 3, 3)).copy()
    for step in plan.palm_steps:
        palm = step(palm, times, times)
    world = room.to_world(np.concatenate([palm, markers_in_palm(plan, run, times)], axis=1), times)
    seen = room.see(world)
    for change in plan.frame_steps:
        seen = change(seen, rng)
    return seen


def _probe_trials(folder: Path, hand: Hand, room: Room, rng: np.random.Generator) -> list[dict[str, str]]:
    """Landmarks and the screw heads beside the joints."""
    labels = ["PO", "PM", "PL", "T1", "T2", "T3", "T4"]
    trials = []
    for name, point in zip(("origin", "medial", "lateral"), hand.landmarks, strict=True):
        mocap = f"mocap/landmark_{name}.c3d"
        write_c3d(folder / mocap, labels, room.probe(point + rng.normal(0, 0.15, 3), hand.palm, 150))
        trials.append({"kind": "landmark", "name": name, "mocap": mocap})
    for finger in hand.fingers:
        for j, joint in enumerate(("proximal", "distal")):
            for side, sign in (("medial", 1.0), ("lateral", -1.0)):
                along = finger.axes[j]
                point = finger.centres[j] + sign * 7.1 * along + rng.normal(0, 0.5, 3)
                mocap = f"mocap/joint_{finger.name}_{joint}_{side}.c3d"
                write_c3d(folder / mocap, labels, room.probe(point, hand.palm, 120))
                entry = {"kind": "joint_probe", "finger": finger.name, "joint": joint, "side": side}
                trials.append(entry | {"mocap": mocap})
    return trials


def record(folder: Path, hand: Hand, plans: list[Plan], room: Room, short: bool, rng: np.random.Generator) -> None:
    """Write one session folder."""
    (folder / "log").mkdir(parents=True)
    (folder / "mocap").mkdir()
    pace = Pace(PACE.rest, PACE.pause, *(x * rng.normal(1, 0.02) for x in (PACE.acceleration, PACE.full_speed)))
    entries = _probe_trials(folder, hand, room, rng)
    for plan in plans:
        name, base = plan.finger.name, 1000.0 + rng.normal(0, 1.5)
        for trial in finger_trials(name, short, pace, rng):
            run = drive_trial(plan, trial, rng)
            log = f"log/{trial.stem}.csv"
            (folder / log).write_text(write_log(plan, run, trial.moves, base + trial.starts, rng))
            entry = {"kind": trial.kind, "finger": name, "log": log}
            if trial.kind == "flexion":
                entry["mocap"] = f"mocap/{trial.stem}.c3d"
                seen = flexion_markers(plan, run, trial, hand, room, rng)
                write_c3d(folder / entry["mocap"], ["PO", "PM", "PL", *plan.finger.labels], seen)
            entries.append(entry | ({"purpose": "validate"} if trial.validate else {}))
    (folder / "session.toml").write_text(manifest(hand, entries))
