"""Nominal joint dynamics and actuators, for hands or fingers whose motor was not identified. Nothing here was
measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .plan import Plan

ROTOR_SHARE = 30.0  # reflected rotor inertia over the finger's own: a geared drive is dominated by its motor
BANDWIDTH = 50.0  # rad/s of the position loop
FREE_TIME = 0.1  # s in which a joint without a drive loses its speed
LEAST_INERTIA = 1e-7  # kg m^2


@dataclass(frozen=True)
class Drive:
    """Nominal drive of one independent joint: armature [kg m^2], damping [N m s/rad]; kp [N m/rad], kv [N m s/rad] and
    force [N m] of the position actuator, None where the finger has no actuator on this joint."""

    armature: float
    damping: float
    actuator: str | None
    kp: float
    kv: float
    force: float


def nominal_drives(plan: Plan) -> Mapping[str, Drive]:
    """Joint name -> Drive of every independent joint: scaled to the inertia that it moves, so that any size of hand is
    stable.

    The actuator sits on a finger's first joint; further independent joints are passive.
    """
    drives: dict[str, Drive] = {}
    for finger in plan.hand.fingers:
        followers = {c.follower for c in finger.couplings}
        for i, joint in enumerate(finger.joints):
            if joint.name in followers:
                continue
            inertia = max(_moved_inertia(plan, finger.name, i), LEAST_INERTIA)
            actuator = plan.names.actuator.get(finger.name) if i == 0 else None
            armature = ROTOR_SHARE * inertia if actuator else 0.0
            total = inertia + armature
            kp = BANDWIDTH**2 * total
            drives[plan.names.joint[finger.name, joint.name]] = Drive(
                armature, total / FREE_TIME, actuator, kp, 2 * BANDWIDTH * total, 0.5 * kp
            )
    return drives


def _moved_inertia(plan: Plan, finger: str, first: int) -> float:
    """Inertia [kg m^2] about joint `first` of the segments that it carries, open."""
    links = [k for k in plan.links if k.finger == finger]
    axis, origin, total = links[first].axis, np.zeros(3), 0.0
    for i, link in enumerate(links[first:]):
        origin = origin + (link.position_parent if i else 0)
        lever = np.cross(axis, origin + link.inertia.centre)
        total += float(axis @ link.inertia.tensor @ axis + link.inertia.mass * (lever @ lever))
    return total
