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


def lugre_friction(root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
    """Replace the motor joint's `frictionloss` by the LuGre friction of a passive `dcmotor`; its path, or None without friction.

    parameters: bristle_length (give before sliding) and stribeck_speed in the joint's unit, static_ratio (static over Coulomb
    friction); what is not given is a short bristle without excess.
    """
    from lxml import etree

    found = motor_joint(root, where)
    if found is None:
        return None
    joint, _ = found  # efforts are already the file's
    coulomb = float(joint.attrib.get("frictionloss", "0"))
    if coulomb <= 0:
        return None
    for key in ("frictionloss", "solreffriction", "solimpfriction"):
        joint.attrib.pop(key, None)
    name = free_name(root, f"{where['actuator']}_friction")
    bristle, speed = parameters.get("bristle_length", 0.1), parameters.get("stribeck_speed", 20.0)
    values = (coulomb / bristle, 0.0, coulomb, coulomb * parameters.get("static_ratio", 1.0), speed)
    lugre = " ".join(repr(float(v)) for v in values)
    motor = {"name": name, "joint": joint.get("name"), "input": "none", "motorconst": "0 0", "resistance": "1", "lugre": lugre}
    etree.SubElement(section(root, "actuator"), "dcmotor", motor)
    return f"actuator/dcmotor[@name='{name}']"
