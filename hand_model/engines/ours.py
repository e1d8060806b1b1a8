"""This project's own kinematics behind the engines' calls: straight from hand.json, no URDF or MJCF is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compile.names import Names, named
from ..description import read_description
from ..errors import DescriptionError
from ..hand import Hand
from ..kinematics import displace
from .common import columns, homogeneous

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """A hand (the fingers of one file) and its names there. joints: in the order of the fingers, palm outwards."""

    hand: Hand
    names: Names
    joints: tuple[str, ...]


def load(file: str | Path) -> Model:
    """The model behind a compiled folder, or behind one of its MJCF, URDF or scene files.

    Raises DescriptionError where that is no compiled hand.
    """
    path = Path(file)
    description = read_description(path if path.is_dir() else path.parent)
    chosen = [m for m in description.models if path.name in (m.mjcf.name, m.urdf.name, m.scene.name)]
    if not chosen and not (path.is_dir() or path.name == "hand.json"):
        raise DescriptionError(
            f"{path}: not one of this folder's files ({', '.join(m.mjcf.name for m in description.models)}, ...)"
        )
    fingers = (chosen or description.models)[0].fingers
    return of_hand(replace(description.hand, fingers=tuple(description.hand.finger(name) for name in fingers)))


def of_hand(hand: Hand) -> Model:
    """The model of a Hand whose fingers are those of one file."""
    names = named(hand)
    return Model(hand, names, tuple(names.joint.values()))


def positions(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Mapping[str, Array]:
    """Positions (n, 3) [m] of markers, tips and attachment in the palm frame; joint_angles: joint -> (n,) [rad]."""
    return kinematics(model, joint_angles)[1]


def poses(model: Model, joint_angles: Mapping[str, ArrayLike]) -> Mapping[str, Array]:
    """Link poses (n, 4, 4) in the palm frame; joint_angles: joint -> (n,) [rad]."""
    return kinematics(model, joint_angles)[0]


def kinematics(model: Model, joint_angles: Mapping[str, ArrayLike]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Link poses (n, 4, 4) and positions (n, 3) [m] in the palm frame; joint_angles: joint -> (n,) [rad]."""
    angles = columns(model.joints, joint_angles)
    fixed = {model.names.marker["", label]: p for label, p in model.hand.palm_markers_palm.items()} | {
        "attachment": np.zeros(3)
    }
    points = {name: np.tile(np.asarray(p, float), (len(angles), 1)) for name, p in fixed.items()}
    links = {"palm": np.tile(np.eye(4), (len(angles), 1, 1))}
    start = 0
    for finger in model.hand.fingers:
        motion = displace(finger, angles[:, start : start + len(finger.joints)])
        start += len(finger.joints)
        for i, joint in enumerate(finger.joints):
            rest = {model.names.marker[finger.name, label]: p for label, p in joint.markers_palm.items()}
            if joint.tip_palm is not None:
                rest[model.names.tip[finger.name]] = joint.tip_palm
            moved = motion.points(i, [joint.centre_palm, *rest.values()])
            links[model.names.link[finger.name, joint.name]] = homogeneous(motion.rotation[:, i], moved[:, 0])
            points.update({name: moved[:, j] for j, name in enumerate(rest, 1)})
    return links, points
