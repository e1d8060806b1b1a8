"""The README of a compiled folder: how it was derived, known issues, verification figures."""

from __future__ import annotations

import numpy as np

from ..effects import effect
from ..effects.base import Effect
from ..hand import Hand
from .clearance import SHARE_A_JOINT
from .course import lost_in_urdf, with_courses
from .plan import Plan
from .shape import DENSITY

VERIFICATION = "## Verification"

CHANGELOG = """# Changelog

- First version: compiled by `hand-model compile`; compiling the same hand again gives the same bytes.
"""

LICENSE = """This description (MJCF, URDF, meshes, hand.json) was generated from recordings by hand_model (MIT).
The figures in it belong to whoever made the recordings named in README.md; their terms apply to this folder.
Where they state none, treat it as MIT-licensed:

Permission is hereby granted, free of charge, to any person obtaining a copy of these files, to deal in them without
restriction, including without limitation the rights to use, copy, modify, merge, publish, distribute, sublicense,
and/or sell copies of them, subject to this notice being included in all copies or substantial portions of them.

THE FILES ARE PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED. IN NO EVENT SHALL THE AUTHORS OR
COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY ARISING FROM THE FILES OR THEIR USE.
"""


def readme(hand: Hand, plans: tuple[Plan, ...]) -> str:
    """The README's text."""
    parts = [
        (
            f"# {plans[0].stem}\n\nA {hand.side} {hand.name} hand for MuJoCo (MJCF) and ROS, "
            "Pinocchio and others (URDF).\n"
        ),
        _files(plans),
        _derivation(hand, plans),
        _joints(hand),
        _linkages(plans),
        _courses(hand),
        _motors(hand),
        _effects(hand),
        _surfaces(plans),
        _keyframes(plans),
        _known_issues(hand, plans),
        f"{VERIFICATION}\n\nNot yet run. `hand-model check` on this folder measures every item of it.\n",
    ]
    return "\n".join(part for part in parts if part)


def _files(plans: tuple[Plan, ...]) -> str:
    lines = ["## Files\n"]
    for plan in plans:
        fingers = ", ".join(f.name for f in plan.hand.fingers)
        lines.append(
            f"- `{plan.stem}.xml`, `{plan.stem}.urdf`: {fingers}; {plan.mass * 1e3:.1f} g (fallback, see below)"
        )
    lines.append("- `scene_*.xml`: the hand with floor and light. `assets/`: meshes.")
    lines.append(
        "- `scene_*_cylinder.xml` (with the grip `power`): close the hand, lower the mocap body `support`: it holds."
    )
    lines.append(
        "- `*.ros2_control.xacro` (with actuators): the hand on a robot's link (`parent`), under ros2_control."
    )
    lines.append(
        "- `hand.json`: encoder maps, uncertainties, couplings, motors, effects, provenance; also a `.hand` file."
    )
    return "\n".join(lines) + "\n"


def _derivation(hand: Hand, plans: tuple[Plan, ...]) -> str:
    steps = [
        "The `palm` body is the repeatable frame that the three probed palm landmarks define.",
        (
            "Every other body has the palm's orientation at rest, where angles are zero, "
            "and its origin at its joint's centre."
        ),
        hand.extra.get(
            "origin",
            "Axes, centres and markers were identified from the recordings listed below; covariances: `hand.json`.",
        ),
        "Limits are the recorded ranges, widened to what a follower's polynomial reaches over its driver's range.",
        "A linkage is its polynomial, enforced by an MJCF joint equality (`joint1` follows `joint2`).",
        "URDF's mimic holds the least-squares line through that polynomial that stays within the limits.",
        f"Masses and inertias are a fallback, not measured: solid capsules between the joints, {DENSITY:.0f} kg/m^3.",
        "Where a watertight surface was probed, mass and inertia are its inside's at that density.",
        "Visual meshes (group 2) are the probed surfaces, else these capsules.",
        (
            "Contact (group 3): convex parts of probed surfaces, else the capsules, "
            "shrunk until nothing touches at any keyframe."
        ),
    ]
    if any(plan.names.actuator for plan in plans) and not hand.motors:
        steps.append(
            "Actuators, armature and damping are nominal, scaled to the fallback inertias: stable, not measured."
        )
    steps += hand.notes
    text = "## How it was derived\n\n" + "\n".join(f"{i}. {step}" for i, step in enumerate(steps, 1)) + "\n"
    if hand.provenance:
        rows = "\n".join(f"| `{name}` | `{digest}` |" for name, digest in sorted(hand.provenance.items()))
        text += f"\n| recording | SHA-256 |\n| --- | --- |\n{rows}\n"
    return text


