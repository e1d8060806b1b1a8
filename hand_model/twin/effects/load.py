"""Loads on the drive that friction does not explain: springs, stops, detents, weight, ripple, memory of the path."""

from __future__ import annotations

import math

import numpy as np

from ..geometry import unit
from ..influence import Draw, Influence, effect
from ..motor import DriveNow, DriveTerms
from ..schedule import TrialPlan
from .shapes import BUMPS, WAVES, bump, wave


@effect("detent_load", "drive", "current", (*BUMPS, "notch"))
def detent(draw: Draw) -> Influence:
    """A load tied to one part of the range, the same in both directions; a notch pulls in, then holds back."""
    height = draw.raw("height_raw", 0.22, 0.32) * draw.sign()
    centre, width = draw.uniform("centre_percent", 22.0, 78.0), draw.uniform("width_percent", 5.0, 9.0)
    if draw.form == "notch":
        shape = bump("gaussian", centre, width)
        return Influence(
            terms=DriveTerms(load=(lambda now: height * (now.position - centre) / width * shape(now.position),))
        )
    shape = bump(draw.form, centre, width)
    return Influence(terms=DriveTerms(load=(lambda now: height * shape(now.position),)))


@effect("nonlinear_spring", "drive", "current", ("square", "cube", "knee", "softening"))
def nonlinear_spring(draw: Draw) -> Influence:
    """The return spring stiffens towards the end of the range, from a knee on, or softens."""
    at_full = draw.raw("extra_at_100_raw", 0.8, 1.2)
    if draw.form == "softening":
        at_full = draw.note("extra_at_100_raw", -0.8 * at_full)
    knee = draw.uniform("knee_percent", 45.0, 60.0)

    def extra(now: DriveNow) -> float:
        u = max(0.0, now.position) / 100.0
        if draw.form == "knee":
            return 0.55 * at_full * max(0.0, now.position - knee) / (100.0 - knee)
        return at_full * (0.7 * u**3 if draw.form == "cube" else u * u)

    return Influence(terms=DriveTerms(load=(extra,)))


@effect("gravity_load", "drive", "current", ("finger", "support"))
def gravity(draw: Draw) -> Influence:
    """The weight of the finger, or of a marker support on it, while the palm turns in the world."""
    weight = draw.raw("weight_raw", 0.17, 0.28)
    first, second = draw.finger.joints
    axis = first.axis_palm
    arm = second.centre_palm - first.centre_palm
    if draw.form == "support":
        arm = np.mean(list(second.markers_palm.values()), axis=0) - first.centre_palm
    arm = unit(arm - axis * (axis @ arm))
    side = np.cross(axis, arm)
    full = float(draw.finger.proximal_rad.sum())
    # torque about the axis of a unit force g at r(q): a . (r x g) with r = arm cos q + side sin q
    by_cos, by_sin = np.cross(axis, arm).tolist(), np.cross(axis, side).tolist()

    def load(now: DriveNow) -> float:
        angle = full * now.position / 100.0
        c, s, g = math.cos(angle), math.sin(angle), now.gravity_palm
        return -weight * sum((c * a + s * b) * x for a, b, x in zip(by_cos, by_sin, g, strict=True))

    return Influence(terms=DriveTerms(load=(load,)), turns_palm=True)


@effect("torque_ripple", "drive", "current", WAVES)
def ripple(draw: Draw) -> Influence:
    """A load periodic in motor position."""
    height = draw.raw("amplitude_raw", 0.09, 0.13)
    per_percent = 2 * math.pi / draw.uniform("period_percent", 5.0, 14.0)
    shape = wave(draw.form, draw.uniform("phase_rad", 0.0, 2 * math.pi))
    return Influence(terms=DriveTerms(load=(lambda now: height * shape(per_percent * now.position),)))


