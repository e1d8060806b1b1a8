"""What laboratory and drive write down of a trial: clocks, noise, gaps, rounding, and whatever is hidden in `rec`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

from .hand import Array, Finger
from .laboratory import Laboratory
from .motor import Trace
from .moves import Program

GAP_FRAMES = (4, 20)


def log_rows(
    rng: np.random.Generator,
    finger: Finger,
    rec: dict[str, Any],
    program: Program,
    trace: Trace,
    clock: float,
    session_time: float,
    noise: float,
    other: Array | None,
    laboratory: Laboratory,
) -> list[str]:
    """Lines of an actuator log."""
    steps = laboratory.log_step * rng.uniform(
        1 - laboratory.log_jitter, 1 + laboratory.log_jitter, int(program.duration / laboratory.log_step * 1.6)
    )
    times = np.cumsum(steps)
    times = times[times < program.duration]
    times = times[rng.random(len(times)) >= laboratory.log_loss]
    empty, full = finger.counts
    span = (full - empty) / 100.0
    position = empty + span * np.interp(times, trace.time, trace.position)
    if "encoder_amp" in rec:
        position = position + rec["encoder_amp"] * np.sin(
            2 * np.pi * position / rec["encoder_period"] + rec["encoder_phase"]
        )
    for moment, counts in rec.get("lost_counts", []):
        position = position - counts * (times > moment * program.duration)
    current = np.interp(times - rec.get("current_delay", 0.0), trace.time, trace.current)
    if "gain_drift" in rec:
        current = current * (1.0 + rec["gain_drift"] * (session_time + times) / 300.0)
    if "supply_amp" in rec:
        current = current + rec["supply_amp"] * np.sin(2 * np.pi * rec["supply_hz"] * times + rec["supply_phase"])
    if "crosstalk" in rec and other is not None:
        current = current + rec["crosstalk"] * np.interp(times + 0.7, np.arange(1, len(other) + 1) * 0.001, other)
    position = np.round(position + rng.normal(0.0, laboratory.position_noise * noise, len(times)))
    current = current + rng.normal(0.0, laboratory.current_noise * noise, len(times))
    if "clip" in rec:
        current = np.clip(current, -rec["clip"], rec["clip"])
    which = np.searchsorted(program.change_time, times, side="right") - 1
    setpoint = np.round(empty + span * program.target[which])
    speed = np.round(255 * program.speed[which])
    faked = rec.get("faked")
    if faked == "position_is_setpoint":
        position = setpoint
    elif faked == "position_is_reference":
        position = np.round(empty + span * np.interp(times, trace.time, trace.reference))
    elif faked == "current_is_dead":
        current = np.full(len(times), float(rec["dead_value"]))
    stamps = clock + rec.get("skew", 1.0) * times
    rows = ["time,position,current,setpoint,speed,current_limit"]
    rows += [
        f"{a:.5f},{b:.0f},{c:.0f},{d:.0f},{e:.0f},255"
        for a, b, c, d, e in zip(stamps, position, current, setpoint, speed)
    ]
    return rows


def corrupt_markers(
    rng: np.random.Generator,
    labels: list[str],
    points: Array,
    rec: dict[str, Any],
    marker: dict[str, Any],
    noise: float,
    gaps: bool,
    laboratory: Laboratory,
) -> Array:
    """Noise, gaps, swapped labels, lens and lost frames on world positions (n, k, 3) [m]."""
    points = points.copy()
    count = len(points)
    if "lens" in rec:
        away = points - np.array(rec["lens_centre"])
        points = points + rec["lens"] * np.sum(away**2, axis=2, keepdims=True) * away
    points = points + rng.normal(0.0, laboratory.marker_noise * noise, points.shape)
    for first, second, start, frames in marker.get("swaps", []):
        if first in labels and second in labels:
            i, j, k = labels.index(first), labels.index(second), int(start * count)
            points[k : k + frames, [i, j]] = points[k : k + frames, [j, i]]
    if gaps:
        for i in range(len(labels)):
            for _ in range(rng.poisson(laboratory.gap_rate * count / laboratory.mocap_rate)):
                k = int(rng.integers(0, count))
                points[k : k + int(rng.integers(*GAP_FRAMES)), i] = np.nan
    keep = np.ones(count, dtype=bool)
    for moment, frames in rec.get("lost_frames", []):
        keep[int(moment * count) : int(moment * count) + frames] = False
    return points[keep]


def write_c3d(path: Path, labels: list[str], points: Array, rate: float) -> None:
    """Points (n, k, 3) [m] at a rate [Hz] to a C3D in millimetres."""
    c3d = ezc3d.c3d()
    c3d["parameters"]["POINT"]["RATE"]["value"] = [rate]
    c3d["parameters"]["POINT"]["LABELS"]["value"] = labels
    c3d["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    data = np.ones((4, len(labels), len(points)))
    data[:3] = 1000.0 * points.transpose(2, 1, 0)
    lost = np.isnan(data[0])
    c3d["data"]["points"] = data
    c3d.add_parameter("POINT", "UNITS", ["mm"])
    c3d["data"]["meta_points"] = {
        "residuals": np.where(lost, -1.0, 0.0)[None],
        "camera_masks": np.zeros((7, len(labels), len(points)), dtype=bool),
    }
    c3d.write(str(path))