def _joints(hand: Hand) -> str:
    rows = [
        "## Joints\n",
        "| finger | joint | range, deg | axis sd, deg | centre sd, mm | |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for finger in hand.fingers:
        for joint in finger.joints:
            low, high = np.degrees(joint.range_rad)
            axis, centre = deviation(np.asarray(joint.covariance, float))
            note = "degenerate" if joint.degenerate else ""
            rows.append(f"| {finger.name} | {joint.name} | {low:.1f} to {high:.1f} | {axis} | {centre} | {note} |")
    return "\n".join(rows) + "\n"


def deviation(covariance: np.ndarray) -> tuple[str, str]:
    """Root of the summed variances of axis [deg] and centre [mm] as text; a dash where they are unknown."""
    variances = np.diagonal(covariance)
    out = []
    for part, scale in ((variances[:3], 180 / np.pi), (variances[3:], 1e3)):
        known = np.isfinite(part).all() and (part >= 0).all() and part.sum() > 0
        out.append(f"{np.sqrt(part.sum()) * scale:.2g}" if known else "-")
    return out[0], out[1]


def _linkages(plans: tuple[Plan, ...]) -> str:
    seen = {name: (finger, k) for plan in plans for name, (finger, k) in plan.linkages.items()}
    if not seen:
        return ""
    rows = ["## Linkages\n", "What URDF's linear mimic loses against the polynomial, at worst over the range:\n"]
    rows += ["| equality | follower of | angle, deg | tip, mm |", "| --- | --- | --- | --- |"]
    for name, (_, k) in seen.items():
        rows.append(
            f"| `{name}` | {k.follower} of {k.driver} | {np.degrees(k.loss_rad):.2f} | {k.loss_tip_m * 1e3:.2f} |"
        )
    return "\n".join(rows) + "\n"


def _courses(hand: Hand) -> str:
    crooked = with_courses(hand)
    if not crooked:
        return ""
    rows = ["## Joints that are no plain hinges\n"]
    rows.append(
        "In the MJCF their segments have extra joints, tied to the hinge's angle by equalities (`polycoef`). "
        "The URDF has the"
    )
    rows.append("hinge alone; what that loses, at worst over the range:\n")
    rows += ["| finger | joint | extra joints | tilt, deg | tip, mm |", "| --- | --- | --- | --- | --- |"]
    for finger, joint in crooked:
        tilt, tip = lost_in_urdf(finger, joint)
        kinds = ", ".join(e.kind for e in joint.course.joints)
        rows.append(f"| {finger.name} | {joint.name} | {kinds} | {np.degrees(tilt):.2f} | {tip * 1e3:.2f} |")
    if any(e.kind == "slide" for _, joint in crooked for e in joint.course.joints):
        rows.append(
            "\nThe ties of slides have an absolute stiffness (`solref` below zero), right for this file's inertias: "
            "whoever makes their"
        )
        rows.append('finger much heavier gives them MuJoCo\'s own (`solref="0.002 1"`).')
    return "\n".join(rows) + "\n"


def _motors(hand: Hand) -> str:
    if not hand.motors and not hand.effects:
        return ""
    rows = ["## Motors and effects\n", "In the hand's raw units where a unit says so; what is not listed is nominal.\n"]
    rows += ["| of | parameter | value | 95 % interval | unit | origin |", "| --- | --- | --- | --- | --- | --- |"]
    named = [(m.actuator, m.parameters) for m in hand.motors]
    named += [
        (f"{e.effect} ({e.where.get('finger') or e.where.get('actuator') or 'hand'})", e.parameters)
        for e in hand.effects
    ]
    for owner, parameters in named:
        for name, e in parameters.items():
            interval = "-" if e.ci95 is None else f"{e.ci95[0]:.4g} to {e.ci95[1]:.4g}"
            rows.append(f"| {owner} | {name} | {e.value:.4g} | {interval} | {e.unit} | {e.origin} |")
    return "\n".join(rows) + "\n"


def _effects(hand: Hand) -> str:
    """Where each effect is applied: by the MJCF, by the passive-force callback, or by nothing but hand.json."""
    if not hand.effects:
        return ""
    rows = ["## Where the effects are\n", "| effect | of | MJCF | callback | URDF |", "| --- | --- | --- | --- | --- |"]
    called, crooked = False, {(f.name, j.name) for f, j in with_courses(hand)}
    for found in hand.effects:
        kind = effect(found.effect)
        law = kind.law({name: e.value for name, e in found.parameters.items()}) is not None
        place = " ".join(str(found.where[k]) for k in ("finger", "joint") if found.where.get(k))
        native = (
            not law
            and type(kind).write_mjcf is not Effect.write_mjcf
            and (kind.station != "markers" or (found.where.get("finger"), found.where.get("joint")) in crooked)
        )
        held = "yes" if native else f"no: {kind.unwritten}" if kind.unwritten and not law else "no"
        rows.append(
            f"| {found.effect} | {place} | {held} | "
            f"{'yes' if law else 'not needed' if native else 'no'} | no: hand.json |"
        )
        called |= law
    if called:
        rows += [
            "\nEffects of the callback act once it is switched on, in every `mj_step` from then on:\n",
            "```python",
            "model = mujoco.MjModel.from_xml_path(mjcf)",
            "hand_model.effects_on(model, folder)  # this folder",
            "```",
        ]
    return "\n".join(rows) + "\n"


def _surfaces(plans: tuple[Plan, ...]) -> str:
    links = {link.name: link for plan in plans for link in plan.links if link.surface is not None and link.surface.how}
    if not links:
        return ""
    rows = [f"- `{name}`: {link.surface.how}; {link.inertia.mass * 1e3:.1f} g" for name, link in links.items()]
    return "## Surfaces\n\n" + "\n".join(rows) + "\n"


def _keyframes(plans: tuple[Plan, ...]) -> str:
    rows = ["## Keyframes\n", "Fraction of its range by which each finger is closed:\n"]
    for plan in plans:
        fingers = [f.name for f in plan.hand.fingers]
        rows += [f"| `{plan.stem}` | " + " | ".join(fingers) + " |", "| --- |" + " --- |" * len(fingers)]
        rows += [
            f"| `{name}` | " + " | ".join(f"{reached[f]:.2f}" for f in fingers) + " |"
            for name, reached in plan.reached.items()
        ]
        rows.append("")
    return "\n".join(rows)


def _known_issues(hand: Hand, plans: tuple[Plan, ...]) -> str:
    issues = []
    for finger in hand.fingers:
        for joint in finger.joints:
            if joint.degenerate:
                issues.append(
                    f"{finger.name} {joint.name}: the recorded arc does not determine axis or centre; "
                    "see its uncertainty."
                )
    for plan in plans:
        issues += [f"{finger}: the fingertip is a guess ({how})." for finger, how in plan.guessed_tips.items()]
        for name, reached in plan.reached.items():
            short = [f for f, fraction in reached.items() if name == "close" and fraction < 1]
            if short:
                issues.append(f"`{plan.stem}`, `{name}`: {', '.join(short)} would meet another finger and stops short.")
        for one, other, reason in plan.excludes:
            if reason != SHARE_A_JOINT:
                issues.append(f"`{plan.stem}`: no contact between `{one}` and `{other}`, whose primitives {reason}.")
    for plan in plans:
        issues += plan.contact_notes
    issues.append("The attachment site is the palm frame itself: the wrist's interface was not measured.")
    links = {link.name: link for plan in plans for link in plan.links}.values()
    fallback = [link.name for link in links if link.surface is None]
    leaky = [link.name for link in links if link.surface is not None and not link.surface.watertight]
    if fallback:
        issues.append(f"Shape, mass and inertia are a fallback until surfaces are probed: {', '.join(fallback)}.")
    if leaky:
        issues.append(f"The surface is not watertight, mass and inertia remain the fallback's: {', '.join(leaky)}.")
    return "## Known issues\n\n" + "\n".join(f"- {issue}" for issue in dict.fromkeys(issues)) + "\n"
