"""What is true of one finger in one session: its plant and whatever is hidden, and the noise-free truth of a trial."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sixth_recorder.finger import Finger
from sixth_recorder.plant import DT, Q_GRID, Plant, begin_trial, lag, play
from sixth_recorder.vectors import turned_about, turned_by

H = 1e-3  # s, step of the truth

Truth = dict[str, Any]
Stage = Callable[[np.ndarray, Truth], np.ndarray]
Segments = dict[int, np.ndarray]


class Machine:
    """A finger and what is hidden in it; empty lists are a healthy one.

    Stages turn one series at H into another, given the truth: drive_stages (% of the range), proximal_stages, joint
    angles (rad), coupling_stages, what of the proximal angle drives the distal joint (rad), distal_stages (rad),
    position_stages, what the encoder shows (%), current_stages, what the reading of the current shows (raw).

    The rest is called with what it changes: pose[segment] gives a rotation vector (rad) and a shift (m) at joint
    angles, on_segment shifts markers (m) in place at times of the session (s), reading_limits clip rounded currents,
    on_rows, on_points and on_world take rows of the log, points (mm) and places in the world (m), on_log_time stamps
    (s).

    palm, clock, scale, palm_load: what the observer of `size` has to know of hidden shifts of the palm markers, of the
    clock (s), of the scale of the volume, and which palm marker moves by how much (m) per raw current."""

    def __init__(self, finger: Finger) -> None:
        self.finger, self.plant = finger, finger.plant.copy()
        self.drive_stages: list[Stage] = []
        self.proximal_stages: list[Stage] = []
        self.coupling_stages: list[Stage] = []
        self.distal_stages: list[Stage] = []
        self.position_stages: list[Stage] = []
        self.current_stages: list[Stage] = []
        self.pose: tuple[list[Callable[[np.ndarray, Truth], tuple[np.ndarray, np.ndarray]]], ...] = ([], [])
        self.on_segment: list[Callable[[Segments, np.ndarray, Truth], None]] = []
        self.reading_limits: list[Callable[[np.ndarray, float], np.ndarray]] = []
        self.on_rows: list[Callable[[dict[str, np.ndarray], np.ndarray], dict[str, np.ndarray]]] = []
        self.on_points: list[Callable[[np.ndarray, list[str], np.ndarray, dict], np.ndarray]] = []
        self.on_world: list[Callable[[np.ndarray, np.ndarray], np.ndarray]] = []
        self.on_log_time: list[Callable[[np.ndarray], np.ndarray]] = []
        self.all_machines = [self]
        self.palm: Callable[[np.ndarray], np.ndarray] | None = None
        self.palm_load: tuple[int, np.ndarray] | None = None
        self.clock: Callable[[np.ndarray], np.ndarray] | None = None
        self.scale: Callable[[np.ndarray], np.ndarray] | None = None

    def run(self, trial: dict[str, Any], state: np.ndarray, quiet: bool = False) -> Truth:
        """The truth of a trial at H from `state` (changed in place); quiet: without restless friction.

        t s, q %, v %/s, a %/s^2, I raw, direction -1..1 (which way it moved last), a_slow and I_slow lagged 20 ms."""
        plant = self.plant
        begin_trial(state, np.exp(-trial["gap"] / plant.p["THTAU"]))
        if not quiet and len(trial["restless"]):
            plant = _restless(plant, trial)
        rows = plant.run(trial, state, round(trial["duration"] / DT))
        q, v, a, current = (rows[:, i].copy() for i in range(4))
        return {
            "t": np.arange(len(rows)) * H,
            "q": q,
            "v": v,
            "a": a,
            "I": current,
            "direction": np.clip((q - play(q, 0.6)) / 0.3, -1, 1),
            "a_slow": lag(a, H, 0.02, 0.02),
            "I_slow": lag(current, H, 0.02, 0.02),
            "t0": trial["t0"],
        }

    def angles(self, truth: Truth) -> tuple[np.ndarray, np.ndarray]:
        """Proximal and distal angle, rad."""
        q = through(self.drive_stages, truth["q"], truth)
        proximal = through(self.proximal_stages, self.finger.proximal(q), truth)
        driving = through(self.coupling_stages, proximal, truth)
        return proximal, through(self.distal_stages, self.finger.distal(driving), truth)

    def shown_position(self, truth: Truth) -> np.ndarray:
        """What the encoder shows, %."""
        q = truth["q"] + np.interp(truth["q"], Q_GRID, self.plant.encoder)
        return through(self.position_stages, q, truth)

    def shown_current(self, truth: Truth) -> np.ndarray:
        """What the reading of the current shows, raw."""
        return through(self.current_stages, truth["I"], truth)

    def markers(self, truth: Truth, index: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Markers (n, markers, 3) m of both segments in the palm frame, at indices and times (s) of the session."""
        finger, n, length = self.finger, len(index), len(truth["q"])
        angles = self.angles(truth)
        truth = {name: x[index] if isinstance(x, np.ndarray) and len(x) == length else x for name, x in truth.items()}
        segments = {s: np.repeat(finger.markers[s][None], n, 0) for s in (0, 1)}
        for shift in self.on_segment:
            shift(segments, at, truth)
        turns, shifts = [], []
        for s, angle in enumerate(a[index] for a in angles):
            turn, shift = np.zeros((n, 3)), np.zeros((n, 3))
            for pose in self.pose[s]:
                more_turn, more_shift = pose(angle, truth)
                turn += more_turn
                shift += more_shift
            hinge = turned_about(finger.axes[s], angle)
            turns.append(turned_by(turn) @ hinge if np.any(turn) else hinge)
            shifts.append(shift[:, None])
        c1, c2 = finger.centres
        proximal = c1 + shifts[0] + np.einsum("nij,nkj->nki", turns[0], segments[0] - c1)
        distal = c2 + shifts[1] + np.einsum("nij,nkj->nki", turns[1], segments[1] - c2)
        return proximal, c1 + shifts[0] + np.einsum("nij,nkj->nki", turns[0], distal - c1)


def through(stages: list[Stage], x: np.ndarray, truth: Truth) -> np.ndarray:
    """A series after all stages."""
    for stage in stages:
        x = stage(x, truth)
    return x


def _restless(plant: Plant, trial: dict[str, Any]) -> Plant:
    plant = plant.copy()
    begins, factors = np.array([move[0] for move in trial["moves"]]), np.r_[1, trial["restless"]]
    plant.per_trial.append(lambda _, t: {"friction_factor": factors[np.searchsorted(begins, t)]})
    return plant
