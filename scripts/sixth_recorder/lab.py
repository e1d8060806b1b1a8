"""What a laboratory draws for one session: hand, instruments, controller, pose, and by `protocol` the trials."""

from __future__ import annotations

from typing import Any

import numpy as np

from sixth_recorder.finger import HINGES, Finger
from sixth_recorder.protocol import Conduct, draw_trials
from sixth_recorder.vectors import turned_by, unit

CONTROLLERS = ("PI speed servo with ramps", "position servo", "trapezoid tracking", "minimum-jerk tracking")
PALM_LABELS = ["PO", "PM", "PL"]
WORLD_CENTRE = np.array([0.4, -0.25, 1.1])  # m, about where the palm is
DOWN = np.array([0, 0, -1.0])


class Lab:
    """Everything about a session but what is hidden. Lengths in m, rates in 1/s, currents raw, speeds in %/s.

    palm_slips: functions of times (s) of the session giving shifts (n, 3 markers, 3) of the palm markers; an effect of
    the markers adds to them. turned: whether the hand is held in another way in the second trials."""

    def __init__(self, rng: np.random.Generator, kind: str, turned: bool | None = None) -> None:
        self.rng = rng
        weak = kind == "weak"
        self.palm_slips: list = []
        self.side = str(rng.choice(["left", "right"]))
        mirror = self.side == "right"
        names = [str(x) for x in rng.choice(list(HINGES), 2, replace=False)]
        self.fingers = [Finger(rng, name, mirror) for name in names]
        self._draw_palm(rng, 1 if mirror else -1)
        self._draw_instruments(rng, weak)
        self.turned = bool(rng.random() < 0.3) if turned is None else turned
        self.excitation_mocap = self.turned or bool(rng.random() < 0.2)
        self.temperature = bool(rng.random() < 0.2)
        self.noise_factor = float(rng.uniform(1.4, 1.8)) if weak else 1.0
        self.sway = rng.uniform(0.2, 0.9) * 1e-3, rng.uniform(0.002, 0.008)  # m, rad
        self._draw_control(rng)
        self.pose0 = turned_by(rng.normal(0, 1, (1, 3)))[0], WORLD_CENTRE + rng.normal(0, 0.08, 3)
        axis = unit(rng.normal(0, 1, 3))
        turn = axis * rng.uniform(1.0, 1.9)
        conduct = Conduct(
            self.control,
            self.speed_full,
            self.acceleration,
            self.restless,
            turn if self.turned else np.zeros(3),
            self.excitation_mocap,
            weak,
        )
        self.trials, self.t_end = draw_trials(rng, conduct, [f.name for f in self.fingers])

    def rotation(self, trial: dict[str, Any]) -> np.ndarray:
        """How the palm is held in a trial: palm to world."""
        return turned_by(trial["pose"][None])[0] @ turned_by(trial["pause"][None])[0] @ self.pose0[0]

    def gravity_palm(self, trial: dict[str, Any]) -> np.ndarray:
        """Direction of gravity in the palm frame."""
        return self.rotation(trial).T @ DOWN

    def _draw_palm(self, rng: np.random.Generator, medial: int) -> None:
        x, y = rng.uniform(0.034, 0.042), rng.uniform(0.017, 0.023)
        self.landmarks = {
            "origin": np.zeros(3),
            "medial": np.array([x, medial * y, 0]),
            "lateral": np.array([x + rng.uniform(-0.002, 0.002), -medial * y, 0]),
        }
        places = [[-0.012, 0, 0.013], [0.034, medial * 0.024, 0.014], [0.036, -medial * 0.021, 0.010]]
        self.palm = np.array(places) + rng.normal(0, 0.003, (3, 3))

    def _draw_instruments(self, rng: np.random.Generator, weak: bool) -> None:
        self.sigma_marker = rng.uniform(0.08, 0.22) * 1e-3 if weak else rng.uniform(0.05, 0.3) * 1e-3
        self.marker_coloured = rng.uniform(0.1, 0.35)  # share of the variance
        self.rate_mocap, self.rate_log = float(rng.choice([100, 120, 150, 200, 240])), rng.uniform(35, 100)
        self.clock_offset = rng.uniform(50, 5000)  # s
        self.log_jitter = rng.uniform(0.1, 0.35)  # share of a period
        self.lost = rng.uniform(0, 0.008)  # share of the rows
        self.empty = float(rng.choice([0, 0, rng.uniform(0.001, 0.004)]))  # share of the cells
        self.occlusion = rng.uniform(0.001, 0.008)
        self.current_quantum = float(rng.choice([1, 1, 1, 0.5, 2]))
        self.current_coloured = rng.uniform(0.1, 0.45)  # share of the variance
        self.current_memory = rng.uniform(0.5, 0.9)
        self.sigma_current = {f.name: f.scale * rng.uniform(2.2, 5.2) for f in self.fingers}
        self.restless = rng.uniform(0.008, 0.02)  # of friction, from move to move
        self.speed_full = rng.uniform(80, 125)

    def _draw_control(self, rng: np.random.Generator) -> None:
        self.control = int(rng.integers(4))
        tracking = self.control > 1
        common = {
            "MODE": min(self.control, 2),
            "PROF": int(self.control == 3),
            "TS": float(rng.choice([0.001, 0.001, 0.002])),
            "ACC": rng.uniform(500, 1400),
            "HOLD": float(rng.choice([0, 0, 2, 1])),
            "DB": rng.uniform(0.15, 0.5) if tracking else rng.uniform(0.2, 1.5),
        }
        for finger in self.fingers:
            p, scale = finger.plant.p, finger.scale
            p.update(common)
            p["KP"] = scale * rng.uniform(0.9, 1.7)
            p["KI"] = scale * rng.uniform(30, 60)
            p["FF"] = rng.uniform(0.6, 0.95)
            p["KX"] = scale * rng.uniform(18, 35) if tracking else rng.uniform(9, 16)
            if tracking:
                p["KI"] = scale * rng.uniform(60, 130)
        if self.control == 3:
            self.speed_full *= 0.85
        self.acceleration = common["ACC"]
