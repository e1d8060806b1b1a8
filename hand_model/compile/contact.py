"""Convex parts of probed surfaces in contact, where nothing touches with them at any keyframe."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from .mesh import link_meshes, stl
from .mjcf import mjcf
from .plan import Plan
from .xml import document


def settled(plan: Plan) -> Plan:
    """The plan with capsules for contact, in place of convex parts, on those links whose parts would touch another link
    at rest or at a keyframe; `contact_notes` says which."""
    notes = []
    while any(link.parts for link in plan.links):
        touching = _touching(plan)
        own = {link.name: len(link.parts) for link in plan.links if link.parts}
        blamed = Counter(name for pair in touching for name in pair[:2] if name in own)
        if not blamed:
            break
        worst = min(blamed, key=lambda name: (-blamed[name], name))
        one, other, where = next(t for t in sorted(touching) if worst in t[:2])
        with_ = other if worst == one else one
        notes.append(
            f"`{plan.stem}`: contact of `{worst}` stays with capsules, "
            f"its probed parts would touch `{with_}` at {where}."
        )
        plan = replace(plan, links=tuple(replace(k, parts=()) if k.name == worst else k for k in plan.links))
    return replace(plan, contact_notes=tuple(notes))


def _touching(plan: Plan) -> set[tuple[str, str, str]]:
    """(body, body, posture) of all contacts, as MuJoCo finds them."""
    import mujoco

    assets = {name: stl(*mesh) for link in plan.links for name, mesh in link_meshes(link).items()}
    model = mujoco.MjModel.from_xml_string(document(mjcf(plan)).decode(), assets)
    data, found = mujoco.MjData(model), set()
    for i in range(-1, model.nkey):
        mujoco.mj_resetData(model, data) if i < 0 else mujoco.mj_resetDataKeyframe(model, data, i)
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            one, other = sorted(model.body(model.geom_bodyid[g]).name for g in contact.geom)
            found.add((one, other, model.key(i).name if i >= 0 else "rest"))
    return found
