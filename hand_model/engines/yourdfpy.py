"""yourdfpy: kinematics of a URDF. Mimic is taken out after loading and every joint's angle is passed (it evaluates
chains wrongly)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import DescriptionError
from .common import columns, relative

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """A yourdfpy model without mimic. joints: its moving joints. fixed: link on a fixed joint -> (moving ancestor, (4,
    4))."""

    urdf: Any
    joints: tuple[str, ...]
    moving: tuple[str, ...]
    fixed: Mapping[str, tuple[str, Array]]


def load(file: str | Path) -> Model:
    """Load a URDF; raises DescriptionError with the reason where that fails."""
    import yourdfpy

    path = Path(file)
    if not path.is_file():
        raise DescriptionError(f"{path}: no such file")
    try:
        robot = yourdfpy.URDF.load(str(path), build_scene_graph=False, load_meshes=False).robot
        for joint in robot.joints:
            joint.mimic = None
        urdf = yourdfpy.URDF(robot=robot, build_scene_graph=True, load_meshes=False)
    except Exception as error:  # noqa: BLE001 (it raises whatever its XML layer raised)
        raise DescriptionError(f"{path}: yourdfpy cannot load it ({error})") from None
    carrier = {j.child: j for j in robot.joints}
    fixed: dict[str, tuple[str, Array]] = {}
    for link in robot.links:
        name, placement = link.name, np.eye(4)
        while name in carrier and carrier[name].type == "fixed":
            origin = carrier[name].origin
            placement = (np.eye(4) if origin is None else origin) @ placement
            name = carrier[name].parent
        if name != link.name:
            fixed[link.name] = (name, placement)
    moving = tuple(link.name for link in robot.links if link.name not in fixed)
    return Model(urdf, tuple(urdf.actuated_joint_names), moving, fixed)


def positions(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Mapping[str, Array]:
    """Positions (n, 3) [m] of links on fixed joints; joint_angles: joint -> (n,) [rad]."""
    return kinematics(model, joint_angles)[1]


def poses(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Mapping[str, Array]:
    """Link poses (n, 4, 4); joint_angles: joint -> (n,) [rad]."""
    return kinematics(model, joint_angles)[0]


def kinematics(model: Model, joint_angles: Mapping[str, ArrayLike]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Link poses (n, 4, 4) and positions (n, 3) [m]; joint_angles: joint -> (n,) [rad]."""
    frames = _moving(model, columns(model.joints, joint_angles))
    fixed = {name: frames[base] @ placement for name, (base, placement) in model.fixed.items()}
    return relative(frames | fixed, {name: frame[:, :3, 3] for name, frame in fixed.items()})


def _moving(model: Model, angles: Array) -> dict[str, Array]:
    frames = {name: np.empty((len(angles), 4, 4)) for name in model.moving}
    for i, row in enumerate(angles):
        model.urdf.update_cfg(row)
        for name, frame in frames.items():
            frame[i] = model.urdf.get_transform(name)
    return frames
