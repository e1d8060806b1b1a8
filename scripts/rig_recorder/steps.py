"""Time stepping at a fraction of a millisecond: one joint behind a drive, or two joints of an arm.

Dry friction is an impulse that stops the joint or opposes it (Moreau 1988): sticking needs no smoothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .law import Law

Array = NDArray[np.float64]
Control = Callable[[int, float, float], float]  # (tick, position, velocity) -> input of the drive


@dataclass(frozen=True)
class Drive:
    """gain: effort per input; back_emf: effort per velocity; delay_s: until an input acts; lag_s: of a first order;
    sag: share of the gain lost at an input of one (a supply that gives way)."""

    gain: float = 1.0
    back_emf: float = 0.0
    delay_s: float = 0.0
    lag_s: float = 0.0
    sag: float = 0.0


@dataclass(frozen=True)
class Track:
    """What happened, at fine steps: time_s (n,), position, velocity, effort of the drive (n, joints), its input (n,
    joints)."""

    time_s: Array
    position: Array
    velocity: Array
    effort: Array
    input: Array


def grit(random: np.random.Generator, count: int, step_s: float, time_s: float) -> Array:
    """A wandering level (count,) of variance one and the given correlation time."""
    every = max(1, int(0.02 * time_s / step_s))
    keep, noise = math.exp(-every * step_s / time_s), random.standard_normal(count // every + 2)
    level = np.zeros(len(noise))
    for k in range(1, len(noise)):
        level[k] = keep * level[k - 1] + math.sqrt(1 - keep**2) * noise[k]
    return np.interp(np.arange(count), every * np.arange(len(level)), level)


def one_joint(
    law: Law,
    drive: Drive,
    control: Control,
    seconds: float,
    start: tuple[float, float],
    random: np.random.Generator,
    step_s: float = 2.5e-4,
    tick_s: float = 1e-3,
) -> Track:
    """Step one joint from start (position, velocity); control is asked every tick_s."""
    count, each = int(seconds / step_s), max(1, round(tick_s / step_s))
    wander = grit(random, count, step_s, law.grit[1]) if law.grit[0] else np.zeros(count)
    late = round(drive.delay_s / step_s)
    out, asked = np.empty((count, 4)), np.zeros(count + late + 1)
    (q, v), load, acting, plastic = start, 0.0, 0.0, 0.0
    other, other_v = start
    follow = step_s / max(drive.lag_s, step_s)
    for k in range(count):
        if k % each == 0:
            u = control(k // each, q, v)
        asked[k + late] = u
        acting += follow * (asked[k] - acting)
        effort = drive.gain * (1.0 - drive.sag * abs(acting)) * acting - drive.back_emf * v
        force = effort - law.pull(q) - law.smooth(q, v) - law.stop[0] * plastic
        if law.slosh[0]:
            between = law.slosh[0] * (other - q) + law.slosh[2] * (other_v - v)
            other_v -= step_s * between / law.slosh[1]
            other += step_s * other_v
            force += between
        limit = law.dry(q, v, load, effort, wander[k])
        free = v + step_s * force / law.inertia
        slip = step_s * limit / law.inertia
        new = 0.0 if abs(free) <= slip else free - math.copysign(slip, free)
        load += 0.2 * (law.pull(q) + law.inertia * (new - v) / step_s - load)
        v = new
        if law.stop[0]:
            plastic = min(max(plastic + step_s * v / law.stop[1], -1.0), 1.0)
        q += step_s * v
        out[k] = q, v, effort, u
    return Track(step_s * np.arange(1, count + 1), *(out[:, k : k + 1] for k in range(4)))


@dataclass(frozen=True)
class Arm:
    """Two links in a vertical plane, angles from hanging, the second relative. own: inertia about the own joint with
    rotor (two);
    cross: m2 l1 c2; carried: m2 l1^2; rotors: (two); weights: of the first link with all it carries at l1, of the
    second."""

    own: tuple[float, float]
    rotors: tuple[float, float]
    cross: float
    carried: float
    weights: tuple[float, float]


def two_joints(
    arm: Arm,
    laws: Sequence[Law],
    controls: Callable[[int, Sequence[float], Sequence[float]], Sequence[float]],
    seconds: float,
    step_s: float = 2.5e-4,
    tick_s: float = 1e-3,
) -> Track:
    """Step an arm from hanging still; controls give both torques every tick_s."""
    count, each = int(seconds / step_s), max(1, round(tick_s / step_s))
    out, q, v, torque, load = np.empty((count, 6)), [0.0, 0.0], [0.0, 0.0], (0.0, 0.0), [0.0, 0.0]
    for k in range(count):
        if k % each == 0:
            torque = controls(k // each, q, v)
        c, s = math.cos(q[1]), math.sin(q[1])
        m00 = arm.own[0] + arm.carried + arm.own[1] + 2 * arm.cross * c + arm.rotors[0]
        m01, m11 = arm.own[1] + arm.cross * c, arm.own[1] + arm.rotors[1]
        g1 = arm.weights[1] * math.sin(q[0] + q[1])
        h = arm.cross * s
        rigid = (h * v[1] * (2 * v[0] + v[1]) - arm.weights[0] * math.sin(q[0]) - g1, -h * v[0] ** 2 - g1)
        force = [rigid[j] + torque[j] - laws[j].smooth(q[j], v[j]) for j in (0, 1)]
        det = m00 * m11 - m01 * m01
        free = [
            v[0] + step_s * (m11 * force[0] - m01 * force[1]) / det,
            v[1] + step_s * (m00 * force[1] - m01 * force[0]) / det,
        ]
        limit = [step_s * laws[j].dry(q[j], v[j], load[j], torque[j], 0.0) for j in (0, 1)]
        impulse = [0.0, 0.0]
        for _ in range(4):  # projected Gauss-Seidel
            for j, inverse in ((0, m11 / det), (1, m00 / det)):
                now = free[j] + inverse * impulse[j] - m01 / det * impulse[1 - j]
                impulse[j] = min(max(impulse[j] - now / inverse, -limit[j]), limit[j])
        new = [
            free[0] + (m11 * impulse[0] - m01 * impulse[1]) / det,
            free[1] + (m00 * impulse[1] - m01 * impulse[0]) / det,
        ]
        for j in (0, 1):
            carried = (
                torque[j] + impulse[j] / step_s - laws[j].smooth(q[j], v[j]) - arm.rotors[j] * (new[j] - v[j]) / step_s
            )
            load[j] += 0.2 * (carried - load[j])
        v = new
        q = [q[0] + step_s * v[0], q[1] + step_s * v[1]]
        out[k] = *q, *v, *torque
    return Track(step_s * np.arange(1, count + 1), out[:, :2], out[:, 2:4], out[:, 4:], out[:, 4:])
