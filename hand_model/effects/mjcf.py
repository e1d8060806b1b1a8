"""Where a drive effect goes in a compiled MJCF: the motor joint of its actuator and the unit of its efforts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SHORT_BRISTLE = 0.1  # in the joint's unit, percent: Coulomb friction to any encoder here


def motor_joint(root: Any, where: Mapping[str, Any]) -> tuple[Any, float] | None:
    """The motor joint (coordinate in percent) of `where["actuator"]` in an MJCF tree (lxml), and the file's effort per
    raw unit of current; None where the file has no identified motor of that name."""
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
    """Give the motor joint the LuGre friction of a passive `dcmotor`, in place of its `frictionloss` or of such an
    element that is there; its path, or None without friction.

    parameters: bristle_length (give before sliding) and stribeck_speed in the joint's unit; bristle_time [s]: damping
    over stiffness;
    coulomb_ratio and static_ratio (sliding and static friction over the Coulomb friction that is there). What is not
    given stays, or is a short bristle without excess.
    """
    found = motor_joint(root, where)
    if found is None:
        return None
    joint, _ = found  # efforts are already the file's
    name = f"{where['actuator']}_friction"
    there = next((m for m in root.iterfind("actuator/dcmotor") if m.get("name") == name), None)
    if there is not None:
        bristle, damping, coulomb, static, speed = (float(x) for x in there.get("lugre").split())
        length, time_s = coulomb / bristle, damping / bristle
        there.getparent().remove(there)
    else:
        coulomb = static = float(joint.attrib.get("frictionloss", "0"))
        length, time_s, speed = SHORT_BRISTLE, 0.0, 20.0
    if coulomb <= 0:
        return None
    for key in ("frictionloss", "solreffriction", "solimpfriction"):
        joint.attrib.pop(key, None)
    sliding = coulomb * parameters.get("coulomb_ratio", 1.0)
    static = max(sliding, coulomb * parameters.get("static_ratio", static / coulomb))
    stiffness = coulomb / parameters.get("bristle_length", length)
    damping = stiffness * parameters.get("bristle_time", time_s)
    return bristle_friction(
        root, joint, name, (stiffness, damping, sliding, static, parameters.get("stribeck_speed", speed))
    )


def add_damping(joint: Any, linear: float, quadratic: float) -> bool:
    """Add to a joint's `damping`, whose force is -(a v + b v |v| + c v^3); False, and nothing done, where `a` would
    fall below zero."""
    a, b, c = ([float(x) for x in (joint.get("damping") or "0").split()] + [0.0, 0.0])[:3]
    if a + linear < 0:
        return False
    joint.set("damping", " ".join(repr(x) for x in (a + linear, b + quadratic, c)))
    return True


def joint_tendon(root: Any, joint: Any, name: str, **attributes: Any) -> str:
    """A fixed tendon along one joint, its length the joint's coordinate; its path."""
    return fixed_tendon(root, free_name(root, name), {joint.get("name"): 1.0}, **attributes)


def fixed_tendon(root: Any, name: str, coefficients: Mapping[str, float], **attributes: Any) -> str:
    """A fixed tendon, its length the sum of coefficient times joint; attributes: numbers or tuples of them. Its
    path."""
    from lxml import etree

    texts = {k: " ".join(repr(float(x)) for x in (v if isinstance(v, tuple) else (v,))) for k, v in attributes.items()}
    tendon = etree.SubElement(section(root, "tendon"), "fixed", {"name": name, **texts})
    for joint, coefficient in coefficients.items():
        etree.SubElement(tendon, "joint", joint=joint, coef=repr(float(coefficient)))
    return f"tendon/fixed[@name='{name}']"


def bristle_friction(root: Any, joint: Any, name: str, lugre: tuple[float, ...]) -> str:
    """A passive DC motor with LuGre friction (bristle stiffness and damping, Coulomb and static level, Stribeck speed);
    its path."""
    from lxml import etree

    free = free_name(root, name)
    motor = {
        "name": free,
        "joint": joint.get("name"),
        "input": "none",
        "motorconst": "0 0",
        "resistance": "1",
        "lugre": " ".join(repr(float(v)) for v in lugre),
    }
    etree.SubElement(section(root, "actuator"), "dcmotor", motor)
    return f"actuator/dcmotor[@name='{free}']"


def motor_sensor(root: Any, where: Mapping[str, Any], kind: str) -> Any:
    """The sensor `<actuator>_current` (the drive's force) or `<actuator>_encoder` (the motor joint's position), made
    where it is missing; None where the file has no such motor."""
    from lxml import etree

    found = motor_joint(root, where)
    if found is None:
        return None
    name = f"{where['actuator']}_{kind}"
    sensor = next((s for s in root.iterfind("sensor/*") if isinstance(s.tag, str) and s.get("name") == name), None)
    if sensor is None:
        tag, key, value = {
            "current": ("actuatorfrc", "actuator", where["actuator"]),
            "encoder": ("jointpos", "joint", found[0].get("name")),
        }[kind]
        sensor = etree.SubElement(section(root, "sensor"), tag, {"name": free_name(root, name), key: value})
    return sensor


def extra_joint(root: Any, where: Mapping[str, Any], word: str) -> str | None:
    """Path of the first extra joint ("wobble", "travel") of the place's segment; None where the file has none."""
    name = f"{where.get('finger')}_{where.get('joint')}_{word}"
    found = any(j.get("name") == name for j in root.find("worldbody").iter("joint"))
    return f"worldbody//joint[@name='{name}']" if found else None


def delay(root: Any, element: Any, delay_s: float) -> str:
    """Give an actuator or a sensor a delay [s], and as many remembered samples as it takes; its path."""
    option = root.find("option")
    step = float(option.get("timestep", "0.002")) if option is not None else 0.002
    element.set("delay", repr(float(delay_s)))
    element.set("nsample", str(int(delay_s / step) + 2))
    return f"{element.getparent().tag}/{element.tag}[@name='{element.get('name')}']/@delay"