@effect("elastoplastic_hysteresis", "drive", "current", ("exponential", "linear", "two_scales"))
def hysteresis(draw: Draw) -> Influence:
    """A load that builds up over a distance after each reversal and then stays."""
    level = draw.raw("level_raw", 0.26, 0.4)
    distance = draw.uniform("distance_percent", 7.0, 16.0)
    state = [0.0, 0.0]  # each in -1..1

    def start(trial: TrialPlan) -> None:
        state[:] = [0.0, 0.0]

    def advance(now: DriveNow, step_s: float) -> None:
        moved = now.velocity * step_s / distance
        if draw.form == "linear":
            state[0] = max(-1.0, min(1.0, state[0] + 2.0 * moved))
        else:
            state[0] += abs(moved) * (math.copysign(1.0, moved) - state[0])
        state[1] += 0.35 * abs(moved) * (math.copysign(1.0, moved) - state[1])

    if draw.form == "two_scales":
        return Influence(
            start=start,
            terms=DriveTerms(load=(lambda now: level * (0.5 * state[0] + 0.5 * state[1]),), advance=(advance,)),
        )
    return Influence(start=start, terms=DriveTerms(load=(lambda now: level * state[0],), advance=(advance,)))


@effect("viscoelastic_spring", "drive", "current", ("maxwell", "two_times"))
def viscoelastic(draw: Draw) -> Influence:
    """Part of the spring relaxes with time (a Maxwell branch, or two of them)."""
    stiffness = draw.size("branch_stiffness", 0.8, 1.1) * draw.motor.stiffness
    draw.note("branch_stiffness", stiffness)
    relax = draw.uniform("relaxation_s", 0.8, 2.5)
    stretch = [0.0, 0.0]

    def start(trial: TrialPlan) -> None:
        stretch[:] = [0.0, 0.0]

    def advance(now: DriveNow, step_s: float) -> None:
        stretch[0] += step_s * (now.velocity - stretch[0] / relax)
        stretch[1] += step_s * (now.velocity - stretch[1] / (5.0 * relax))

    second = 0.3 if draw.form == "two_times" else 0.0
    return Influence(
        start=start,
        terms=DriveTerms(
            load=(lambda now: stiffness * ((1 - second) * stretch[0] + second * stretch[1]),), advance=(advance,)
        ),
    )


@effect("end_stop_contact", "drive", "current", ("linear", "progressive", "open_side"))
def end_stop(draw: Draw) -> Influence:
    """An elastic stop inside the range, at its closed or its open end; always there."""
    stiffness = draw.raw("stiffness_raw", 0.03, 0.045)
    if draw.form == "open_side":
        at = draw.uniform("at_percent", 6.0, 10.0)
        return Influence(terms=DriveTerms(load=(lambda now: 1.8 * stiffness * min(0.0, now.position - at),)))
    at = draw.uniform("at_percent", 84.0, 91.0)

    def load(now: DriveNow) -> float:
        depth = max(0.0, now.position - at)
        return stiffness * depth * (0.4 + depth / 16.0 if draw.form == "progressive" else 1.0)

    return Influence(terms=DriveTerms(load=(load,)))


@effect("external_contact", "drive", "current", ("stiff", "foam"))
def external_contact(draw: Draw) -> Influence:
    """An obstacle in the finger's way from some moment of the first flexion to the end of the second one."""
    begin = draw.moment(0.3, 0.55)
    flexions = [t for t in draw.schedule if t.kind == "flexion" and t.finger == draw.finger.name]
    end = flexions[-1].start_s + flexions[-1].duration_s
    draw.where["trials"] = [t.name for t in flexions]
    at = draw.uniform("at_percent", 45.0, 70.0)
    stiffness = draw.raw("stiffness_raw", 0.007, 0.012)

    def load(now: DriveNow) -> float:
        depth = now.position - at
        if depth <= 0 or not begin <= now.session_s <= end:
            return 0.0
        return stiffness * depth if draw.form == "stiff" else stiffness * depth * depth / 30.0

    return Influence(terms=DriveTerms(load=(load,)))
