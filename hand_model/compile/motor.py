"""Identified motors in an MJCF: a motor joint in percent of range, its friction and spring, and a drive that only
pushes.

Per actuator, natively:
    joint `<actuator>_motor`, coordinate [%] of the encoder range: armature, damping, frictionloss (or a LuGre element
    where the
        recordings show presliding or a Stribeck rise), stiffness, springref;
    joint `<actuator>_drive`, tied to it by the encoder map (equality `<actuator>_map`): where the actuator's lever
    stands [rad];
    tendon `<actuator>_push`: the proximal joint is never behind the lever (one-sided range) and a spring holds it
    there;
    actuator `<actuator>`: force = current. Its ctrl is r + (damping / gain) r', with r the reference of
    `identify.motor.reference`.
Efforts are raw units of current, or newton metres at the proximal joint where `newton_metre_per_unit` is given.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..effects.input import map_of, settle
from ..hand import Finger, Hand, Motor
from .xml import child, comment, number, vector

YIELD_RATE = 150.0  # rad/s: natural frequency of the finger on its return spring; not identified, and said so
PRESLIDING_LEAST = 0.1  # [%]: presliding below it is Coulomb friction to any encoder here
SOLREF_FRICTION, SOLIMP_FRICTION = (0.004, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)  # hold without creep
# [%]: the encoder map holds over the recorded range; a little more, as noise and overshoot go beyond it
TRAVEL = (-2.0, 102.0)
SOLREF, SOLIMP = (0.002, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)
DUMMY = {"pos": (0, 0, 0), "mass": 1e-9, "diaginertia": (1e-9, 1e-9, 1e-9)}


def write_motors(root: Any, hand: Hand, newton_metre_per_unit: float | None = None) -> tuple[str, ...]:
    """Write every identified motor of `hand` whose finger is in the MJCF tree `root` (lxml); keyframes are completed.

    newton_metre_per_unit: torque at the proximal joint per raw unit of current [N m]. Returns notes, one sentence each.
    """
    notes = []
    for motor, finger in _driven(root, hand):
        notes += _write_motor(root, finger, motor, newton_metre_per_unit)
    return tuple(notes)


def complete_keyframes(root: Any, hand: Hand) -> None:
    """Put every motor and lever of the keyframes where their proximal joint stands, and the controls of the motors with
    them."""
    joints = [j.get("name") for j in root.find("worldbody").iter("joint")]
    every = [a for a in root.iterfind("actuator/*") if isinstance(a.tag, str)]
    actuators = [a.get("name") for a in every if a.get("input") != "none"]  # an actuator without input has no control
    for key in root.iterfind("keyframe/key"):
        pose = dict(zip(joints, map(float, (key.get("qpos") or "").split()), strict=False))
        given = [float(x) for x in (key.get("ctrl") or "").split()]
        names = [a.get("name") for a in every] if len(given) == len(every) else actuators
        control = dict.fromkeys(actuators, 0.0) | dict(zip(names, given, strict=False))
        for motor, finger in _driven(root, hand):
            angle, grid = _map(finger, motor), np.linspace(0, 100, 2001)
            values = np.polynomial.polynomial.polyval(grid, angle)
            order = np.argsort(values)
            percent = float(np.interp(pose[_joint(root, finger).get("name")], values[order], grid[order]))
            rotor, lever = _own_joints(root, motor.actuator)
            pose[rotor] = control[motor.actuator] = percent
            pose[lever] = float(np.polynomial.polynomial.polyval(percent, angle))
        settle(root, pose)
        key.set("qpos", vector([pose[n] for n in joints]))
        if actuators:
            key.set("ctrl", vector([control[n] for n in actuators]))


def _driven(root: Any, hand: Hand) -> list[tuple[Motor, Finger]]:
    """Motors with the finger of this tree that they drive (the thumb is in one of its two positions)."""
    found = []
    for motor in hand.motors:
        finger = next((f for f in hand.fingers if f.actuator == motor.actuator and _joint(root, f) is not None), None)
        if finger is not None and finger.encoder_maps:
            found.append((motor, finger))
    return found


def _joint(root: Any, finger: Finger) -> Any:
    name = f"{finger.name}_{finger.joints[0].name}"
    return next((j for j in root.find("worldbody").iter("joint") if j.get("name") == name), None)


def _own_joints(root: Any, actuator: str) -> tuple[str, str]:
    """Names of the motor joint and of the lever of a written actuator."""
    rotor = next(a for a in root.iterfind("actuator/*") if isinstance(a.tag, str) and a.get("name") == actuator).get(
        "joint"
    )
    return rotor, map_of(root, {"actuator": actuator}, "encoder").get("joint1")


def _free(root: Any, name: str) -> str:
    """`name`, or with the first number that makes it unique in the file, across kinds."""
    taken = {e.get("name") for e in root.iter() if isinstance(e.tag, str) and e.getparent() is not None}
    return next(n for n in (name, *(f"{name}_{i}" for i in range(2, 1000))) if n not in taken)


def _map(finger: Finger, motor: Motor) -> np.ndarray:
    """Coefficients (<= 5,) of the proximal angle [rad] over the motor's percent, from the encoder map over its own
    range."""
    encoder = finger.encoder_maps[0]
    span = encoder.counts_close - encoder.counts_open
    inner = np.polynomial.Polynomial(
        [(motor.counts_open - encoder.counts_open) / span, (motor.counts_close - motor.counts_open) / span / 100]
    )
    angle = np.polynomial.Polynomial(encoder.coefficients)(inner)
    return np.asarray(angle.coef, float)


def _write_motor(root: Any, finger: Finger, motor: Motor, scale: float | None) -> list[str]:
    name = motor.actuator
    value = {n: e.value for n, e in motor.parameters.items()}
    angle = _map(finger, motor)
    proximal = _joint(root, finger)
    full = float(np.polynomial.polynomial.polyval(100.0, angle) - angle[0])
    # power is the same on both sides: raw * unit * d(angle) = effort * d(percent)
    unit = 1.0 if scale is None else scale * full / 100
    palm = root.find("worldbody").find("body")
    label = "raw units of current" if scale is None else f"N m at {proximal.get('name')} times {full / 100!r} rad/%"
    rotor = _free(root, f"{name}_motor")
    joint = _write_rotor(root, name, rotor, value, unit, label)
    arm = _child_body(
        palm,
        _free(root, f"{name}_drive_link"),
        f"lever of {name}: where the actuator pushes the proximal segment to [rad]",
    )
    lever = _free(root, f"{name}_drive")
    child(arm, "joint", name=lever, type="hinge", pos=(0, 0, 0), axis=(0, 0, 1), ref="0", limited=False, armature=1e-7)
    coefficients = np.zeros(5)
    coefficients[: len(angle)] = angle
    child(
        _section(root, "equality"),
        "joint",
        name=_free(root, f"{name}_map"),
        joint1=lever,
        joint2=rotor,
        polycoef=coefficients,
        solref=SOLREF,
        solimp=SOLIMP,
    )
    _write_push(root, name, proximal, lever)
    _write_actuator(root, name, proximal.get("name"), motor, unit, rotor)
    lugre = _write_friction(root, joint, name, value, unit)
    child(_section(root, "custom"), "numeric", name=_free(root, f"{name}_effort_per_raw"), data=unit)
    notes = [
        f'motor "{name}": joint {rotor} is in percent of the encoder range, efforts in {label}',
        f'motor "{name}": the return spring that holds the finger on its actuator is nominal, not measured',
    ]
    if lugre:
        notes.append(
            f'motor "{name}": friction is the LuGre element {name}_friction (presliding or Stribeck), not frictionloss'
        )
    return notes


def _write_rotor(root: Any, name: str, rotor: str, value: dict[str, float], unit: float, label: str) -> Any:
    """The motor's own joint, in percent of the encoder range, with its inertia, damping and spring."""
    link = _child_body(
        root.find("worldbody").find("body"),
        _free(root, f"{name}_motor_link"),
        f"motor of {name}: coordinate in percent of the encoder range, effort in {label}",
    )
    return child(
        link,
        "joint",
        name=rotor,
        type="hinge",
        pos=(0, 0, 0),
        axis=(0, 0, 1),
        ref="0",
        limited=True,
        range=TRAVEL,
        solreflimit=SOLREF,
        solimplimit=SOLIMP,
        armature=unit * value["inertia"],
        damping=unit * max(value["viscous"], 0.0),
        stiffness=unit * max(value["stiffness"], 0.0),
        springref=-value["preload"] / value["stiffness"] if value["stiffness"] > 0 else 0.0,
    )


