"""Effects of markers and their supports."""

import numpy as np

from eighth_recorder.body import rotation
from eighth_recorder.effect import JOINTS, Effect, law_of


def _direction(rng):
    way = rng.normal(0, 1, 3)
    return way / np.linalg.norm(way)


def after(p, run):
    """Frames after the slip: at the same share of every trial, or once and for good."""
    if p["law"] == "once" and run.number > 0:
        return np.ones(len(run.frame_time), bool)
    return run.frame_time > p["at"] * run.length


def _laws(rng):
    return law_of(rng, ("in each trial", 0.55), ("once", 0.45))


class MarkerSlip(Effect):
    name = "marker_slip"
    part = "markers"

    def draw(self, rng, strength, finger, hand):
        segment, marker = int(rng.integers(2)), int(rng.integers(3))
        return {
            "law": _laws(rng),
            "joint": JOINTS[segment],
            "marker": finger.labels[3 * segment + marker],
            "at": rng.uniform(0.3, 0.7),
            "move_mm": (strength * rng.uniform(1.2, 2.2) * _direction(rng)).tolist(),
        }

    def local(self, p, run):
        segment, marker = divmod(run.finger.labels.index(p["marker"]), 3)
        run.local[segment + 1][after(p, run), marker] += p["move_mm"]


class SupportSlip(Effect):
    name = "support_slip"
    part = "markers"

    def draw(self, rng, strength, finger, hand):
        segment = int(rng.integers(2))
        return {
            "law": _laws(rng),
            "joint": JOINTS[segment],
            "at": rng.uniform(0.3, 0.7),
            "axis": _direction(rng).tolist(),
            "turn_rad": strength * rng.uniform(0.03, 0.065),
            "move_mm": (strength * rng.uniform(0.0, 0.6) * _direction(rng)).tolist(),
        }

    def local(self, p, run):
        part = run.local[1 + JOINTS.index(p["joint"])]
        late = after(p, run)
        foot = part[0].mean(axis=0) - [0, 0, 10.0]
        turn = rotation(np.array(p["axis"]), p["turn_rad"])[0]
        part[late] = (part[late] - foot) @ turn.T + foot + p["move_mm"]


class PalmMarkerSlip(Effect):
    name = "palm_marker_slip"
    part = "palm"

    def draw(self, rng, strength, finger, hand):
        marker = int(rng.integers(3))
        return {
            "law": _laws(rng),
            "marker": ("PO", "PM", "PL")[marker],
            "at": rng.uniform(0.3, 0.7),
            "move_mm": (strength * rng.uniform(1.3, 2.6) * _direction(rng)).tolist(),
        }

    def local(self, p, run):
        run.local[0][after(p, run), ("PO", "PM", "PL").index(p["marker"])] += p["move_mm"]


class MarkerSwap(Effect):
    name = "marker_swap"
    part = "markers"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("within a segment", 0.8), ("between segments", 0.2))
        segment = int(rng.integers(2))
        pair = (
            (3 * segment + rng.permutation(3)[:2])
            if law == "within a segment"
            else np.array([rng.integers(3), 3 + rng.integers(3)])
        )
        windows = [
            [float(rng.uniform(0.1, 0.85)), strength * float(rng.uniform(0.7, 3.0))] for _ in range(rng.integers(1, 3))
        ]
        return {
            "law": law,
            "joint": JOINTS[segment],
            "markers": [finger.labels[j] for j in pair],
            "marker": finger.labels[pair[0]],
            "windows": windows,
        }

    def labelled(self, p, run):
        a, b = (3 + run.finger.labels.index(label) for label in p["markers"])
        for share, seconds in p["windows"]:
            start = share * run.length
            inside = (run.frame_time > start) & (run.frame_time < start + seconds)
            held = run.points[inside, a].copy()
            run.points[inside, a] = run.points[inside, b]
            run.points[inside, b] = held


SLIPS = (MarkerSlip(), SupportSlip(), PalmMarkerSlip(), MarkerSwap())
