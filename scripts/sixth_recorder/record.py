"""Record a session: every trial run, measured and written, and the session's description."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sixth_recorder.files import write_log, write_markers
from sixth_recorder.finger import SEGMENTS
from sixth_recorder.lab import PALM_LABELS, Lab
from sixth_recorder.machine import H, Machine, Truth
from sixth_recorder.plant import fresh_state
from sixth_recorder.vectors import coloured, turned_by

# m, tip of the probe at the origin
PROBE = {"T1": [0, 0, 0.085], "T2": [0, 0, 0.125], "T3": [0.034, 0, 0.110], "T4": [-0.026, 0.008, 0.118]}


def record(lab: Lab, machines: dict[str, Machine], folder: Path) -> None:
    """Run every trial of the machines (by finger) and write the session folder."""
    (folder / "log").mkdir(parents=True)
    (folder / "mocap").mkdir()
    lines = _description(lab)
    for name, place in lab.landmarks.items():
        file = f"mocap/landmark_{name}.c3d"
        _record_probe(lab, folder / file, place + lab.rng.normal(0, 4e-4, 3), 1.5)
        lines += _trial(kind="landmark", name=name, mocap=file)
    for finger in lab.fingers:
        for s, joint in enumerate(SEGMENTS):
            for side in ("medial", "lateral"):
                sign = (1 if lab.side == "right" else -1) * (1 if side == "medial" else -1)
                file = f"mocap/joint_{finger.name}_{joint}_{side}.c3d"
                head = finger.centres[s] + sign * finger.axes[s] * lab.rng.uniform(0.007, 0.011)
                _record_probe(lab, folder / file, head + lab.rng.normal(0, 9e-4, 3), 1.2)
                lines += _trial(kind="joint_probe", finger=finger.name, joint=joint, side=side, mocap=file)
    states = {finger.name: fresh_state() for finger in lab.fingers}
    for trial in lab.trials:
        finger, name = trial["finger"], trial["name"]
        machine = machines[finger]
        truth = machine.run(trial, states[finger])
        entry = {"kind": trial["kind"], "finger": finger, "log": f"log/{name}.csv"}
        write_log(folder / entry["log"], _log_rows(lab, machine, trial, truth))
        if trial["mocap"]:
            entry["mocap"] = f"mocap/{name}.c3d"
            _record_markers(lab, machine, trial, truth, folder / entry["mocap"])
        if trial["purpose"]:
            entry["purpose"] = trial["purpose"]
        lines += _trial(**entry)
    (folder / "session.toml").write_text("\n".join(lines).rstrip("\n"))


def _trial(**values: str) -> list[str]:
    return ["[[trial]]", *(f'{key} = "{value}"' for key, value in values.items()), ""]


def _description(lab: Lab) -> list[str]:
    """The lines of session.toml before the trials."""
    probe = ", ".join(f"{label} = {[float(x) for x in place]}" for label, place in PROBE.items())
    lines = ['format = "hand-session/1"', ""]
    lines += ["[hand]", 'name = "bebionic"', f'side = "{lab.side}"', ""]
    lines += ["[palm]", 'markers = { origin = "PO", medial = "PM", lateral = "PL" }', ""]
    lines += ["[world]", "gravity = [0.0, 0.0, -9.81]", "", "[probe]", f"markers = {{ {probe} }}", ""]
    for finger in lab.fingers:
        lines += ["[[actuator]]", f'name = "{finger.name}"', "speed_full = 255", "current_full = 255", ""]
    for finger in lab.fingers:
        lines += ["[[finger]]", f'name = "{finger.name}"', f'actuator = "{finger.name}"', "segments = ["]
        for name, labels in zip(SEGMENTS, finger.labels):
            quoted = ", ".join(f'"{label}"' for label in labels)
            lines += [f'  {{ name = "{name}", markers = [{quoted}] }},']
        lines += ["]", ""]
    return lines


def _record_probe(lab: Lab, path: Path, tip: np.ndarray, seconds: float) -> None:
    """A probe that swings about its tip (m, palm frame)."""
    rng, n = lab.rng, int(seconds * lab.rate_mocap)
    t = np.arange(n) / lab.rate_mocap
    base = turned_by(rng.normal(0, 0.5, (1, 3)))[0]
    swing = [
        rng.uniform(0.2, 0.45) * np.sin(2 * np.pi * rng.uniform(0.3, 0.8) * t + rng.uniform(0, 6)) for _ in range(3)
    ]
    turns = turned_by(np.stack(swing, 1)) @ base
    points = np.einsum("nij,kj->nki", turns, np.array(list(PROBE.values())))
    points = points + tip + coloured(rng, n, 2e-4, 0.98, (3,))[:, None]
    held = {"pose": np.zeros(3), "pause": rng.normal(0, 0.01, 3)}
    world = _to_world(lab, np.concatenate([np.repeat(lab.palm[None], n, 0), points], 1), held)
    write_markers(path, [*PALM_LABELS, *PROBE], _measured(lab, world), lab.rate_mocap)


def _record_markers(lab: Lab, machine: Machine, trial: dict[str, Any], truth: Truth, path: Path) -> None:
    """The markers of a trial."""
    finger, rate = machine.finger, lab.rate_mocap
    start = lab.rng.uniform(0, 0.1)
    n = int((trial["duration"] - start - 0.01) * rate)
    t = start + np.arange(n) / rate
    at, index = trial["t0"] + t, np.round(t / H).astype(int)
    proximal, distal = machine.markers(truth, index, at)
    palm = np.repeat(lab.palm[None], n, 0)
    for slip in lab.palm_slips:
        palm = palm + slip(at)
    if machine.palm_load:
        marker, bend = machine.palm_load
        palm[:, marker] += truth["I_slow"][index][:, None] * bend
    world = _to_world(lab, np.concatenate([palm, proximal, distal], 1), trial)
    for change in machine.on_world:
        world = change(world, at)
    points, labels = _measured(lab, world), [*PALM_LABELS, *finger.labels[0], *finger.labels[1]]
    for change in machine.on_points:
        points = change(points, labels, t, trial)
    write_markers(path, labels, points, rate)


def _to_world(lab: Lab, local: np.ndarray, trial: dict[str, Any]) -> np.ndarray:
    """Points (n, markers, 3) m of the palm frame in the world, while the palm sways."""
    rng, n = lab.rng, len(local)
    t = np.arange(n) / lab.rate_mocap
    turn, shift = np.zeros((n, 3)), np.zeros((n, 3))
    for k in range(3):
        for _ in range(2):
            f, phase = rng.uniform(0.03, 0.5), rng.uniform(0, 6.3)
            shift[:, k] += lab.sway[0] * np.sin(2 * np.pi * f * t + phase) * rng.uniform(0.3, 1)
            turn[:, k] += lab.sway[1] * np.sin(2 * np.pi * f * t * 0.7 + phase * 2) * rng.uniform(0.3, 1) * 0.6
    turns = turned_by(turn) @ lab.rotation(trial)
    place = lab.pose0[1] + 5 * trial["pause"] * 0.05 + shift
    return np.einsum("nij,nkj->nki", turns, local) + place[:, None]


def _measured(lab: Lab, world: np.ndarray) -> np.ndarray:
    """With noise and occlusions, in mm."""
    rng, (n, count, _) = lab.rng, world.shape
    sigma, share = lab.sigma_marker * lab.noise_factor, lab.marker_coloured
    white = rng.normal(0, sigma * np.sqrt(1 - share), (n, count, 3))
    points = (world + white + coloured(rng, n, sigma * np.sqrt(share), 0.9, (count, 3))) * 1e3
    for k in range(count):
        for _ in range(rng.poisson(lab.occlusion * n / 10)):
            first, length = int(rng.integers(0, n)), int(rng.integers(3, 20))
            points[first : first + length, k] = np.nan
    return points


def _log_rows(lab: Lab, machine: Machine, trial: dict[str, Any], truth: Truth) -> dict[str, np.ndarray]:
    """The log of a trial by column."""
    rng, finger = lab.rng, machine.finger
    start = rng.uniform(-0.03, 0.25)
    n = int(trial["duration"] * lab.rate_log * 1.1) + 5
    t = np.cumsum((1 + lab.log_jitter * rng.uniform(-1, 1, n)) / lab.rate_log) + start
    t = t[t < trial["duration"] - 0.02]
    t = t[rng.random(len(t)) > lab.lost]
    t = t[t > 0]
    q = np.interp(t, truth["t"], machine.shown_position(truth))
    current = np.interp(t, truth["t"], machine.shown_current(truth))
    sigma, share = lab.sigma_current[finger.name] * lab.noise_factor, lab.current_coloured
    noise = rng.normal(0, sigma * np.sqrt(1 - share), len(t))
    noise = noise + coloured(rng, len(t), sigma * np.sqrt(share), lab.current_memory)
    counts = finger.open + finger.counts * q / 100 + rng.normal(0, finger.jitter * lab.noise_factor, len(t))
    quantum = lab.current_quantum
    reading = np.round((current + noise) / quantum) * quantum
    for limit in machine.reading_limits:
        reading = limit(reading, quantum)
    begins, targets, _ = np.array(trial["moves"]).T
    move = np.searchsorted(begins, t) - 1
    setpoint = np.where(move >= 0, targets[move], 0.0)
    rows = {
        "time": lab.clock_offset + trial["t0"] + t,
        "position": np.round(counts / finger.resolution) * finger.resolution,
        "current": reading,
        "setpoint": np.round(finger.open + finger.counts * setpoint / 100),
        "speed": np.where(move >= 0, np.array(trial["speed_raw"])[move], 255),
        "current_limit": np.full(len(t), 255),
    }
    if lab.temperature:
        warmth = 24 + 6 * (1 - np.exp(-(trial["t0"] + t) / 300))
        rows["temperature"] = np.round((warmth + rng.normal(0, 0.2, len(t))) * 2) / 2
    for change in machine.on_rows:
        rows = change(rows, t)
    for change in machine.on_log_time:
        rows["time"] = change(rows["time"])
    if lab.empty:
        for name in ("position", "current"):
            rows[name] = np.where(rng.random(len(t)) < lab.empty, np.nan, rows[name])
    return rows
