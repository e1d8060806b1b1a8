"""One session: draw it, and write it to a folder as session_format.md says."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifth_recorder.files import write_log, write_markers
from fifth_recorder.finger import Finger, draw_finger, palm_points
from fifth_recorder.lab import Lab, actuator_of, draw_lab
from fifth_recorder.mocap import PROBE, far_pose, flexion, probe, screw_heads, session_pose, trial_pose
from fifth_recorder.plan import Plan, Rows, Trial
from fifth_recorder.simulate import Happening, happen, log_rows
from fifth_recorder.strokes import schedule

PALM_LABELS = ["PO", "PM", "PL"]
PLACED = 0.00035  # m: how well a probe tip is placed
SITES = ("origin", "medial", "lateral")


@dataclass
class Session:
    """A hand in a laboratory before anything is hidden. Lengths m."""

    lab: Lab
    fingers: dict[str, Finger]
    palm: np.ndarray
    landmarks: np.ndarray
    pose: np.ndarray
    place: np.ndarray
    trials: dict[str, list[Trial]]


def draw_session(rng: np.random.Generator, weak: bool) -> Session:
    """Laboratory, hand and trial list."""
    lab = draw_lab(rng, weak)
    palm, landmarks = palm_points(lab, rng)
    fingers = {name: draw_finger(name, lab, rng) for name in lab.fingers}
    pose, place = session_pose(rng)
    return Session(
        lab, fingers, palm, landmarks, pose, place, {name: _trials(name, lab, pose, rng) for name in lab.fingers}
    )


def _trials(finger: str, lab: Lab, pose: np.ndarray, rng: np.random.Generator) -> list[Trial]:
    wanted = [
        (
            "flexion",
            "" if i == 0 else f"_{'abcdef'[i]}",
            lab.flexion if i == 0 else lab.flexion_b,
            i == lab.flexions - 1,
        )
        for i in range(lab.flexions)
    ]
    wanted += [("excitation", f"_{i + 1}", lab.excitation, i == lab.excitations - 1) for i in range(lab.excitations)]
    trials, at = [], 0.0
    for i, (kind, suffix, strokes, validate) in enumerate(wanted):
        moves, end = schedule(strokes, lab.full_speed, lab.accel, lab.dwell)
        begin = at + rng.uniform(0, 3)
        trials.append(
            Trial(
                kind,
                f"{kind}_{finger}{suffix}",
                finger,
                moves,
                end,
                begin,
                validate,
                int(rng.integers(2**31)),
                i,
                trial_pose(pose, rng),
            )
        )
        at += {"flexion": 120.0 if i == 0 else 60.0, "excitation": 45.0}[kind] + max(end - 52.0, 0.0)
    return trials


def hold_differently(session: Session, finger: str, rng: np.random.Generator) -> None:
    """The hand is held in another way in every trial of a finger."""
    for trial in session.trials[finger]:
        trial.pose = far_pose(rng) @ session.pose


def write_session(session: Session, plans: dict[str, Plan], folder: Path, rng: np.random.Generator) -> None:
    """Record everything and write it."""
    for part in ("log", "mocap"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    (folder / "session.toml").write_text(_toml(session))
    _write_probes(session, folder, rng)
    lab = session.lab
    for name, plan in plans.items():
        for happening in happen(plan, session.trials[name]):
            trial = happening.trial
            _write_log(folder / "log" / f"{trial.name}.csv", log_rows(plan, happening, noisy=True), happening, lab, rng)
            if trial.kind == "flexion":
                points = flexion(plan, session.palm, happening, session.place)
                labels = PALM_LABELS + plan.finger.labels
                write_markers(folder / "mocap" / f"{trial.name}.{lab.file}", labels, points, lab.mocap_rate)


def _write_log(path: Path, rows: Rows, happening: Happening, lab: Lab, rng: np.random.Generator) -> None:
    columns = {
        "position": rows.position,
        "current": rows.current,
        "setpoint": rows.setpoint,
        "speed": rows.speed,
        "current_limit": np.full(len(rows.time), float(lab.speed_full)),
    }
    signals = happening.signals
    if "temperature" in signals.extra:
        columns["temperature"] = np.interp(rows.time, signals.t, signals.extra["temperature"]) + rng.normal(
            0, 0.1, len(rows.time)
        )
    write_log(
        path,
        rows.time + 1000.0 + rows.trial.at + rng.uniform(-3, 0),
        columns,
        rng.random(len(rows.time)) < lab.lost_cells,
    )


def _write_probes(session: Session, folder: Path, rng: np.random.Generator) -> None:
    labels = PALM_LABELS + list(PROBE)
    wanted = [(f"landmark_{site}", tip, 1.5) for site, tip in zip(SITES, session.landmarks)]
    for finger in session.fingers.values():
        wanted += [
            (f"joint_{finger.name}_{joint}_{side}", tip, 1.2) for (joint, side), tip in screw_heads(finger).items()
        ]
    for stem, tip, seconds in wanted:
        tip = tip + rng.normal(0, PLACED, 3)
        points = probe(session.lab, session.palm, tip, session.pose, session.place, seconds, rng)
        write_markers(folder / "mocap" / f"{stem}.{session.lab.file}", labels, points, session.lab.mocap_rate)


def _table(**pairs: str | int) -> list[str]:
    return [f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value}" for key, value in pairs.items()] + [
        ""
    ]


def _names(labels: list[str]) -> str:
    return "[" + ", ".join(f'"{q}"' for q in labels) + "]"


def _toml(session: Session) -> str:
    lab, end = session.lab, session.lab.file
    out = [
        'format = "hand-session/1"',
        "",
        "[hand]",
        *_table(name="bebionic", side=lab.side),
        "[palm]",
        'markers = { origin = "PO", medial = "PM", lateral = "PL" }',
        "",
        "[world]",
        "gravity = [0.0, 0.0, -9.81]",
        "",
        "[probe]",
        "markers = { " + ", ".join(f"{k} = [{x}, {y}, {z}]" for k, (x, y, z) in PROBE.items()) + " }",
        "",
    ]
    for name in lab.fingers:
        out += ["[[actuator]]", *_table(name=actuator_of(name), speed_full=lab.speed_full, current_full=lab.speed_full)]
    for name, finger in session.fingers.items():
        out += [
            "[[finger]]",
            *_table(name=name, actuator=finger.actuator)[:-1],
            "segments = [",
            f'  {{ name = "proximal", markers = {_names(finger.labels[:3])} }},',
            f'  {{ name = "distal", markers = {_names(finger.labels[3:])} }},',
            "]",
            "",
        ]
    for site in SITES:
        out += ["[[trial]]", *_table(kind="landmark", name=site, mocap=f"mocap/landmark_{site}.{end}")]
    for finger in session.fingers.values():
        for joint, side in screw_heads(finger):
            out += [
                "[[trial]]",
                *_table(
                    kind="joint_probe",
                    finger=finger.name,
                    joint=joint,
                    side=side,
                    mocap=f"mocap/joint_{finger.name}_{joint}_{side}.{end}",
                ),
            ]
    for trials in session.trials.values():
        for trial in trials:
            pairs = {"kind": trial.kind, "finger": trial.finger, "log": f"log/{trial.name}.csv"}
            if trial.kind == "flexion":
                pairs["mocap"] = f"mocap/{trial.name}.{end}"
            if trial.validate:
                pairs["purpose"] = "validate"
            out += ["[[trial]]", *_table(**pairs)]
    return "\n".join(out)
