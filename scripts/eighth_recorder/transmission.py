"""Effects between the encoder and the two segments."""

import numpy as np

from eighth_recorder.effect import Effect, law_of
from eighth_recorder.simulate import GRID, play


def smoothed(values, seconds):
    """Trailing mean over twice the given time."""
    window = max(1, round(2 * seconds / GRID))
    padded = np.concatenate([np.full(window, values[0]), values])
    total = np.cumsum(padded)
    return (total[window:] - total[:-window]) / window


def joint_load(run, law):
    """What the linkage carries [raw units]: the whole drive torque, or the spring and a part of the friction."""
    torque = smoothed(run.current, 0.015)
    if law == "drive torque":
        return torque
    way = smoothed(np.tanh(run.v / 2.0), 0.04)
    return run.constants["k"] * run.x + run.constants["tau0"] + 0.7 * run.constants["Fc"] * way


class DriveBacklash(Effect):
    name = "drive_backlash"

    def draw(self, rng, strength, finger, hand):
        return {"law": "play", "play": strength * rng.uniform(1.2, 2.8)}

    def output(self, p, run):
        run.output = play(run.output, p["play"])


class SeriesElasticity(Effect):
    name = "series_elasticity"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("drive torque", 0.5), ("joint load", 0.5))
        return {"law": law, "give_at_friction": strength * rng.uniform(0.7, 1.5)}

    def output(self, p, run):
        run.output = run.output - p["give_at_friction"] / run.constants["Fc"] * joint_load(run, p["law"])


class LinkageBacklash(Effect):
    name = "linkage_backlash"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("play of the distal angle", 0.6), ("play of the proximal angle", 0.4))
        return {"law": law, "play_rad": strength * rng.uniform(0.016, 0.034)}

    def angles(self, p, run):
        if "distal" in p["law"]:
            run.distal = play(run.distal, p["play_rad"]) + p["play_rad"] / 2
        else:
            run.distal = run.distal_of(play(run.proximal, p["play_rad"]))


class LinkageCompliance(Effect):
    name = "linkage_compliance"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("drive torque", 0.5), ("joint load", 0.5))
        return {"law": law, "give_at_friction_rad": strength * rng.uniform(0.008, 0.018)}

    def angles(self, p, run):
        run.distal = run.distal - p["give_at_friction_rad"] / run.constants["Fc"] * joint_load(run, p["law"])


class CouplingDeadband(Effect):
    name = "coupling_deadband"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("hard", 0.75), ("soft", 0.25))
        return {"law": law, "band_rad": strength * rng.uniform(0.1, 0.22), "softness_rad": 0.02}

    def angles(self, p, run):
        beyond = run.proximal - p["band_rad"]
        moved = (
            np.maximum(beyond, 0)
            if p["law"] == "hard"
            else p["softness_rad"] * np.logaddexp(0, beyond / p["softness_rad"])
        )
        run.distal = run.distal_of(moved)


class DistalStop(Effect):
    name = "distal_stop"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("hard", 0.75), ("soft", 0.25))
        return {"law": law, "at": 1 - strength * rng.uniform(0.09, 0.2), "softness_rad": 0.02}

    def angles(self, p, run):
        most = p["at"] * float(run.distal_of(run.proximal_of(np.array(97.0))))
        if p["law"] == "hard":
            run.distal = np.minimum(run.distal, most)
        else:
            run.distal = most - p["softness_rad"] * np.logaddexp(0, (most - run.distal) / p["softness_rad"])


class SpringDecoupling(Effect):
    name = "spring_decoupling"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("weight", 0.55), ("pushes", 0.45))
        starts = np.sort(rng.uniform(0.1, 0.9, 3))
        return {
            "law": law,
            "until": strength * rng.uniform(7, 14),
            "starts": starts.tolist(),
            "seconds": rng.uniform(0.9, 1.8),
            "lift": strength * rng.uniform(5, 12),
        }

    def motor(self, p, run):
        if p["law"] == "weight":
            run.constants["weight"] = run.constants["k"] * p["until"] + run.constants["tau0"]
            return
        run.lift = np.zeros(run.n)
        for share in p["starts"]:
            phase = (run.time - share * run.length) / p["seconds"]
            inside = (phase > 0) & (phase < 1)
            run.lift[inside] = np.maximum(run.lift[inside], p["lift"] * np.sin(np.pi * phase[inside]) ** 2)
        run.inputs["away"] = np.maximum(run.inputs["away"], np.minimum(1.0, run.lift / 1.5))

    def output(self, p, run):
        run.output = np.maximum(run.output, p["until"]) if p["law"] == "weight" else run.output + run.lift


TRANSMISSION = (
    DriveBacklash(),
    SeriesElasticity(),
    LinkageBacklash(),
    LinkageCompliance(),
    CouplingDeadband(),
    DistalStop(),
    SpringDecoupling(),
)
