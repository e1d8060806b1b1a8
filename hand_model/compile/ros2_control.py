"""A xacro wrapper that puts the hand on a robot and its actuators under ros2_control."""

from __future__ import annotations

from typing import Any

from .drive import nominal_drives
from .plan import Plan
from .xml import child, comment, number

XACRO = "http://www.ros.org/wiki/xacro"
MOCK = "mock_components/GenericSystem"  # ros2_control's own stand-in for hardware


def ros2_control(plan: Plan) -> Any | None:
    """Tree (lxml element) of `<stem>.ros2_control.xacro`; None for a hand without actuators.

    Arguments: `plugin`, the hardware interface; `parent`, a link of the robot to fix the palm to (empty: the hand
    alone); `xyz`, `rpy`, where on it. A driven joint takes position commands, a follower only reports its state: its
    <mimic> is in the URDF.
    """
    from lxml import etree

    drives = nominal_drives(plan)
    driven = {joint: d for joint, d in drives.items() if d.actuator}
    if not driven:
        return None
    root = etree.Element("robot", {"name": plan.stem}, nsmap={"xacro": XACRO})
    for name, default in (("plugin", MOCK), ("parent", ""), ("xyz", "0 0 0"), ("rpy", "0 0 0")):
        etree.SubElement(root, f"{{{XACRO}}}arg", name=name, default=default)
    etree.SubElement(root, f"{{{XACRO}}}include", filename=f"{plan.stem}.urdf")
    etree.SubElement(root, f"{{{XACRO}}}property", name="parent", value="$(arg parent)")
    mount = etree.SubElement(root, f"{{{XACRO}}}if", value="${parent != ''}")
    joint = child(mount, "joint", name=f"{plan.stem}_mount", type="fixed")
    child(joint, "parent", link="${parent}")
    child(joint, "child", link="palm")
    child(joint, "origin", xyz="$(arg xyz)", rpy="$(arg rpy)")
    system = child(root, "ros2_control", name=plan.stem, type="system")
    child(child(system, "hardware"), "plugin").text = "$(arg plugin)"
    start = plan.keyframes["open"]
    for link in plan.links:
        if link.joint is None:
            continue
        if link.joint in driven:
            comment(system, f"actuator {driven[link.joint].actuator}")
        joint = child(system, "joint", name=link.joint)
        if link.joint in driven:
            command = child(joint, "command_interface", name="position")
            for bound, value in zip(("min", "max"), link.range_rad, strict=True):
                child(command, "param", name=bound).text = number(value)
        position = child(joint, "state_interface", name="position")
        if link.joint in driven:
            child(position, "param", name="initial_value").text = number(start[link.joint])
        child(joint, "state_interface", name="velocity")
    return root
