"""Markers that move on what they are fixed to, or are confused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sixth_recorder.effects.law import Context, Law
from sixth_recorder.finger import SEGMENTS
from sixth_recorder.lab import PALM_LABELS
from sixth_recorder.machine import Machine, Segments, Truth
from sixth_recorder.vectors import turned_by


def _slip(x: Context) -> tuple[Callable[[np.ndarray], np.ndarray], dict[str, Any]]:
    """How much (0..1) of a slip there is at times (s) of the session: it begins in the first or second recorded flexion
    of the finger, as a step, two steps or a creep, and is sometimes put back after that trial."""
    trial = x.flexions[0] if x.rng.random() < 0.7 else x.flexions[1]
    fraction = x.uniform(0.25, 0.75)
    begin = trial["t0"] + fraction * trial["duration"]
    law, length = x.pick("step", "step", "creep", "two_steps"), x.uniform(1.5, 5)
    put_back = bool(x.rng.random() < 0.3)
    end = trial["t0"] + trial["duration"] + 3

    def share(at: np.ndarray) -> np.ndarray:
        if law == "step":
            y = (at > begin) * 1.0
        elif law == "creep":
            y = np.clip((at - begin) / length, 0, 1)
        else:
            y = 0.6 * (at > begin) + 0.4 * (at > begin + length)
        return np.where(at > end, 0, y) if put_back else y

    parameters = {"law": law, "trial": trial["name"], "at_fraction": fraction, "put_back_after_trial": put_back}
    return share, parameters


def marker_slip(x: Context) -> Law:
    """One marker slips along its segment; the amplitude in m."""
    s = x.pick(0, 1)
    i = int(x.rng.integers(len(x.finger.labels[s])))
    direction = x.direction((1, 1, 0.6))
    share, parameters = _slip(x)

    def hide(machine: Machine, amplitude: float) -> None:
        def shift(segments: Segments, at: np.ndarray, truth: Truth) -> None:
            segments[s][:, i] += amplitude * share(at)[:, None] * direction

        machine.on_segment.append(shift)

    return Law({**parameters, "marker": x.finger.labels[s][i], "direction": direction.tolist()}, hide, 1e-3, 4e-3)


def support_slip(x: Context) -> Law:
    """All markers of a segment turn together; the amplitude in rad."""
    s = x.pick(0, 1)
    axis = x.rng.normal(size=3) + 1.2 * np.array([1, 0, 0])
    axis /= np.linalg.norm(axis)
    share, parameters = _slip(x)
    foot = x.finger.markers[s].mean(0) - [0, 0, 0.012]

    def hide(machine: Machine, amplitude: float) -> None:
        def turn(segments: Segments, at: np.ndarray, truth: Truth) -> None:
            turns = turned_by(amplitude * share(at)[:, None] * axis)
            segments[s] = foot + np.einsum("nij,nkj->nki", turns, segments[s] - foot)

        machine.on_segment.append(turn)

    return Law({**parameters, "segment": SEGMENTS[s], "axis": axis.tolist()}, hide, 0.03, 0.2)


def palm_marker_slip(x: Context) -> Law:
    """One marker of the palm slips; the amplitude in m."""
    i = int(x.rng.integers(3))
    direction = x.direction()
    share, parameters = _slip(x)

    def hide(machine: Machine, amplitude: float) -> None:
        def shift(at: np.ndarray) -> np.ndarray:
            y = np.zeros((len(at), 3, 3))
            y[:, i] = amplitude * share(at)[:, None] * direction
            return y

        x.lab.palm_slips.append(shift)
        machine.palm = shift

    return Law({**parameters, "marker": PALM_LABELS[i], "direction": direction.tolist()}, hide, 1e-3, 5e-3)


def marker_swap(x: Context) -> Law:
    """Two labels are exchanged for a while; the amplitude in s."""
    labels_of = x.finger.labels
    trial = x.pick(*x.flexions[:2])
    if x.rng.random() < 0.7:
        one, two = (str(label) for label in x.rng.choice(labels_of[x.pick(0, 1)], 2, replace=False))
    else:
        one, two = x.pick(*labels_of[0]), x.pick(*labels_of[1])
    fraction, length = x.uniform(0.1, 0.8), x.uniform(0.6, 3.0)

    def hide(machine: Machine, amplitude: float) -> None:
        def swap(points: np.ndarray, labels: list[str], t: np.ndarray, of: dict[str, Any]) -> np.ndarray:
            if of["name"] != trial["name"]:
                return points
            begin = fraction * trial["duration"]
            frames = (t > begin) & (t < begin + amplitude)
            i, j = labels.index(one), labels.index(two)
            points = points.copy()
            points[frames, i], points[frames, j] = points[frames, j], points[frames, i]
            return points

        machine.on_points.append(swap)

    return Law({"markers": [one, two], "trial": trial["name"], "at_fraction": fraction}, hide, length, length)
