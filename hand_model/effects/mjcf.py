"""Where a drive effect goes in a compiled MJCF: the motor joint of its actuator and the unit of its efforts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def motor_joint(root: Any, where: Mapping[str, Any]) -> tuple[Any, float] | None:
    """The motor joint (coordinate in percent) of `where["actuator"]` in an MJCF tree (lxml), and the file's effort per raw
    unit of current; None where the file has no identified motor of that name."""
    name = where.get("actuator")
    drive = next((a for a in root.iterfind("actuator/*") if isinstance(a.tag, str) and a.get("name") == name), None)
    unit = next((e for e in root.iterfind("custom/numeric") if e.get("name") == f"{name}_effort_per_raw"), None)
    if drive is None or unit is None or drive.tag != "general":
        return None
    joint = next((j for j in root.find("worldbody").iter("joint") if j.get("name") == drive.get("joint")), None)
    return None if joint is None else (joint, float(unit.get("data").split()[0]))


def section(root: Any, tag: str) -> Any:
    """The top-level element `tag`, made where it is missing."""
    from lxml import etree

    found = root.find(tag)
    return etree.SubElement(root, tag) if found is None else found


def free_name(root: Any, name: str) -> str:
    """`name`, or with the first number that no element of the file has."""
    taken = {e.get("name") for e in root.iter() if isinstance(e.tag, str)}
    return next(n for n in (name, *(f"{name}_{i}" for i in range(2, 1000))) if n not in taken)
