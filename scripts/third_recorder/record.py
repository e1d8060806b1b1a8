"""A session folder: probed landmarks and joints, then the trials of every finger."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .geometry import Array, rotation, turn, unit
from .hand import PALM_LABELS, SEGMENTS, Finger, Session
from .log_file import write_log
from .manifest import entry, head
from .markers import finger_markers, observe, palm_markers, to_world
from .mocap_files import write_mocap
from .moves import Protocol, draw_pose
from .trial import Trial, run_trials

PROBE_TILT_DEG = 1.0  # nobody moves the hand while it is probed


def record(rng: np.random.Generator, session: Session, protocol: Protocol, folder: Path) -> list[Trial]:
    """Simulate a session and write it into a new folder; returns its trials."""
    trials = run_trials(rng, session, protocol)
    (folder / "mocap").mkdir(parents=True)
    (folder / "log").mkdir()
    parts = head(session)
    parts += probe_landmarks(rng, session, folder)
    parts += probe_joints(rng, session, protocol.low / 100, folder)
    for trial in trials:
        parts.append(write_trial(rng, session, protocol, trial, folder))
    (folder / "session.toml").write_text("\n".join(parts))
    return trials


def probe_landmarks(rng: np.random.Generator, session: Session, folder: Path) -> list[str]:
    """Touch the three landmarks of the palm; returns their manifest entries."""
    parts = []
    for name, tip in session.landmarks.items():
        path = f"mocap/landmark_{name}.{session.laboratory.mocap_format}"
        probe(rng, session, folder / path, tip, 1.5)
        parts.append(entry(kind="landmark", name=name, mocap=path))
    return parts


def probe_joints(rng: np.random.Generator, session: Session, at: float, folder: Path) -> list[str]:
    """Touch both ends of every joint's axis, the motors at a share of their range; returns the manifest entries."""
    parts = []
    for finger in session.fingers.values():
        for joint, name in enumerate(SEGMENTS):
            axis, centre = joint_place(finger, joint, at)
            for side, sign in (("medial", session.handed), ("lateral", -session.handed)):
                path = f"mocap/joint_{finger.name}_{name}_{side}.{session.laboratory.mocap_format}"
                probe(rng, session, folder / path, centre + axis * sign * rng.uniform(6.5, 8), 1.2)
                parts.append(entry(kind="joint_probe", finger=finger.name, joint=name, side=side, mocap=path))
    return parts


def joint_place(finger: Finger, joint: int, at: float) -> tuple[Array, Array]:
    """Axis, towards the index's side of a right hand, and centre [mm] of a joint; the motor at a share of its range."""
    linkage = finger.linkage
    axis, centre = linkage.axes[joint], linkage.centres[joint]
    axis = axis * np.sign(axis[1])
    if joint:
        turned = rotation(linkage.axes[0], np.array(linkage.full[0] * linkage.drive[0] * at))
        axis = turned @ axis
        centre = linkage.centres[0] + turned @ (centre - linkage.centres[0])
    return axis, centre


def probe(rng: np.random.Generator, session: Session, path: Path, tip: Array, duration_s: float) -> None:
    """Record the probe, wagged about its tip at a place of the landmark frame [mm], beside the palm."""
    rate = session.laboratory.mocap_hz
    time = np.arange(int(duration_s * rate)) / rate
    turned, origin = draw_pose(rng, session, PROBE_TILT_DEG)(time)
    palm = to_world(palm_markers(session, np.zeros(len(time))), turned, origin)
    held = turn(rng.normal(size=3) * 0.4)
    wagged = rotation(unit(rng.normal(size=3)), 0.12 * np.sin(2 * np.pi * 0.5 * time))
    touched = np.einsum("nij,j->ni", turned, tip + rng.normal(size=3) * 0.25) + origin
    own = np.array(list(session.probe.values())) * 1e3
    probed = np.einsum("nij,kj->nki", wagged @ held, own) + touched[:, None]
    seen = observe(rng, session, np.concatenate([palm, probed], 1), dropout=False)
    write_mocap(session.laboratory, path, PALM_LABELS + list(session.probe), seen)


def write_trial(rng: np.random.Generator, session: Session, protocol: Protocol, trial: Trial, folder: Path) -> str:
    """Log and, of a flexion, markers of a trial; returns its manifest entry."""
    kind, number, finger = trial.planned.kind, trial.planned.number, trial.finger
    flexion = kind == "flexion"
    name = f"{kind}_{finger.name}" + (("_b" if number else "") if flexion else f"_{number + 1}")
    log, mocap = f"log/{name}.csv", None
    write_log(rng, session, protocol, folder / log, trial)
    if flexion:
        mocap = f"mocap/{name}.{session.laboratory.mocap_format}"
        begin = rng.uniform(0, 0.5)
        time = np.arange(begin, trial.duration_s - rng.uniform(0, 0.4), 1 / session.laboratory.mocap_hz)
        palm, moving = palm_markers(session, trial.start_s + time), finger_markers(session, trial, time)
        seen = observe(rng, session, to_world(np.concatenate([palm, moving], 1), *trial.pose(time)))
        if number == 0:
            swap_labels(session, trial, time, seen)
        labels = PALM_LABELS + finger.labels[0] + finger.labels[1]
        write_mocap(session.laboratory, folder / mocap, labels, seen)
    return entry(kind=kind, finger=finger.name, log=log, mocap=mocap, purpose=trial.planned.purpose)


def swap_labels(session: Session, trial: Trial, time: Array, seen: Array) -> None:
    """Exchange the markers of swapped labels in what the cameras saw (n, 9, 3)."""
    for swap in session.faults.swaps:
        if swap.finger != trial.finger.name:
            continue
        first, second = (3 + 3 * joint + marker for joint, marker in (swap.first, swap.second))
        for fraction, length_s in swap.spells:
            begin = fraction * trial.duration_s
            spell = (time > begin) & (time < begin + length_s)
            seen[np.ix_(spell, [first, second])] = seen[np.ix_(spell, [second, first])]
