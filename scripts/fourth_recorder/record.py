"""A session's folder: session.toml, logs, marker recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .geometry import Array, turns, unit
from .hand import PALM_LABELS, SEGMENTS
from .log_file import log_text
from .manifest import PROBE, head, trial_lines
from .markers import trial_markers
from .mocap_files import write_mocap
from .pose import before_cameras, palm_poses, seen
from .session import Session
from .trial import Trial

LANDMARK_FRAMES, JOINT_FRAMES = 150, 120  # at 100 Hz
PROBE_REACH = 7.2  # [mm] from a joint's centre, along its axis


def probe_markers(rng: np.random.Generator, session: Session, times: Array, point: Array) -> Array:
    """Markers (n, 4, 3) [mm] of a probe whose tip rests on a point of the landmark frame."""
    tip = point + rng.normal(0, session.laboratory.probe_error, 3)
    up = unit(np.array([0, 0, 1.0]) + rng.normal(0, 0.55, 3))
    first = unit(np.cross(rng.normal(0, 1, 3), up))
    held = np.c_[first, np.cross(up, first), up]
    angles = np.zeros((len(times), 3))
    for _ in range(2):
        size = np.radians(rng.normal(0, 3.2, 3))
        angles += size * np.sin(2 * np.pi * rng.uniform(0.3, 0.9) * times + rng.uniform(0, 6.28))[:, None]
    return tip + np.einsum("nij,kj->nki", turns(angles) @ held, np.array(list(PROBE.values())))


def write_probe(rng: np.random.Generator, session: Session, path: Path, frames: int, point: Array) -> None:
    """A recording of the palm and a probe; frames: at 100 Hz."""
    rate = session.laboratory.mocap_hz
    times = np.arange(int(frames * (rate / 100))) / rate
    turned, place = palm_poses(rng, session, times)
    probe = probe_markers(rng, session, times, point)
    palm = np.broadcast_to(session.hand.palm, (len(times), 3, 3))
    points = seen(rng, session, turned, place, np.concatenate([palm, probe], 1))
    write_mocap(session.laboratory, path, [*PALM_LABELS, *PROBE], points)


def write_probes(rng: np.random.Generator, session: Session, folder: Path) -> list[str]:
    """Landmarks and joints; returns their lines of session.toml."""
    ending = session.laboratory.mocap_format
    lines = []
    for name, place in session.hand.landmarks.items():
        mocap = f"mocap/landmark_{name}.{ending}"
        lines += trial_lines(kind="landmark", name=name, mocap=mocap)
        write_probe(rng, session, folder / mocap, LANDMARK_FRAMES, place)
    for finger in session.hand.fingers.values():
        for joint, axis, centre in zip(SEGMENTS, finger.axes, finger.centres, strict=True):
            for side, sign in (("medial", 1), ("lateral", -1)):
                mocap = f"mocap/joint_{finger.name}_{joint}_{side}.{ending}"
                lines += trial_lines(kind="joint_probe", finger=finger.name, joint=joint, side=side, mocap=mocap)
                point = centre + sign * axis * (PROBE_REACH + rng.normal(0, 0.25))
                write_probe(rng, session, folder / mocap, JOINT_FRAMES, point)
    return lines


def write_trial(rng: np.random.Generator, session: Session, trial: Trial, folder: Path) -> list[str]:
    """Log of a trial, and markers where it is one of flexion; returns its lines of session.toml."""
    laboratory = session.laboratory
    entries = {"kind": trial.planned.kind, "finger": trial.finger.name, "log": f"log/{trial.name}.csv"}
    (folder / entries["log"]).write_text(log_text(rng, session, trial))
    if trial.planned.kind == "flexion":
        entries["mocap"] = f"mocap/{trial.name}.{laboratory.mocap_format}"
        times = np.arange(int(np.ceil(trial.duration_s * laboratory.mocap_hz))) / laboratory.mocap_hz
        points = before_cameras(rng, session, times, trial_markers(session, trial, times))
        write_mocap(laboratory, folder / entries["mocap"], [*PALM_LABELS, *trial.finger.labels], points)
    if trial.planned.validate:
        entries["purpose"] = "validate"
    return trial_lines(**entries)


def record(session: Session, trials: dict[str, list[Trial]], folder: Path) -> None:
    """Write everything into a new folder; trials: by finger."""
    rng = np.random.default_rng([session.seed, 5])
    for name in ("log", "mocap"):
        (folder / name).mkdir(parents=True)
    lines = head(session.hand) + write_probes(rng, session, folder)
    for each in trials.values():
        for trial in each:
            lines += write_trial(rng, session, trial, folder)
    (folder / "session.toml").write_text("\n".join(lines[:-1]) + "\n")
