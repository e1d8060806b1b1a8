"""One folder from one hand, written whole or not at all."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..description import Description, read_description
from ..errors import DescriptionError, HandFileError
from ..hand import Hand
from .contact import settled
from .course import lost_in_urdf, with_courses
from .mesh import link_meshes, stl
from .mjcf import mjcf
from .names import sanitised
from .plan import Plan, complete, planned, variants
from .readme import CHANGELOG, LICENSE, readme
from .ros2_control import ros2_control
from .scene import cylinder_scene, scene
from .shape import DENSITY
from .urdf import urdf
from .xml import document


def compile(hand: Hand, folder: str | Path, newton_metre_per_unit: float | None = None) -> Description:
    """Write a hand as URDF and MJCF, with scene, meshes, hand.json and README, one pair of files per position of the
    thumb.

    newton_metre_per_unit: torque at the proximal joint per raw unit of current [N m]; efforts stay raw without it.
    The folder appears (or replaces a compiled one) only when it is complete; the same hand gives the same bytes.
    Raises HandFileError where the hand cannot be compiled, DescriptionError where `folder` holds something else.
    """
    target = Path(folder)
    if newton_metre_per_unit is not None and not 0 < newton_metre_per_unit < np.inf:
        raise DescriptionError(f"{newton_metre_per_unit} N m per unit of current: a positive number is needed")
    if target.exists() and not (target / "hand.json").is_file() and not (target.is_dir() and not any(target.iterdir())):
        raise DescriptionError(
            f"{target}: exists and is not a compiled hand; name a new folder or an earlier one of this command"
        )
    whole, guessed = complete(hand)
    plans = tuple(settled(planned(stem, suffix, part, guessed)) for (stem, suffix), part in variants(whole).items())
    target.parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        _write(staging, whole, plans, newton_metre_per_unit)
        staging.chmod(0o755)
        _swap(staging, target)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return read_description(target)


def _write(folder: Path, hand: Hand, plans: tuple[Plan, ...], newton_metre_per_unit: float | None) -> None:
    (folder / "assets").mkdir()
    for plan in plans:
        (folder / f"{plan.stem}.xml").write_bytes(document(mjcf(plan, newton_metre_per_unit)))
        (folder / f"{plan.stem}.urdf").write_bytes(document(urdf(plan)))
        (folder / f"{scene_stem(plan)}.xml").write_bytes(document(scene(plan)))
        extra = {
            f"{scene_stem(plan)}_cylinder.xml": cylinder_scene(plan),
            f"{plan.stem}.ros2_control.xacro": ros2_control(plan),
        }
        for name, tree in extra.items():
            if tree is not None:
                (folder / name).write_bytes(document(tree))
        for link in plan.links:
            for name, mesh in link_meshes(link).items():
                (folder / "assets" / name).write_bytes(stl(*mesh))
    try:
        hand.save(folder / "hand.json")
    except ValueError as error:
        raise HandFileError(
            f'hand "{hand.name}" holds a figure that is not finite, which hand.json cannot keep ({error})'
        ) from None
    table = json.loads((folder / "hand.json").read_text())
    table["description"] = _table(hand, plans)
    (folder / "hand.json").write_text(json.dumps(table, indent=1, allow_nan=False) + "\n")
    (folder / "README.md").write_text(readme(hand, plans))
    (folder / "LICENSE").write_text(LICENSE)
    (folder / "CHANGELOG.md").write_text(CHANGELOG)


def scene_stem(plan: Plan) -> str:
    """File name of a variant's scene without ending: scene_left, scene_left_thumb_1."""
    return f"scene_{sanitised(plan.hand.side)}{plan.suffix}"


def _table(hand: Hand, plans: tuple[Plan, ...]) -> Mapping[str, Any]:
    """What hand.json holds beside the hand."""
    return {
        "about": (
            "the hand (fields beside this one) is a .hand file; "
            "here: what compile added to it, angles in rad, lengths in m"
        ),
        "models": [
            {
                "stem": plan.stem,
                "mjcf": f"{plan.stem}.xml",
                "urdf": f"{plan.stem}.urdf",
                "scene": f"{scene_stem(plan)}.xml",
                "fingers": [f.name for f in plan.hand.fingers],
                "joints": {name: list(key) for key, name in plan.names.joint.items()},
                "markers": {name: list(key) for key, name in plan.names.marker.items()},
                "tips": {name: finger for finger, name in plan.names.tip.items()},
                "actuators": {name: plan.hand.finger(finger).actuator for finger, name in plan.names.actuator.items()},
                "linkages": {
                    name: {
                        "driver": plan.names.joint[finger, k.driver],
                        "follower": plan.names.joint[finger, k.follower],
                        "polynomial": k.coefficients.tolist(),
                        "mimic": {
                            "joint": plan.names.joint[finger, k.source],
                            "multiplier": k.multiplier,
                            "offset": k.offset,
                        },
                        "mimic_loss_deg": float(np.degrees(k.loss_rad)),
                        "mimic_loss_tip_m": k.loss_tip_m,
                    }
                    for name, (finger, k) in plan.linkages.items()
                },
                **_courses(plan),
                "keyframes": {name: dict(reached) for name, reached in plan.reached.items()},
                "excludes": [list(e) for e in plan.excludes],
                "mass_kg": plan.mass,
            }
            for plan in plans
        ],
        "guessed_tips": {f: how for plan in plans for f, how in plan.guessed_tips.items()},
        "inertia": {
            "origin": "fallback: capsules of uniform density, nothing measured",
            "density_kg_m3": DENSITY,
            **_probed(plans),
        },
    }


def _courses(plan: Plan) -> Mapping[str, Any]:
    """Extra joints (coordinates in rad or m), if there are any, and what a URDF loses without them."""
    own = {(f.name, j.name): lost_in_urdf(f, j) for f, j in with_courses(plan.hand)}
    table = {
        extra.name: {
            "hinge": link.joint,
            "kind": extra.kind,
            "equality": extra.equality,
            "polynomial": extra.polynomial.tolist(),
            "urdf_loss_deg": float(np.degrees(own[link.finger, link.segment][0])),
            "urdf_loss_tip_m": own[link.finger, link.segment][1],
        }
        for link in plan.links
        for extra in link.extras
    }
    return {"courses": table} if table else {}


def _probed(plans: tuple[Plan, ...]) -> Mapping[str, Any]:
    """Links whose inertia is that of their watertight surface, if there are any."""
    links = {k.name for plan in plans for k in plan.links if k.surface is not None and k.surface.watertight}
    return {"of_probed_surfaces": sorted(links)} if links else {}


def _swap(staging: Path, target: Path) -> None:
    if not target.exists():
        os.rename(staging, target)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{target.name}.old.", dir=target.parent))
    try:
        os.rename(target, old / "hand")
        try:
            os.rename(staging, target)
        except OSError:
            os.rename(old / "hand", target)
            raise
    finally:
        shutil.rmtree(old, ignore_errors=True)
