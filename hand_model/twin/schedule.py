"""Which trials a session holds, in which order, and when each one starts on the session's own time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import HandModelError
from .program import Program, excitation, flexion, grasp
from .truth import HandTruth

SPEEDS = ("full", "fast", "half", "medium", "low", "slow")


@dataclass(frozen=True)
class Plan:
    """What to record. flexion, validation: speeds of their cycles. excitations: programmed trials per finger, the
    last validates.

    grasps: object name -> contact stiffness [raw/%]. surfaces: segments to sweep; "all" for every one. pivot: a probe
    calibration, the manifest's probe then has no known tip. mocap_excitation: markers are recorded there as well.
    still_s: length of landmark and joint trials.
    """

    flexion: tuple[str, ...] = ("full", "medium", "slow", "fast", "full", "medium", "slow")
    validation: tuple[str, ...] = ("full", "medium", "slow", "fast", "low")
    excitations: int = 3
    middle_percent: float = 50.0
    grasps: tuple[tuple[str, float], ...] = ()
    grasp_repeats: int = 1
    surfaces: tuple[str, ...] = ()
    pivot: bool = False
    mocap_excitation: bool = False
    joint_sides: tuple[str, ...] = ("medial", "lateral")
    still_s: float = 1.2


@dataclass(frozen=True)
class TrialPlan:
    """One trial of the schedule. name: the stem of its files. start_s: session time [s]. program: None for probe
    trials.
    """

    name: str
    kind: str
    start_s: float
    duration_s: float
    finger: str | None = None
    program: Program | None = None
    landmark: str | None = None
    joint: str | None = None
    side: str | None = None
    segment: str | None = None
    object: str | None = None
    stiffness: float | None = None
    mocap: bool = True
    validate: bool = False


def schedule(truth: HandTruth, plan: Plan) -> tuple[TrialPlan, ...]:
    """All trials of a session in the order of recording."""
    if not set(plan.flexion + plan.validation) <= set(SPEEDS):
        raise HandModelError(f"a cycle's speed is one of {', '.join(SPEEDS)}")
    trials: list[TrialPlan] = []
    clock = [5.0]

    def add(name: str, kind: str, duration_s: float, **keys: object) -> None:
        trials.append(TrialPlan(name, kind, clock[0], duration_s, **keys))  # type: ignore[arg-type]
        clock[0] += duration_s + 20.0

    if plan.pivot:
        add("pivot", "pivot", 8.0)
    for landmark in ("origin", "medial", "lateral"):
        add(f"landmark_{landmark}", "landmark", plan.still_s, landmark=landmark)
    for finger in truth.fingers:
        for joint in finger.joints:
            for side in plan.joint_sides:
                name = f"joint_{finger.name}_{joint.name}_{side}"
                add(name, "joint_probe", plan.still_s, finger=finger.name, joint=joint.name, side=side)
    for surface in truth.surfaces:
        if "all" in plan.surfaces or surface.segment in plan.surfaces:
            add(f"surface_{surface.segment.replace('/', '_')}", "surface", 30.0, segment=surface.segment)
    for finger in truth.fingers:
        _add_motions(add, truth, finger.name, plan)
    return tuple(trials)


def _add_motions(add: object, truth: HandTruth, finger: str, plan: Plan) -> None:
    controller = truth.motors[truth.finger(finger).actuator].controller
    for name, cycles, validate in (
        (f"flexion_{finger}", plan.flexion, False),
        (f"flexion_{finger}_b", plan.validation, True),
    ):
        if cycles:
            program = flexion(controller, cycles)
            add(name, "flexion", program.duration_s, finger=finger, program=program, validate=validate)
    for i in range(plan.excitations):
        program = excitation(controller, plan.middle_percent)
        last = i == plan.excitations - 1 and plan.excitations > 1
        add(
            f"excitation_{finger}_{i + 1}",
            "excitation",
            program.duration_s,
            finger=finger,
            program=program,
            validate=last,
            mocap=plan.mocap_excitation,
        )
    for name, stiffness in plan.grasps:
        for i in range(plan.grasp_repeats):
            program = grasp(controller, ("half", "full", "low")[i % 3])
            add(
                f"grasp_{finger}_{name}_{i + 1}",
                "grasp",
                program.duration_s,
                finger=finger,
                program=program,
                object=name,
                stiffness=stiffness,
                mocap=False,
            )


def motion_trials(trials: Sequence[TrialPlan], finger: str) -> tuple[TrialPlan, ...]:
    """The trials in which a finger moves."""
    return tuple(t for t in trials if t.finger == finger and t.program is not None)


def shortened(plan: Plan, rng: np.random.Generator) -> Plan:
    """A shorter session: fewer cycles, still each speed of the first trial at least twice over the session."""
    cycles = tuple(str(s) for s in rng.permutation(["full", "medium", "low"]))
    return Plan(flexion=cycles + cycles[:1], validation=cycles, excitations=2, middle_percent=plan.middle_percent)
