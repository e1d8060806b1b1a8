"""One trial of one finger: simulate, move the segments, record log and markers."""

import numpy as np

from eighth_recorder import moves
from eighth_recorder.simulate import GRID, run_motor


class Run:
    """What a trial holds; effects reach in between the stages."""

    def __init__(self, hand, finger, kind, number, rng, state):
        self.hand, self.finger, self.kind, self.number, self.rng, self.state = hand, finger, kind, number, rng, state
        plan = moves.schedule(moves.targets_of(kind, number > 0, hand.short), hand.full_speed)
        self.n = len(plan["target"])
        self.time = np.arange(self.n) * GRID
        self.length = self.n * GRID
        zero = np.zeros(self.n)
        self.inputs = {
            "target": plan["target"],
            "pace": plan["pace"],
            **{k: zero.copy() for k in ("gate", "away", "gc", "gs", "ext", "dirt")},
        }
        self.told = dict(plan)
        self.constants = dict(finger.motor)
        self.rows, self.local, self.points, self.frame_time = {}, None, None, None

    def each(self, stage):
        for effect, parameters in self.finger.hidden:
            getattr(effect, stage)(parameters, self)

    def at(self, values, time):
        return np.interp(time, self.time, values)

    def simulate(self):
        self.each("motor")
        start = -self.rng.uniform(0.05, 0.25)
        out = run_motor(self.constants, self.state, start, self.inputs)
        self.x, self.v, self.current, self.reference = out["x"], out["v"], out["current"], out["reference"]
        self.output = self.x.copy()
        self.each("output")
        self.proximal = self.proximal_of(self.output)
        self.distal = self.distal_of(self.proximal)
        self.tilt, self.shift = [[], []], [np.zeros((self.n, 3)), np.zeros((self.n, 3))]
        self.each("angles")

    def proximal_of(self, x):
        u, c = x / 100, self.finger.curve
        return self.finger.full[0] * (c[0] * u + c[1] * u**2 + c[2] * u**3)

    def distal_of(self, proximal):
        s, c = proximal / self.finger.full[0], self.finger.coupling
        return self.finger.full[1] * (c[0] * s + c[1] * s**2)

    def record_log(self):
        """Rows at irregular times; noise, rounding, then what happens to the written lines."""
        hand, rng = self.hand, self.rng
        period = 1 / hand.log_rate
        n = int(self.length / period * 1.3)
        time = rng.uniform(0, 0.04) + np.cumsum(period * (1 + hand.jitter * rng.uniform(-1, 1, n)))
        time = time[(time < self.length - 0.005) & (rng.random(n) > hand.lost_rows)]
        low, high = self.finger.counts
        counts = self.x + self.constants["enc_amp"] * np.sin(
            2 * np.pi * self.x / self.constants["enc_period"] + self.constants["enc_phase"]
        )
        index = np.minimum((time / GRID).astype(int), self.n - 1)
        self.rows = {
            "time": time,
            "position": low + self.at(counts, time) * (high - low) / 100,
            "current": self.at(self.current, time),
            "setpoint": low + self.told["target"][index] * (high - low) / 100,
            "speed": self.told["speed"][index].astype(float),
            "current_limit": np.full(len(time), 255.0),
        }
        self.true_time = time
        self.noise = {
            "position": rng.normal(0, self.finger.position_noise, len(time)),
            "current": rng.normal(0, self.finger.current_noise, len(time)),
        }
        self.stamp = time.copy()
        self.each("log")
        for name, noise in self.noise.items():
            self.rows[name] = np.round(self.rows[name] + noise)
        self.each("lines")
        self.rows["time"] = self.stamp
        return self.rows
