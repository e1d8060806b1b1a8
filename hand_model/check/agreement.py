"""Agreement of the engines on random poses, at markers, tips and link orientations."""

from __future__ import annotations

import numpy as np

from ..compile.course import with_courses, without_courses
from ..description import Description, Model
from ..engines import mujoco, ours, pinocchio, yourdfpy
from .finding import Finding

POSES = 500
POSITION = 1e-9  # m
ANGLE = 1e-7  # rad


def agreement(description: Description, model: Model) -> Finding:
    """MuJoCo (both formats), Pinocchio (both) and yourdfpy against this project's own kinematics of hand.json.

    A URDF holds plain hinges: its joints with a course are compared without it.
    Pinocchio's MJCF parser drops the sites of a root body without joint: what it has is compared, elsewhere all is
    demanded.
    """
    own = ours.load(model.mjcf)
    random = np.random.default_rng(0)
    angles = {joint: random.uniform(-1.5, 1.5, POSES) for joint in own.joints}
    exact = ours.kinematics(own, angles)
    plain = ours.kinematics(ours.of_hand(without_courses(own.hand)), angles) if with_courses(own.hand) else exact
    engines = (
        (mujoco, model.mjcf),
        (mujoco, model.scene),
        (mujoco, model.urdf),
        (pinocchio, model.urdf),
        (pinocchio, model.mjcf),
        (yourdfpy, model.urdf),
    )
    worst, turned, problems = 0.0, 0.0, []
    for engine, path in engines:
        label = f"{engine.__name__.rsplit('.', 1)[1]} from {path.name}"
        loaded = engine.load(path)
        absent = [joint for joint in angles if joint not in loaded.joints]
        if absent:
            problems.append(f"{label} has no joint {', '.join(absent)}")
            continue
        links, points = plain if path == model.urdf else exact
        frames, there = engine.kinematics(loaded, angles)
        lost = [n for n in (*points, *links) if n not in there and n not in frames]
        if lost and not (
            engine is pinocchio
            and path == model.mjcf
            and all((links["palm"] == np.eye(4)).all() and _palm(own, n) for n in lost)
        ):
            problems.append(f"{label} has no {', '.join(lost[:5])}")
        gap = max(float(np.linalg.norm(points[n] - there[n], axis=1).max()) for n in points if n in there)
        turn = max(_angle(links[n], frames[n]) for n in links if n in frames)
        worst, turned = max(worst, gap), max(turned, turn)
        if gap > POSITION or turn > ANGLE:
            problems.append(f"{label} is off by {gap * 1e3:.3g} mm and {np.degrees(turn):.3g} deg")
    said = (
        "; ".join(problems[:5])
        or f"{POSES} poses, {len(engines)} ways, {len(points)} points: at most {worst:.1g} m and {turned:.1g} rad"
    )
    if with_courses(own.hand):
        said += "; the URDF against plain hinges, it holds no course"
    return Finding(f"engines agree: {model.stem}", not problems, worst, said)


def _palm(own: ours.Model, name: str) -> bool:
    return name == "attachment" or name in {own.names.marker["", label] for label in own.hand.palm_markers_palm}


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Largest angle [rad] between rotations of poses (n, 4, 4): by the chord, which keeps small angles exact."""
    chord = np.linalg.norm(a[:, :3, :3] - b[:, :3, :3], axis=(1, 2)) / np.sqrt(8)
    return float(2 * np.arcsin(np.clip(chord, 0, 1)).max())
