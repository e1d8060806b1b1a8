"""The engines' own evaluation of the same poses: MuJoCo for an MJCF, Pinocchio for a URDF."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from lxml import etree

from ..errors import DescriptionError, did_you_mean
from .tree import Array, Tree, forward
from .urdf import parse_xml

ENGINES = ("mujoco", "pinocchio")
AGREEMENT_M = 1e-9


def verify(
    trees: Sequence[Tree], values: Mapping[str, Array], partner: Mapping[str, str], engines: Collection[str]
) -> str:
    """Evaluate every pose with the engines and compare the far links with this package's kinematics; say by how much
    they differ.

    A far link carries none of the other joints: its pose holds every joint before it.

    values: joint of the first tree -> (n,) [rad or m]; partner: joint of the first -> joint of the second. Raises
    DescriptionError where an engine cannot load a file or differs by more than 1e-9 m (or the same number in a
    rotation).
    """
    for name in engines:
        if name not in ENGINES:
            raise DescriptionError(f'no engine "{name}"; {did_you_mean(name, ENGINES)}')
    said = []
    for tree, mine in zip(trees, (values, {partner[x]: v for x, v in values.items()}), strict=True):
        engine = "mujoco" if tree.format == "mjcf" else "pinocchio"
        if engine not in engines:
            continue
        links = _far(tree, list(mine))
        run = _mujoco if engine == "mujoco" else _pinocchio
        positions, rotations = run(tree, mine, links)
        own = forward(tree, mine, links)
        worst = max(
            max(float(np.abs(p - positions[:, i]).max()), float(np.abs(r - rotations[:, i]).max()))
            for i, (r, p) in enumerate(own)
        )
        if worst > AGREEMENT_M:
            raise DescriptionError(
                f"{tree.path}: {engine} places its links {worst:.3g} m away from this package's kinematics"
            )
        said.append(f"{engine} agrees on {tree.path.name} to {worst:.1e} m")
    return "; ".join(said) if said else "no engine asked for reads these formats"


def _far(tree: Tree, joints: Sequence[str]) -> list[int]:
    nodes = [tree.joint_node[n] for n in joints if tree.nodes[tree.joint_node[n]].kind == "link"]
    inner = {up for i in nodes for up in tree.ancestors(i)[1:]}
    return [i for i in nodes if i not in inner]


def skeleton(tree: Tree) -> str:
    """The MJCF without geoms, assets and everything that refers to them, so that missing meshes do not matter."""
    from .mjcf import _include

    root = parse_xml(tree.path).getroot()
    _include(root, tree.path, (tree.path.resolve(),))
    for tag in (
        "asset",
        "contact",
        "sensor",
        "tendon",
        "actuator",
        "equality",
        "keyframe",
        "deformable",
        "custom",
        "extension",
        "visual",
    ):
        for found in root.findall(tag):
            root.remove(found)
    for tag in ("geom", "camera", "light", "inertial", "plugin"):
        for found in list(root.iter(tag)):
            if not any(up.tag == "default" for up in found.iterancestors()):
                found.getparent().remove(found)
    for default in root.findall("default"):
        for tag in (
            "geom",
            "mesh",
            "material",
            "position",
            "general",
            "motor",
            "velocity",
            "tendon",
            "pair",
            "equality",
        ):
            for found in list(default.iter(tag)):
                found.getparent().remove(found)
    for compiler in root.findall("compiler"):
        for attribute in ("meshdir", "texturedir", "assetdir", "inertiafromgeom", "balanceinertia", "settotalmass"):
            compiler.attrib.pop(attribute, None)
    for body in root.iter("body"):
        etree.SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
    return etree.tostring(root, encoding="unicode")


def _mujoco(tree: Tree, values: Mapping[str, Array], links: Sequence[int]) -> tuple[Array, Array]:
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_string(skeleton(tree))
    except ValueError as error:
        raise DescriptionError(f"{tree.path}: MuJoCo does not load it ({error})") from None
    data = mujoco.MjData(model)
    data.qpos[:] = 0
    for j in range(model.njnt):  # a free joint keeps its body's place, as the reader takes it
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE:
            at = model.jnt_qposadr[j]
            data.qpos[at : at + 7] = model.qpos0[at : at + 7]
    columns = [int(model.joint(n).qposadr[0]) for n in values]
    bodies = [model.body(tree.nodes[i].name).id for i in links]
    table = np.stack(list(values.values()), axis=1)
    positions, rotations = np.empty((len(table), len(bodies), 3)), np.empty((len(table), len(bodies), 9))
    for row, q in enumerate(table):
        data.qpos[columns] = q
        mujoco.mj_kinematics(model, data)
        positions[row], rotations[row] = data.xpos[bodies], data.xmat[bodies]
    return positions, rotations.reshape(len(table), len(bodies), 3, 3)


def _pinocchio(tree: Tree, values: Mapping[str, Array], links: Sequence[int]) -> tuple[Array, Array]:
    import pinocchio as pin

    try:
        model = pin.buildModelFromUrdf(str(tree.path))
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f"{tree.path}: Pinocchio does not load it ({error})") from None
    data = model.createData()
    table = np.stack(list(values.values()), axis=1)
    q = np.tile(pin.neutral(model), (len(table), 1))
    for column, name in enumerate(values):
        joint = model.getJointId(name)
        at = model.idx_qs[joint]
        if model.nqs[joint] == 2:  # continuous: cosine and sine
            q[:, at], q[:, at + 1] = np.cos(table[:, column]), np.sin(table[:, column])
        else:
            q[:, at] = table[:, column]
    joints = [model.getJointId(tree.nodes[i].joint.name) for i in links]
    positions, rotations = np.empty((len(table), len(links), 3)), np.empty((len(table), len(links), 3, 3))
    for row in range(len(table)):
        pin.forwardKinematics(model, data, q[row])
        for column, joint in enumerate(joints):
            placed = data.oMi[joint]
            positions[row, column], rotations[row, column] = placed.translation, placed.rotation
    return positions, rotations
