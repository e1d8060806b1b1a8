"""Physics that the vocabulary lacks."""

import numpy as np

from eighth_recorder.effect import Effect, either
from eighth_recorder.simulate import GRID


class PreloadDrift(Effect):
    name = "preload_drift"

    def draw(self, rng, strength, finger, hand):
        return {"change": strength * either(rng) * rng.uniform(0.3, 0.6), "time_constant": rng.uniform(10, 40)}

    def motor(self, p, run):
        run.inputs["ext"] += p["change"] * run.constants["Fc"] * (1 - np.exp(-run.time / p["time_constant"]))


class Swaying(Effect):
    """A load that is periodic in time, whatever the finger does (a neighbouring pump, tremor of the holder)."""

    name = "periodic_in_time"

    def draw(self, rng, strength, finger, hand):
        return {
            "amplitude": strength * rng.uniform(0.12, 0.28),
            "frequency": rng.uniform(0.35, 2.5),
            "phase": rng.uniform(0, 2 * np.pi),
        }

    def motor(self, p, run):
        run.inputs["ext"] += (
            p["amplitude"] * run.constants["Fc"] * np.sin(2 * np.pi * p["frequency"] * run.time + p["phase"])
        )


class Grit(Effect):
    """Grains between teeth: short bursts of friction at random moments."""

    name = "grit"

    def draw(self, rng, strength, finger, hand):
        return {
            "rate": rng.uniform(0.3, 0.7),
            "amplitude": strength * rng.uniform(0.4, 0.9),
            "seconds": rng.uniform(0.1, 0.35),
        }

    def motor(self, p, run):
        for start in np.cumsum(run.rng.exponential(1 / p["rate"], 200)):
            inside = (run.time > start) & (run.time < start + p["seconds"])
            run.inputs["dirt"][inside] += p["amplitude"] * run.constants["Fc"] * run.rng.uniform(0.5, 1.0)


class Ageing(Effect):
    """Friction that grows while at rest and fades, in time, once moving."""

    name = "dwell_ageing"

    def draw(self, rng, strength, finger, hand):
        return {
            "amplitude": strength * rng.uniform(0.6, 1.1),
            "grows_in": rng.uniform(0.15, 0.5),
            "fades_in": rng.uniform(0.3, 0.9),
        }

    def motor(self, p, run):
        run.constants.update(age_amp=p["amplitude"], age_tau=p["grows_in"], age_fade=p["fades_in"])


class Resonance(Effect):
    """A mass that hangs on the finger by a spring and rings after each start."""

    name = "sprung_mass"

    def draw(self, rng, strength, finger, hand):
        return {
            "mass": strength * rng.uniform(1.0, 2.5),
            "frequency": rng.uniform(2.0, 5.0),
            "damping_ratio": rng.uniform(0.03, 0.08),
        }

    def motor(self, p, run):
        mass, w = p["mass"] * run.constants["m"], 2 * np.pi * p["frequency"]
        run.constants.update(mass_m=mass, mass_k=mass * w**2, mass_c=2 * p["damping_ratio"] * mass * w)


class TendonLoosening(Effect):
    """The encoder slips a little on its shaft at each full closing."""

    name = "encoder_creep"

    def draw(self, rng, strength, finger, hand):
        return {"per_reversal": strength * either(rng) * rng.uniform(0.3, 0.7)}

    def output(self, p, run):
        closings = np.cumsum(np.maximum(np.diff(run.reference, prepend=run.reference[0]) * -1, 0)) / 100
        run.output = run.output + p["per_reversal"] * closings


class LateralClearance(Effect):
    """The segment leans to one side while flexing and to the other while extending."""

    name = "lateral_clearance"

    def draw(self, rng, strength, finger, hand):
        return {"lean_rad": strength * rng.uniform(0.02, 0.045), "settles_in": rng.uniform(0.05, 0.2)}

    def angles(self, p, run):
        axis = np.cross(run.finger.axes[0], [1.0, 0, 0])
        lean, way = np.zeros(run.n), np.sign(run.v)
        state = -1.0
        for j in range(0, run.n, 10):
            state += (way[j] - state) * 10 * GRID / p["settles_in"] if abs(run.v[j]) > 0.5 else 0.0
            lean[j : j + 10] = state
        run.tilt[0].append((axis, p["lean_rad"] * lean / 2))


OUTSIDE_PHYSICS = (PreloadDrift(), Swaying(), Grit(), Ageing(), Resonance(), TendonLoosening(), LateralClearance())
