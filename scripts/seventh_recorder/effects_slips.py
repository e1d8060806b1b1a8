"""Effects of the markers themselves: slips and wrong labels."""

import numpy as np
from scipy.spatial.transform import Rotation

from .effect import JOINTS, Effect, Law, Settings, arrow, spread
from .plan import Plan

Rng = np.random.Generator


def _after(times: np.ndarray, part: float, over: float) -> np.ndarray:
    """0 before the part of the trial, 1 after, over this many seconds."""
    return np.clip((times - part * times[-1]) / max(over, 1e-6), 0, 1)


def _one_marker(frame: str, over: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        marker, part = int(rng.integers(6)), rng.uniform(0.25, 0.7)
        vector = arrow(rng, s, 0.7, 2.0)

        def step(points: np.ndarray, times: np.ndarray, _: np.ndarray) -> np.ndarray:
            moved, first = points.copy(), 3 * (marker // 3)
            away = np.broadcast_to(vector, (len(times), 3))
            if frame == "segment":
                rest = points[0, first : first + 3]
                basis_0, basis = _triad(rest[None])[0], _triad(points[:, first : first + 3])
                away = np.einsum("fij,j->fi", basis, basis_0.T @ vector)
            moved[:, marker] += _after(times, part, over)[:, None] * away
            return moved

        plan.marker_steps.append(step)
        slip = [marker // 3, marker % 3, part, vector.tolist()]
        return {"joint": JOINTS[marker // 3], "slip": slip, "frame": frame, "over": over}

    return law


def _triad(points: np.ndarray) -> np.ndarray:
    """(frames, 3, 3) rotation matrices carried by three markers."""
    x = points[:, 1] - points[:, 0]
    z = np.cross(x, points[:, 2] - points[:, 0])
    x, z = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (x, z))
    return np.stack([x, np.cross(z, x), z], axis=2)


def _support(about: str) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        segment, part, vector = int(rng.integers(2)), rng.uniform(0.25, 0.7), arrow(rng, s, 1.5, 5.0, np.pi / 180)

        def step(points: np.ndarray, times: np.ndarray, _: np.ndarray) -> np.ndarray:
            own = slice(3 * segment, 3 * segment + 3)
            basis = _triad(points[:, own])
            turned = np.broadcast_to(Rotation.from_rotvec(vector).as_matrix(), basis.shape)
            if about != "palm":
                turned = basis @ turned @ basis.transpose(0, 2, 1)
            pivot = points[:, own][:, 0] if about == "marker" else points[:, own].mean(axis=1)
            arms = points[:, own] - pivot[:, None]
            moved = points.copy()
            change = np.einsum("fij,fmj->fmi", turned, arms) - arms
            moved[:, own] += (times > part * times[-1])[:, None, None] * change
            return moved

        plan.marker_steps.append(step)
        return {"joint": JOINTS[segment], "part": part, "rotation": vector.tolist(), "about": about}

    return law


def _palm_marker(over: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        marker, part, vector = int(rng.integers(3)), rng.uniform(0.25, 0.7), arrow(rng, s, 0.6, 1.8)

        def step(points: np.ndarray, times: np.ndarray, _: np.ndarray) -> np.ndarray:
            moved = points.copy()
            moved[:, marker] += _after(times, part, over)[:, None] * vector
            return moved

        plan.palm_steps.append(step)
        return {"marker": marker, "part": part, "mm": vector.tolist(), "over": over}

    return law


def _swap(times_swapped: int) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        segment, pair = int(rng.integers(2)), rng.permutation(3)[:2]
        a, b = (int(3 + 3 * segment + i) for i in pair)
        parts = sorted(float(x) for x in rng.uniform(0.1, 0.85, times_swapped))
        seconds = s * spread(rng, 0.5, 3.0) / times_swapped

        def change(seen: np.ndarray, _: Rng) -> np.ndarray:
            for part in parts:
                window = slice(int(part * len(seen)), int(part * len(seen) + 100 * seconds) + 1)
                seen[window, [a, b]] = seen[window, [b, a]]
            return seen

        plan.frame_steps.append(change)
        return {"joint": JOINTS[segment], "columns": [a, b], "parts": parts, "seconds": seconds}

    return law


SLIPS = (_one_marker("palm", 0.0), _one_marker("segment", 0.0), _one_marker("segment", 3.0))
EFFECTS = (
    Effect("marker_slip", "markers", "distal", SLIPS),
    Effect("support_slip", "markers", "distal", (_support("support"), _support("marker"), _support("palm"))),
    Effect("palm_marker_slip", "markers", None, (_palm_marker(0.0), _palm_marker(2.0))),
    Effect("marker_swap", "markers", "distal", (_swap(1), _swap(3))),
)
