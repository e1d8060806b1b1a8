"""What the cameras see: a slowly swaying palm, probe, marker noise, gaps."""

from pathlib import Path

import ezc3d
import numpy as np
from scipy.spatial.transform import Rotation

RATE = 100.0
SWAY_HZ = (0.05, 0.16, 0.37)
PROBE_MM = np.array([[0.0, 0.0, 85.0], [0.0, 0.0, 125.0], [34.0, 0.0, 110.0], [-26.0, 8.0, 118.0]])


def _sway(times: np.ndarray, size: float, rng: np.random.Generator) -> np.ndarray:
    """(frames, 3): three sinusoids of random amplitude and phase per axis."""
    out = np.zeros((len(times), 3))
    for hertz in SWAY_HZ:
        phase, amplitude = rng.uniform(0, 2 * np.pi, 3), rng.normal(0, size, 3)
        out += amplitude * np.sin(2 * np.pi * hertz * times[:, None] + phase)
    return out


class Room:
    """Where the hand stood in a session: its pose in the mocap world (mm), and the cameras' noise."""

    def __init__(self, noise_mm: float, rng: np.random.Generator) -> None:
        self.noise_mm, self.rng = noise_mm, rng
        self.turn = Rotation.from_euler("zyx", rng.normal(0, [0.3, 0.35, 0.35]))
        self.place = rng.normal([360.0, -220.0, 1085.0], [40.0, 35.0, 55.0])

    @property
    def up_palm(self) -> np.ndarray:
        """The world's vertical in the palm frame."""
        return self.turn.inv().apply([0.0, 0.0, 1.0])

    def to_world(self, points: np.ndarray, times: np.ndarray) -> np.ndarray:
        """(frames, markers, 3) from the palm frame into the world, with sway."""
        sway = Rotation.from_rotvec(_sway(times, 0.0075, self.rng)) * self.turn
        shift = self.place + _sway(times, 1.9, self.rng)
        return np.stack([sway.apply(points[:, i]) for i in range(points.shape[1])], axis=1) + shift[:, None]

    def see(self, points: np.ndarray) -> np.ndarray:
        """Add noise and gaps (3 to 19 frames, 0.3 per 1000 frames and marker)."""
        seen = points + self.rng.normal(0, self.noise_mm, points.shape)
        for marker in range(points.shape[1]):
            for start in np.flatnonzero(self.rng.random(len(points)) < 0.0003):
                seen[start : start + int(self.rng.integers(3, 20)), marker] = np.nan
        return seen

    def probe(self, tip_palm: np.ndarray, palm: np.ndarray, frames: int) -> np.ndarray:
        """(frames, 7, 3): palm markers and the four probe markers, tip held on a point of the palm frame."""
        times = np.arange(frames) / RATE
        body = np.tile(np.vstack([palm, tip_palm]), (frames, 1, 1))
        world = self.to_world(body, times)
        lean = Rotation.from_rotvec(self.rng.normal(0, 0.35, 3))
        wave = Rotation.from_rotvec(_sway(8 * times, 0.06, self.rng)) * lean
        tool = np.stack([wave.apply(p) for p in PROBE_MM], axis=1) + world[:, 3:]
        return self.see(np.concatenate([world[:, :3], tool], axis=1))


def write_c3d(path: Path, labels: list[str], points: np.ndarray) -> None:
    """Markers (frames, markers, 3) in mm, NaN where occluded."""
    frames, markers, _ = points.shape
    file = ezc3d.c3d()
    data = np.ones((4, markers, frames))
    data[:3] = points.transpose(2, 1, 0)
    file["data"]["points"] = data
    residuals = np.where(np.isnan(points[:, :, 0]), -1.0, 0.0).T[None]
    file["data"]["meta_points"]["residuals"] = residuals
    file["data"]["meta_points"]["camera_masks"] = np.zeros((7, markers, frames), dtype=bool)
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = labels
    file.write(str(path))
