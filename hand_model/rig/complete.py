"""A rig's MJCF made whole: what MuJoCo works out by itself, leaves without a name or reads from other files is written
down, so that a fit can find it and change it. A file in which nothing is left open stays as it is, byte for byte."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..errors import DescriptionError
from .mjcf import number, parse, serialise

DEEPEST = 20  # files that include each other
FOLDERS = {"mesh": "meshdir", "hfield": "meshdir", "skin": "meshdir", "texture": "texturedir"}
# Elements that stand for several, or for parts of other files: after them the file's order is not the model's.
SEVERAL = ("attach", "replicate", "composite", "flexcomp")


def completed(xml: bytes, folder: Path) -> bytes:
    """The MJCF with included files and paths from `folder` in it, every body with mass its `inertial`, and every body,
    joint, actuator, tendon and equality a name.

    Raises DescriptionError where an included file is missing or MuJoCo cannot compile the whole.
    """
    import mujoco

    root = parse(xml)
    changed = _include(root, folder)
    changed |= _find_files(root, folder)
    whole = serialise(root) if changed else xml
    try:
        model = mujoco.MjModel.from_xml_string(whole.decode())
    except ValueError as error:
        raise DescriptionError(f"MuJoCo cannot read it: {error}") from None
    if any(True for tag in SEVERAL for _ in root.iter(tag)):
        return whole
    changed |= _name(root, model)
    changed |= _weigh(root, model)
    return serialise(root) if changed else whole


def _include(root: Any, folder: Path, depth: int = 0) -> bool:
    """Put the children of included files in the place of `include`, as MuJoCo does; whether there were any."""
    found = list(root.iter("include"))
    for element in found:
        path = folder / (element.get("file") or "")
        if depth > DEEPEST or not path.is_file():
            raise DescriptionError(f'it includes "{element.get("file")}", of which there is no file in {folder}')
        part = parse(path.read_bytes())
        _include(part, folder, depth + 1)
        for child in list(part):
            element.addprevious(child)
        element.getparent().remove(element)
    return bool(found)


def _find_files(root: Any, folder: Path) -> bool:
    """Give the files of meshes and textures whole paths, for the file may be written elsewhere; whether any was
    relative."""
    base = {}
    for compiler in root.iter("compiler"):
        for key in ("assetdir", "meshdir", "texturedir"):
            if key in compiler.attrib:
                base[key] = compiler.attrib.pop(key)
    changed = bool(base)
    for tag, key in FOLDERS.items():
        for element in root.iter(tag):
            file = element.get("file")
            if file is not None and not Path(file).is_absolute():
                element.set("file", str((folder / base.get(key, base.get("assetdir", "")) / file).resolve()))
                changed = True
    return changed


def _bodies(parent: Any) -> Iterator[Any]:
    """Bodies below an element, in the order of the model's, through frames."""
    for child in parent:
        if child.tag == "body":
            yield child
            yield from _bodies(child)
        elif child.tag == "frame":
            yield from _bodies(child)


def _joints(body: Any) -> Iterator[Any]:
    """A body's own joints, through frames."""
    for child in body:
        if child.tag in ("joint", "freejoint"):
            yield child
        elif child.tag == "frame":
            yield from _joints(child)


def _name(root: Any, model: Any) -> bool:
    """Name what has no name, by its number in the model; whether there was any."""
    bodies = [body for world in root.iter("worldbody") for body in _bodies(world)]
    kinds = {
        "body": (bodies, model.nbody - 1),
        "joint": ([j for body in bodies for j in _joints(body)], model.njnt),
        **{
            kind: ([e for s in root.findall(kind) for e in s if isinstance(e.tag, str)], count)
            for kind, count in (("actuator", model.nu), ("tendon", model.ntendon), ("equality", model.neq))
        },
    }
    taken = {e.get("name") for e in root.iter() if isinstance(e.tag, str)}
    changed = False
    for kind, (elements, count) in kinds.items():
        if len(elements) != count:
            continue  # the model has others: which is which, this file does not tell
        for k, element in enumerate(elements):
            if not element.get("name"):
                element.set("name", next(n for n in _numbered(kind, k) if n not in taken))
                taken.add(element.get("name"))
                changed = True
    return changed


def _numbered(kind: str, k: int) -> Iterator[str]:
    name = f"{kind}_{k}"
    while True:
        yield name
        name += "_"


def _weigh(root: Any, model: Any) -> bool:
    """Write mass, centre and inertia of bodies whose geoms give them; whether there were any."""
    from lxml import etree

    bodies = [body for world in root.iter("worldbody") for body in _bodies(world)]
    if len(bodies) != model.nbody - 1:
        return False
    compilers = list(root.iter("compiler"))
    by_geoms = any(c.get("inertiafromgeom") == "true" for c in compilers)
    changed = False
    for k, body in enumerate(bodies, 1):
        inertial = body.find("inertial")
        if model.body_mass[k] <= 0 or inertial is not None and not by_geoms:
            continue
        if inertial is not None:
            body.remove(inertial)
        inertial = etree.Element("inertial", pos=number(*model.body_ipos[k]), quat=number(*model.body_iquat[k]))
        inertial.set("mass", number(model.body_mass[k]))
        inertial.set("diaginertia", number(*model.body_inertia[k]))
        body.insert(0, inertial)
        changed = True
    for compiler in compilers if changed else ():
        for key in ("inertiafromgeom", "settotalmass"):  # the masses are told now, and a fit may change them
            compiler.attrib.pop(key, None)
    return changed


__all__ = ["completed"]
