"""One healthy finger, which is exactly what a session declares: hinges, coupling, markers, encoder, drive."""

from __future__ import annotations

import numpy as np

from sixth_recorder.plant import Plant
from sixth_recorder.vectors import unit

# Plausible hinges of a left hand (a right one is mirrored in y): axes and centres (m), proximal then distal.
HINGES = {
    "index": ([0.092, 0.986, 0.141], [0.113, 0.988, 0.102], [0.045, -0.027, 0.004], [0.076, -0.033, 0.005]),
    "middle": ([0.059, 0.998, 0.038], [0.065, 0.997, 0.045], [0.047, -0.009, 0.009], [0.082, -0.015, 0.018]),
    "ring": ([0.026, 0.993, -0.112], [0.054, 0.996, -0.076], [0.048, 0.007, 0.009], [0.081, 0.006, 0.017]),
    "little": ([-0.048, 0.989, -0.133], [0.020, 0.985, -0.170], [0.045, 0.027, 0.004], [0.076, 0.029, 0.013]),
}
SEGMENTS = ("proximal", "distal")


class Finger:
    """Geometry (m, rad, palm frame; lists are proximal, distal) and healthy plant of one finger.

    proximal_map, distal_map: coefficients, lowest power first, of angle shares over shares of the range and of the
    proximal angle. scale: of every load of the drive. jitter: of the encoder, counts."""

    def __init__(self, rng: np.random.Generator, name: str, mirror: bool) -> None:
        self.name = name
        a1, a2, c1, c2 = (np.array(x) for x in HINGES[name])
        of_point = np.array([1, -1, 1.0]) if mirror else np.ones(3)
        of_axis = np.array([-1, 1, -1.0]) if mirror else np.ones(3)  # a pseudo-vector
        self.axes = [unit(a1 * of_axis + rng.normal(0, 0.04, 3)), unit(a2 * of_axis + rng.normal(0, 0.04, 3))]
        self.centres = [c1 * of_point + rng.normal(0, 0.002, 3), c2 * of_point + rng.normal(0, 0.002, 3)]
        self.full = [rng.uniform(1.1, 1.5), rng.uniform(0.9, 1.35)]
        self._draw_maps(rng)
        self._draw_markers(rng)
        self.open, self.counts = int(rng.integers(500, 14000)), int(rng.integers(3500, 9500))
        self.resolution = int(rng.choice([1, 1, 1, 2, 4]))
        self.jitter = rng.uniform(0.5, 4.5) * self.counts / 6000
        self.scale = float(np.exp(rng.uniform(np.log(0.6), np.log(1.6))))
        self.plant = _draw_plant(rng, self.scale)

    def proximal(self, q: np.ndarray) -> np.ndarray:
        """Proximal angle (rad) at q % of the range."""
        return self.full[0] * np.polyval(self.proximal_map[::-1], q / 100)

    def distal(self, proximal: np.ndarray) -> np.ndarray:
        """Distal angle (rad) at a proximal angle (rad)."""
        return self.full[1] * np.polyval(self.distal_map[::-1], proximal / self.full[0])

    def _draw_maps(self, rng: np.random.Generator) -> None:
        x = np.linspace(-0.02, 1.02, 50)
        while True:
            self.proximal_map = np.array([0, 0, rng.uniform(-0.14, 0.14), rng.uniform(-0.1, 0.1)])
            self.proximal_map[1] = 1 - self.proximal_map.sum()
            quartic = [rng.uniform(-0.1, 0.5), rng.uniform(-0.15, 0.15), rng.uniform(-0.1, 0.1)]
            self.distal_map = np.array([0, 0, *quartic])
            self.distal_map[1] = 1 - self.distal_map.sum()
            slopes = (np.polyval(np.polyder(c[::-1]), x) for c in (self.proximal_map, self.distal_map))
            if min(s.min() for s in slopes) > 0.3:
                return

    def _draw_markers(self, rng: np.random.Generator) -> None:
        self.markers: list[np.ndarray] = []
        self.labels: list[list[str]] = []
        up = np.array([0, 0, 1.0])
        tag = self.name[:3].upper()
        c1, c2 = self.centres
        tip = c2 + unit(c2 - c1) * rng.uniform(0.026, 0.036)
        for letter, begin, end in (("P", c1, c2), ("D", c2, tip)):
            n = int(rng.choice([3, 3, 4]))
            points = _markers_between(rng, begin, end, up, n)
            while not _well_spread(points):
                points = _markers_between(rng, begin, end, up, n)
            self.markers.append(points)
            self.labels.append([f"{tag}_{letter}{i + 1}" for i in range(n)])


def _markers_between(
    rng: np.random.Generator, begin: np.ndarray, end: np.ndarray, up: np.ndarray, n: int
) -> np.ndarray:
    return np.array(
        [
            begin
            + (end - begin) * rng.uniform(0.2, 0.95)
            + up * rng.uniform(0.007, 0.018)
            + np.array([0, rng.uniform(-0.011, 0.011), 0])
            for _ in range(n)
        ]
    )


def _well_spread(points: np.ndarray) -> bool:
    n = len(points)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)[np.triu_indices(n, 1)]
    arms = points - points[0]
    area = max(np.linalg.norm(np.cross(arms[j], arms[k])) / 2 for j in range(1, n) for k in range(j + 1, n))
    return apart.min() > 0.011 and area > 7e-5


def _draw_plant(rng: np.random.Generator, scale: float) -> Plant:
    plant = Plant()
    p = plant.p
    p["M_"] = scale * rng.uniform(0.009, 0.016)
    p["B_"] = scale * rng.uniform(0.09, 0.2)
    p["FC"] = scale * rng.uniform(28, 44)
    p["TAU0"] = scale * rng.uniform(4, 11)
    p["K_"] = min(scale * rng.uniform(0.14, 0.27), (0.85 * p["FC"] - p["TAU0"]) / 100)  # friction holds it when flexed
    p["ILIM"] = 255
    p["PREF"] = p["FC"] * 1.7
    p["THREF"] = p["FC"] * 1.5
    p["THTAU"] = 60
    p["SAGTAU"] = 0.01
    p.update(dict.fromkeys(("MXT1", "MXT2", "MXT3", "DWT", "DWD", "IWD", "BWD"), 1))
    return plant
