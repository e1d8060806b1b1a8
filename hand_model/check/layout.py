"""Files, names, geoms and inertias."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from ..compile.clearance import SHARE_A_JOINT
from ..description import Description, Model
from ..engines.ours import load
from ..errors import DescriptionError
from .finding import Finding

Array = NDArray[np.float64]


def tree(path):  # type: ignore[no-untyped-def]
    """Root element of an XML file; raises DescriptionError where it is none."""
    from lxml import etree

    try:
        return etree.parse(str(path)).getroot()
    except (OSError, etree.XMLSyntaxError) as error:
        raise DescriptionError(f"{path}: not readable XML ({error})") from None


def files(description: Description) -> Finding:
    """The folder holds what the conventions name."""
    wanted = ["README.md", "LICENSE", "CHANGELOG.md", "hand.json", "assets"]
    missing = [name for name in wanted if not (description.folder / name).exists()]
    said = (
        f"missing: {', '.join(missing)}"
        if missing
        else f"all of {', '.join(wanted)} and {len(description.models)} pair(s) of models"
    )
    return Finding("files", not missing, float(len(missing)), said)


def names(description: Description, model: Model) -> Finding:
    """Names are those of the conventions, and unique across kinds, in both files."""
    expected = load(model.mjcf).names
    mjcf, urdf = tree(model.mjcf), tree(model.urdf)
    kinds, parts = ("body", "joint", "site", "geom", "mesh"), ("equality", "actuator", "keyframe", "tendon", "sensor")
    used = [
        e.get("name") for kind in kinds for e in mjcf.iter(kind) if e.get("name") and e.getparent().tag not in parts
    ]
    used += [e.get("name") for part in parts for e in mjcf.iterfind(f"{part}/*")]
    linked = [e.get("name") for kind in ("link", "joint") for e in urdf.findall(kind)]
    problems = [
        f'"{n}" twice in {f.name}'
        for f, u in ((model.mjcf, used), (model.urdf, linked))
        for n, c in Counter(u).items()
        if n and c > 1
    ]
    common = [
        "palm",
        "attachment",
        *expected.joint.values(),
        *expected.link.values(),
        *expected.marker.values(),
        *expected.tip.values(),
    ]
    only = [name for pairs in expected.course.values() for pair in pairs for name in pair]
    only += [*expected.linkage.values(), *expected.actuator.values(), "open", "close"]
    problems += [f'no "{name}" in {model.mjcf.name}' for name in (*common, *only) if name not in used]
    problems += [f'no "{name}" in {model.urdf.name}' for name in common if name not in linked]
    said = (
        "; ".join(problems[:5])
        or f"{len(common) + len(only)} names of the conventions found, none shared by two things"
    )
    return Finding(f"names: {model.stem}", not problems, float(len(problems)), said)


def inertias(description: Description, model: Model) -> Finding:
    """Inertias positive definite, within the triangle inequality, equal in both formats; nothing balanced behind the
    user's back."""
    mjcf, urdf = tree(model.mjcf), tree(model.urdf)
    problems = []
    if mjcf.find("compiler") is None or mjcf.find("compiler").get("balanceinertia") not in (None, "false"):
        problems.append("balanceinertia is on")
    bodies = {b.get("name"): b.find("inertial") for b in mjcf.iter("body")}
    links = {k.get("name"): k.find("inertial") for k in urdf.findall("link")}
    slack, mass = np.inf, 0.0
    for name, element in bodies.items():
        if element is None:
            problems.append(f'"{name}" has no inertia')
            continue
        xx, yy, zz, xy, xz, yz = (
            float(v) for v in (element.get("fullinertia") or f"{element.get('diaginertia')} 0 0 0").split()
        )
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        principal = np.linalg.eigvalsh(tensor)
        margin = (principal[0] + principal[1] - principal[2]) / principal[2] if principal[2] > 0 else -np.inf
        slack, mass = min(slack, margin), mass + float(element.get("mass"))
        if principal[0] <= 0 or margin < -1e-9 or float(element.get("mass")) <= 0:
            problems.append(f'"{name}": no rigid body has principal moments {principal.tolist()}')
        if name in links and links[name] is not None:
            i = links[name].find("inertia")
            same = np.array([float(i.get(k)) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")])
            if not np.allclose(same, (xx, yy, zz, xy, xz, yz), rtol=1e-12, atol=0) or links[name].find("mass").get(
                "value"
            ) != element.get("mass"):
                problems.append(f'"{name}" differs between the formats')
        elif name in _linked(model):
            problems.append(f'"{name}" has no inertia in {model.urdf.name}')
    stated = f"{mass * 1e3:.1f} g" in (description.folder / "README.md").read_text()
    problems += [] if stated else [f"README.md does not state the total mass of {mass * 1e3:.1f} g"]
    said = (
        "; ".join(problems[:5])
        or f"{len(bodies)} bodies, {mass * 1e3:.1f} g, triangle inequality with at least {slack:.2g} to spare"
    )
    return Finding(f"inertias: {model.stem}", not problems, slack, said)


def _linked(model: Model) -> set[str]:
    return {"palm", *load(model.mjcf).names.link.values()}


def geoms(description: Description, model: Model) -> Finding:
    """Visual geoms in group 2 without contact, collision geoms in group 3, convex, self-collision on; only justified
    excludes."""
    import mujoco

    from ..engines.mujoco import load as load_mujoco

    mj = load_mujoco(model.mjcf).mj
    convex = {
        int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
        for kind in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
    }
    problems = []
    for i in range(mj.ngeom):
        touches = bool(mj.geom_contype[i] or mj.geom_conaffinity[i])
        body = mj.body(mj.geom_bodyid[i]).name
        if mj.geom_group[i] not in (2, 3) or touches != (mj.geom_group[i] == 3):
            problems.append(
                f'a geom of "{body}" is in group {mj.geom_group[i]} and {"touches" if touches else "touches nothing"}'
            )
        if touches and mj.geom_type[i] not in convex:
            problems.append(f'a collision geom of "{body}" is not convex')
    colliding = {mj.geom_bodyid[i] for i in range(mj.ngeom) if mj.geom_group[i] == 3}
    problems += [f'"{name}" has no collision geom' for name in _linked(model) if mj.body(name).id not in colliding]
    pairs = {
        frozenset(e[:2]): e[2] for m in description.table["models"] if m["stem"] == model.stem for e in m["excludes"]
    }
    parent = {mj.body(i).name: mj.body(mj.body_parentid[i]).name for i in range(1, mj.nbody)}
    count = 0
    for element in tree(model.mjcf).iterfind("contact/exclude"):
        one, two, count = element.get("body1"), element.get("body2"), count + 1
        reason = pairs.get(frozenset((one, two)))
        if reason is None or (reason == SHARE_A_JOINT and two != parent.get(one) and one != parent.get(two)):
            problems.append(f'"{one}" and "{two}" are excluded from contact without a reason')
    said = (
        "; ".join(problems[:5])
        or f"{mj.ngeom} geoms in groups 2 and 3, {count} excluded pairs, each with its reason in hand.json"
    )
    return Finding(f"geoms: {model.stem}", not problems, float(len(problems)), said)
