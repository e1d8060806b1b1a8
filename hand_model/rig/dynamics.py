"""Joint effort of an open chain as a linear function of its inertial parameters, all samples at once.

Spatial regressor of Atkeson, An & Hollerbach (1986): each body's force and moment about its own frame are linear in
mass, first moment and inertia about that frame; the joints feel them through the frame's Jacobian.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
INERTIAL = ("m", "hx", "hy", "hz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


def _axis_rotation(axis: Array, angle: Array) -> Array:
    """Rotations (n, 3, 3) about one unit axis (Rodrigues)."""
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle)[:, None, None] * skew + (1 - np.cos(angle))[:, None, None] * (skew @ skew)


def inertial_columns(model: Any, position: Array, velocity: Array, acceleration: Array, gravity: Array) -> Array:
    """Regressor (n, joints, bodies, 10) so that joint effort = sum over bodies and INERTIAL of column x parameter.

    model: compiled mjModel with hinges and slides only. position, velocity, acceleration: (n, joints) SI. gravity:
    (3,).
    Parameters of a body: m [kg], h = m x centre [kg m], inertia about the body frame's origin [kg m2], body frame axes.
    """
    n, bodies = len(position), model.nbody
    world = [None] * bodies
    world[0] = (
        np.broadcast_to(np.eye(3), (n, 3, 3)),
        np.zeros((n, 3)),
        np.zeros((n, 3)),
        np.zeros((n, 3)),
        np.broadcast_to(-gravity, (n, 3)),
        {},
    )
    out = np.zeros((n, model.njnt, bodies - 1, 10))
    for b in range(1, bodies):
        world[b] = _move(model, b, world[model.body_parentid[b]], position, velocity, acceleration)
        rotation, _, omega, alpha, accel, jacobian = world[b]
        to_body = np.swapaxes(rotation, 1, 2)
        force, moment = _wrench(*(np.einsum("nij,nj->ni", to_body, v) for v in (omega, alpha, accel)))
        for joint, (linear, angular) in jacobian.items():
            lin, ang = (np.einsum("nij,nj->ni", to_body, v) for v in (linear, angular))
            out[:, joint, b - 1] = np.einsum("ni,nip->np", lin, force) + np.einsum("ni,nip->np", ang, moment)
    return out


def _move(model: Any, b: int, parent: tuple, q: Array, v: Array, a: Array) -> tuple:
    """Frame, angular motion and origin acceleration of body b, and the Jacobian of its origin, all in the world."""
    rotation, origin, omega, alpha, accel, jacobian = parent
    offset = np.einsum("nij,j->ni", rotation, model.body_pos[b])
    accel = accel + np.cross(alpha, offset) + np.cross(omega, np.cross(omega, offset))
    jacobian = {j: (lin + np.cross(ang, offset), ang) for j, (lin, ang) in jacobian.items()}
    origin = origin + offset
    w, x, y, z = model.body_quat[b]
    fixed = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                      [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                      [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip
    rotation = rotation @ fixed
    for j in range(model.body_jntadr[b], model.body_jntadr[b] + model.body_jntnum[b]):
        axis = np.einsum("nij,j->ni", rotation, model.jnt_axis[j])
        rate, change, angle = v[:, j, None], a[:, j, None], q[:, j] - model.qpos0[j]
        zero = np.zeros_like(axis)
        if model.jnt_type[j] == 2:  # slide
            shift = axis * angle[:, None]
            accel = accel + np.cross(alpha, shift) + np.cross(omega, np.cross(omega, shift))
            accel = accel + axis * change + 2 * np.cross(omega, axis * rate)
            jacobian = {k: (lin + np.cross(ang, shift), ang) for k, (lin, ang) in jacobian.items()} | {j: (axis, zero)}
            origin = origin + shift
            continue
        arm = np.einsum("nij,j->ni", rotation, model.jnt_pos[j])  # the anchor, about which the body turns
        anchor_accel = accel + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
        anchor_jac = {k: (lin + np.cross(ang, arm), ang) for k, (lin, ang) in jacobian.items()} | {j: (zero, axis)}
        alpha = alpha + axis * change + np.cross(omega, axis * rate)
        omega = omega + axis * rate
        rotation = rotation @ _axis_rotation(model.jnt_axis[j], angle)
        back = -np.einsum("nij,j->ni", rotation, model.jnt_pos[j])
        accel = anchor_accel + np.cross(alpha, back) + np.cross(omega, np.cross(omega, back))
        jacobian = {k: (lin + np.cross(ang, back), ang) for k, (lin, ang) in anchor_jac.items()}
        origin = origin + arm + back
    return rotation, origin, omega, alpha, accel, jacobian


def _wrench(omega: Array, alpha: Array, accel: Array) -> tuple[Array, Array]:
    """Force and moment (n, 3, 10) about the body origin per inertial parameter, in the body frame."""
    n = len(omega)
    force, moment = np.zeros((n, 3, 10)), np.zeros((n, 3, 10))
    force[:, :, 0] = accel
    eye = np.eye(3)
    for i in range(3):
        unit = np.broadcast_to(eye[i], (n, 3))
        force[:, :, 1 + i] = np.cross(alpha, unit) + np.cross(omega, np.cross(omega, unit))
        moment[:, :, 1 + i] = np.cross(unit, accel)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    for p, (i, k) in enumerate(pairs):
        basis = np.zeros((3, 3))
        basis[i, k] = basis[k, i] = 1.0
        moment[:, :, 4 + p] = alpha @ basis + np.cross(omega, omega @ basis)
    return force, moment


def inertial_parameters(model: Any) -> Array:
    """Declared parameters (bodies, 10) in the order of INERTIAL, from a compiled mjModel."""
    import mujoco

    out = np.zeros((model.nbody - 1, 10))
    for b in range(1, model.nbody):
        mass, centre = model.body_mass[b], model.body_ipos[b]
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[b])
        turn = turn.reshape(3, 3)
        inertia = turn @ np.diag(model.body_inertia[b]) @ turn.T
        inertia = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        i = inertia
        out[b - 1] = [mass, *(mass * centre), i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return out