def _child_body(palm: Any, name: str, text: str) -> Any:
    comment(palm, text)
    body = child(palm, "body", name=name)
    child(body, "inertial", **DUMMY)
    return body


def _section(root: Any, tag: str) -> Any:
    found = root.find(tag)
    return child(root, tag) if found is None else found


def _write_push(root: Any, name: str, proximal: Any, lever: str) -> None:
    """The finger is pushed by the lever and held on it by a spring: it yields when flexed further and follows back."""
    inertia = float(proximal.get("armature") or 0.0) + 1e-6
    # the nominal rotor of an unidentified drive is replaced by the motor joint
    proximal.attrib.pop("armature", None)
    proximal.set("damping", number(1e-6))
    # a finger thrown off its lever meets the end of its range as hard as the motor does
    proximal.set("solreflimit", vector(SOLREF))
    proximal.set("solimplimit", vector(SOLIMP))
    inertial = proximal.getparent().find("inertial")
    if inertial is not None:
        position = np.array([float(x) for x in (inertial.get("pos") or "0 0 0").split()])
        inertia = float(inertial.get("mass")) * float(position @ position) + 1e-6
    tendon = child(
        _section(root, "tendon"),
        "fixed",
        name=_free(root, f"{name}_push"),
        limited=True,
        range=(0.0, 10.0),
        stiffness=inertia * YIELD_RATE**2,
        damping=2 * inertia * YIELD_RATE,
        springlength=0.0,
        solreflimit=SOLREF,
        solimplimit=SOLIMP,
    )
    child(tendon, "joint", joint=proximal.get("name"), coef=1.0)
    child(tendon, "joint", joint=lever, coef=-1.0)


