"""Scenes around a hand: a floor, and a cylinder for it to close on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kinematics import unit
from .mjcf import mjcf
from .plan import Plan
from .shape import Capsule, segment_distance
from .surface import Surface
from .xml import child, vector

Array = NDArray[np.float64]

GRIP = "power"  # a hand with this keyframe gets a cylinder
RADIUS, FORWARD = (
    0.6,
    0.0,
)  # of the cylinder and of its place before the finger bases, in lengths of the fingers' first segment
DENSITY = 400.0  # kg/m^3, wood
GAP = 5e-4  # m between the open fingers and the cylinder


def scene(plan: Plan) -> Any:
    """The hand above a floor, with a light and a camera distance that suit its size."""
    from lxml import etree

    root = etree.Element("mujoco", model=f"{plan.stem}_scene")
    child(root, "include", file=f"{plan.stem}.xml")
    surroundings(root, plan.reach)
    return root


def surroundings(root: Any, reach: float) -> None:
    """Floor, light and view for a hand of that reach [m]."""
    child(root, "statistic", center=(0.3 * reach, 0.0, 0.0), extent=1.2 * reach, meansize=0.05 * reach)
    child(child(root, "visual"), "headlight", ambient=(0.4, 0.4, 0.4), diffuse=(0.5, 0.5, 0.5))
    asset = child(root, "asset")
    child(
        asset,
        "texture",
        name="floor",
        type="2d",
        builtin="checker",
        rgb1=(0.85, 0.85, 0.85),
        rgb2=(0.7, 0.7, 0.7),
        width="64",
        height="64",
    )
    child(asset, "material", name="floor", texture="floor", texrepeat=(20, 20), texuniform=True)
    world = root.find("worldbody")
    world = child(root, "worldbody") if world is None else world
    child(world, "light", pos=(0.0, 0.0, 10 * reach), dir=(0.0, 0.0, -1.0), directional=True)
    child(
        world,
        "geom",
        name="floor",
        type="plane",
        size=(10 * reach, 10 * reach, 0.1),
        pos=(0.0, 0.0, -2 * reach),
        material="floor",
    )


def cylinder_scene(plan: Plan) -> Any | None:
    """The hand over a cylinder that lies on two supports; None for a hand without the grip `power`.

    Close the fingers (keyframe `power`, or full controls), then lower the mocap body `support`: the hand holds the
    cylinder.
    """
    room = _room(plan) if GRIP in plan.keyframes else None
    if room is None:
        return None
    centre, along, out, radius, half = room
    root = mjcf(plan)
    root.set("model", f"{plan.stem}_cylinder")
    surroundings(root, plan.reach)
    world = root.find("worldbody")
    quaternion = _quaternion(along, out)
    body = child(world, "body", name="cylinder", pos=centre, quat=quaternion)
    child(body, "freejoint", name="cylinder_free")
    child(
        body,
        "geom",
        name="cylinder_geom",
        type="cylinder",
        size=(radius, half),
        density=DENSITY,
        condim="4",
        friction=(1.0, 0.01, 1e-4),
    )
    support = child(world, "body", name="support", mocap=True, pos=centre, quat=quaternion)
    for i, end in enumerate((-1.0, 1.0)):  # in the support's frame: z along the cylinder, y out of the palm
        below = (0.0, radius + 0.003, end * (half - 0.004))
        child(support, "geom", name=f"support_{i}", type="box", size=(0.5 * radius, 0.003, 0.004), pos=below)
    for key in root.iterfind("keyframe/key"):
        key.set("qpos", f"{key.get('qpos')} {vector(np.concatenate([centre, quaternion]))}")
    keyframe = root.find("keyframe")
    root.remove(keyframe)
    root.append(keyframe)
    return root


def _room(plan: Plan) -> tuple[Array, Array, Array, float, float] | None:
    """Centre (3,) [m], unit axis (3,), unit direction out of the palm (3,), radius and half length [m] of a cylinder
    under the open fingers' first segments; None where there is no room for it, or fewer than two fingers beside the
    thumb."""
    fingers = [f for f in plan.hand.fingers if not f.name.startswith("thumb")]
    if len(fingers) < 2:
        return None
    base, knuckle, tip, flexing = (
        np.mean([v(f) for f in fingers], axis=0)
        for v in (
            lambda f: f.joints[0].centre_palm,
            lambda f: f.joints[min(1, len(f.joints) - 1)].centre_palm,
            lambda f: f.joints[-1].tip_palm,
            lambda f: np.cross(f.joints[0].axis_palm, f.joints[-1].tip_palm - f.joints[0].centre_palm),
        )
    )
    forward = unit(tip - base)
    out = unit(flexing - (flexing @ forward) * forward)
    along = np.cross(out, forward)
    length = float(np.linalg.norm(knuckle - base))
    radius = RADIUS * length
    thickness = max(c.radius for k in plan.links if k.finger and not k.finger.startswith("thumb") for c in k.shapes)
    breadth = np.array([f.joints[0].centre_palm for f in fingers]) @ along
    half = 0.5 * float(np.ptp(breadth)) + 3 * thickness
    capsules = [k for k in plan.links if not k.parts]
    solids = [Capsule(s.start + plan.origin(k), s.end + plan.origin(k), s.radius) for k in capsules for s in k.shapes]
    probed = [_spread_over(part) + plan.origin(k) for k in plan.links for part in k.parts]
    points = np.concatenate([np.zeros((0, 3)), *probed])
    for below in np.arange(thickness + GAP, thickness + length, GAP):
        centre = base + FORWARD * length * forward + (below + radius) * out
        ends = centre - half * along, centre + half * along
        away = _from_segment(points, *ends).min(initial=np.inf) > radius + GAP
        if away and all(segment_distance(*ends, c.start, c.end) > c.radius + radius + GAP for c in solids):
            return centre, along, out, radius, half
    return None


def _spread_over(part: Surface) -> Array:
    """Points (n, 3) [m] all over a mesh, a sixth of a triangle's edge apart."""
    weights = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6
    return np.einsum("wc,fck->fwk", weights, part.vertices[part.faces]).reshape(-1, 3)


def _from_segment(points: Array, a: Array, b: Array) -> Array:
    """Distances (n,) [m] of points (n, 3) from the line segment a-b."""
    along = b - a
    share = np.clip((points - a) @ along / (along @ along), 0, 1)
    return np.linalg.norm(points - a - share[:, None] * along, axis=1)


def _quaternion(along: Array, out: Array) -> Array:
    """Quaternion (4,) w x y z of a frame whose z axis is `along` and whose y axis is `out`."""
    from scipy.spatial.transform import Rotation

    w = Rotation.from_matrix(np.stack([np.cross(out, along), out, along], axis=1)).as_quat()
    return np.array([w[3], *w[:3]])
