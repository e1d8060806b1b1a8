"""How far a perfect observer of the refitted declared model is off, in units of the noise.

The noise-free truth of a finger's trials is refitted with everything that a session declares: the current with inertia,
viscous, Coulomb, spring and preload by least squares, events averaged over 40 ms, moving samples only; the markers with
both axes, centres, cubic, quartic, all places and a clock offset per trial, in the palm's frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from sixth_recorder.finger import Finger
from sixth_recorder.lab import Lab
from sixth_recorder.machine import Machine, Truth
from sixth_recorder.plant import fresh_state
from sixth_recorder.vectors import turned_about

STEP = 16  # truth samples per sample of the current, about 60 Hz
MARKER_STEP = 80  # truth samples per frame
EVENT = 41  # ms, what sampling and encoder noise leave of an event
LATE = 0.002  # s, half the step of the derivative by time

Runs = list[tuple[dict[str, Any], Truth]]


def truths(machine: Machine, trials: list[dict[str, Any]]) -> Runs:
    """Trials and their truths, without restless friction."""
    state = fresh_state()
    return [(trial, machine.run(trial, state, quiet=True)) for trial in trials]


def current_mismatch(machine: Machine, runs: Runs, sigma: float) -> float:
    """What the declared model leaves of the current (rms) over its noise sigma (raw)."""
    columns, values = [], []
    for _, truth in runs:
        q, v, a = machine.shown_position(truth), truth["v"], truth["a"]
        for stage in machine.position_stages:
            v, a = stage(v, truth), stage(a, truth)
        k = np.arange(0, len(q), STEP)
        k = k[abs(v[k]) > 2.5]
        smooth = [uniform_filter1d(x, EVENT)[k] for x in (a, v, np.sign(v), q)]
        columns.append(np.stack([*smooth, np.ones(len(k))], 1))
        values.append(uniform_filter1d(machine.shown_current(truth), EVENT)[k])
    x, y = np.concatenate(columns), np.concatenate(values)
    left = y - x @ np.linalg.lstsq(x, y, rcond=1e-12)[0]
    return float(np.sqrt(np.mean(left**2)) / sigma)


def marker_mismatch(machine: Machine, runs: Runs, sigma: float, lab: Lab) -> float:
    """What the declared model leaves of the segment that is worse off (rms per coordinate) over its noise sigma (m)."""
    finger = machine.finger
    columns, values = [], []
    declared = _pack(finger)
    steps = np.maximum(1e-3, abs(declared)) * 1e-4
    n_proximal = len(finger.labels[0])
    n_markers = n_proximal + len(finger.labels[1])
    recorded = [run for run in runs if run[0]["mocap"]]
    for i, (trial, truth) in enumerate(recorded):
        k = np.arange(0, len(truth["q"]), MARKER_STEP)
        t = truth["t"][k]
        at = trial["t0"] + t
        actual = _seen_from_palm(machine, lab, truth, k, at)
        q = machine.shown_position(truth)
        q_then = np.interp(t - (machine.clock(at) - machine.clock(at[:1]) if machine.clock else 0), truth["t"], q)
        base = _model(finger, declared, q_then)
        slopes = []
        for j, step in enumerate(steps):
            other = declared.copy()
            other[j] += step
            slopes.append(((_model(finger, other, q_then) - base) / step).ravel())
        after, before = (_model(finger, declared, np.interp(t + shift, truth["t"], q)) for shift in (LATE, -LATE))
        late = ((after - before) / (2 * LATE)).ravel()
        offsets = [late if j == i else np.zeros_like(late) for j in range(len(recorded))]
        columns.append(np.stack(slopes + offsets, 1))
        values.append((actual - base).ravel())
    x, y = np.concatenate(columns), np.concatenate(values)
    x = x / np.maximum(np.sqrt((x**2).mean(0)), 1e-12)
    normal = x.T @ x
    ridge = 1e-9 * np.trace(normal) / len(normal) * np.eye(len(normal))
    left = (y - x @ np.linalg.lstsq(normal + ridge, x.T @ y, rcond=None)[0]).reshape(-1, n_markers, 3)
    segments = left[:, :n_proximal], left[:, n_proximal:]
    return float(max(np.sqrt((segment**2).mean()) for segment in segments) / sigma)


def _seen_from_palm(machine: Machine, lab: Lab, truth: Truth, index: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Both segments' markers (n, markers, 3) m in the frame that the palm's markers give."""
    points = np.concatenate(machine.markers(truth, index, at), 1)
    if machine.scale:
        points = points * (1 + machine.scale(at))[:, None, None]
    if not machine.palm and not machine.palm_load:
        return points
    palm = np.repeat(lab.palm[None], len(index), 0)
    if machine.palm:
        palm = palm + machine.palm(at)
    if machine.palm_load:
        marker, bend = machine.palm_load
        palm[:, marker] += truth["I_slow"][index][:, None] * bend
    middle = lab.palm.mean(0)
    u, _, v = np.linalg.svd(np.einsum("nki,kj->nij", palm - palm.mean(1, keepdims=True), lab.palm - middle))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ v))[:, None]
    return np.einsum("nji,nkj->nki", u @ v, points - palm.mean(1, keepdims=True)) + middle


def _pack(finger: Finger) -> np.ndarray:
    """Everything declared of a finger's kinematics, in one row."""
    hinges = (finger.axes[0], finger.centres[0], finger.axes[1], finger.centres[1])
    return np.concatenate([*hinges, finger.proximal_map, finger.distal_map, *(m.ravel() for m in finger.markers)])


def _model(finger: Finger, x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Markers (n, markers, 3) m of the declared kinematics with figures x (see _pack) at q %."""
    axis1, centre1, axis2, centre2, proximal_map, distal_map = np.split(x[:21], [3, 6, 9, 12, 16])
    end = 21 + 3 * len(finger.labels[0])
    proximal_markers, distal_markers = x[21:end].reshape(-1, 3), x[end:].reshape(-1, 3)
    proximal = finger.full[0] * np.polyval(proximal_map[::-1], q / 100)
    distal = finger.full[1] * np.polyval(distal_map[::-1], proximal / finger.full[0])
    turn1, turn2 = turned_about(axis1, proximal), turned_about(axis2, distal)
    placed = centre2 + np.einsum("nij,kj->nki", turn2, distal_markers - centre2)
    return np.concatenate(
        [
            centre1 + np.einsum("nij,kj->nki", turn1, proximal_markers - centre1),
            centre1 + np.einsum("nij,nkj->nki", turn1, placed - centre1),
        ],
        1,
    )