def _write_friction(root: Any, joint: Any, name: str, value: dict[str, float], unit: float) -> bool:
    presliding, ratio = value.get("presliding", 0.0), value.get("static_ratio", 1.0)
    if presliding < PRESLIDING_LEAST and ratio <= 1.0:
        joint.set("frictionloss", number(unit * value["coulomb"]))
        joint.set("solreffriction", vector(SOLREF_FRICTION))
        joint.set("solimpfriction", vector(SOLIMP_FRICTION))
        return False
    bristle = value["coulomb"] * unit / max(presliding, PRESLIDING_LEAST)
    coulomb = unit * value["coulomb"]
    child(
        _section(root, "actuator"),
        "dcmotor",
        name=_free(root, f"{name}_friction"),
        joint=joint.get("name"),
        input="none",
        motorconst=(0.0, 0.0),
        resistance=1.0,
        lugre=(
            bristle,
            value.get("bristle", 0.0) * bristle,
            coulomb,
            coulomb * ratio,
            value.get("stribeck_speed", 20.0),
        ),
    )
    return True


def _write_actuator(root: Any, name: str, proximal: str, motor: Motor, unit: float, rotor: str) -> None:
    section = _section(root, "actuator")
    for old in section.findall("*"):
        if old.get("name") == name or old.get("joint") == proximal:
            section.remove(old)
    value = {n: e.value for n, e in motor.parameters.items()}
    gain = value.get("gain", 20.0)
    damping = value.get("damping", 2 * float(np.sqrt(gain * max(value["inertia"], 1e-6))))
    limit = max(255.0, 4 * value["coulomb"])
    comment(
        section, f"{name}: force is the current; ctrl is the reference [%] plus {damping / gain!r} s times its velocity"
    )
    child(
        section,
        "general",
        name=name,
        joint=rotor,
        gaintype="fixed",
        gainprm=(unit * gain,),
        biastype="affine",
        biasprm=(0.0, -unit * gain, -unit * damping),
        ctrlrange=(-50.0, 150.0),
        forcerange=(-unit * limit, unit * limit),
    )
