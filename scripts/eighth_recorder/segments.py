"""Effects of the joints themselves: a second rotation, a travelling centre."""

import numpy as np

from eighth_recorder.effect import JOINTS, Effect, law_of


class JointWobble(Effect):
    name = "joint_wobble"
    part = "segments"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("sine of the angle", 0.6), ("proportional", 0.4))
        joint = int(rng.integers(2))
        side = np.cross(finger.axes[joint], [1.0, 0, 0])
        side = np.cross(side, finger.axes[joint]) * np.cos(a := rng.uniform(0, np.pi)) + side * np.sin(a)
        return {
            "law": law,
            "joint": JOINTS[joint],
            "axis": side.tolist(),
            "amplitude_rad": strength * rng.uniform(0.018, 0.04),
            "waves": rng.uniform(0.6, 1.4),
            "phase": rng.uniform(0, 2 * np.pi),
        }

    def angles(self, p, run):
        joint = JOINTS.index(p["joint"])
        share = (run.proximal, run.distal)[joint] / run.finger.full[joint]
        if p["law"] == "proportional":
            angle = p["amplitude_rad"] * share * (1 if p["phase"] < np.pi else -1)
        else:
            angle = p["amplitude_rad"] * (np.sin(2 * np.pi * p["waves"] * share + p["phase"]) - np.sin(p["phase"]))
        run.tilt[joint].append((np.array(p["axis"]), angle))


class MovingCentre(Effect):
    name = "moving_centre"
    part = "segments"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("rolling", 0.55), ("cam", 0.45))
        joint = int(rng.integers(2))
        away = np.cross(finger.axes[joint], rng.normal(0, 1, 3))
        return {
            "law": law,
            "joint": JOINTS[joint],
            "direction": (away / np.linalg.norm(away)).tolist(),
            "travel_mm": strength * rng.uniform(1.3, 2.8),
        }

    def angles(self, p, run):
        joint = JOINTS.index(p["joint"])
        share = (run.proximal, run.distal)[joint] / run.finger.full[joint]
        path = share if p["law"] == "rolling" else np.sin(np.pi * share)
        run.shift[joint] = run.shift[joint] + p["travel_mm"] * path[:, None] * np.array(p["direction"])


SEGMENTS = (JointWobble(), MovingCentre())
