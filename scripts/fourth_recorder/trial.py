"""Trials of a session as they happen, before anything is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .effects.draw import Drawn
from .hand import Finger
from .hidden import LinkageFaults, LogFaults, MarkerFaults, Touch
from .motor import NOISE, Motor, Trace, simulate
from .moves import Planned, plan_trials, schedule
from .session import Session


@dataclass(frozen=True)
class Trial:
    """starts: of the moves [s]; duration_s: until the recording ends; motor: with all that is hidden in it."""

    planned: Planned
    finger: Finger
    starts: tuple[float, ...]
    duration_s: float
    motor: Motor
    trace: Trace
    linkage: LinkageFaults
    log: LogFaults
    markers: MarkerFaults

    @property
    def name(self) -> str:
        """Of its files."""
        return f"{self.planned.kind}_{self.finger.name}{self.planned.suffix}"


def during_trial(log: LogFaults, number: int, duration_s: float) -> tuple[dict[str, float], Touch | None]:
    """Changes of the motor in one trial, and the obstacle there."""
    changes: dict[str, float] = {}
    touch = None
    if log.contact and log.contact.trials[number]:
        contact = log.contact
        begin, end = (share * duration_s for share in contact.span)
        changes |= {"obstacle": contact.place, "obstacle_stiffness": contact.stiffness}
        changes |= {"obstacle_from_s": begin, "obstacle_to_s": end}
        touch = Touch(contact.place, contact.give, begin, end)
    if log.retuned:
        changes |= {"retuned_s": log.retuned[0] * duration_s, "retuned_gain": log.retuned[1]}
    if log.preload_jump:
        changes |= {"preload_jump_s": log.preload_jump[0] * duration_s, "preload_jump": log.preload_jump[1]}
    return changes, touch


def run_finger(session: Session, finger: Finger, effects: Sequence[Drawn]) -> list[Trial]:
    """All trials of one finger with effects hidden in it. Raises motor.RunawayError."""
    laboratory = session.laboratory
    motor_changes: dict[str, Any] = {
        "position_gain": laboratory.position_gain,
        "speed_gain": laboratory.speed_gain,
        "top_speed": laboratory.top_speed,
        "acceleration": laboratory.acceleration,
    }
    linkage_changes: dict[str, Any] = {}
    log_changes: dict[str, Any] = {}
    marker_changes: dict[str, Any] = {}
    for drawn in effects:
        motor_changes |= drawn.motor
        linkage_changes |= drawn.linkage
        log_changes |= drawn.log
        marker_changes |= drawn.markers
    log, markers = LogFaults(**log_changes), MarkerFaults(**marker_changes)
    trials = []
    for number, planned in enumerate(plan_trials(laboratory)):
        starts, duration_s = schedule(laboratory, planned.moves)
        changes, touch = during_trial(log, number, duration_s)
        motor = replace(finger.motor, **motor_changes, **changes, begun_s=planned.begun_s)
        noise = np.random.default_rng([session.seed, number, len(finger.name)]).normal(size=NOISE)
        trace = simulate(motor, planned.moves, starts, duration_s + 0.6, noise)
        linkage = LinkageFaults(**linkage_changes, touch=touch)
        trials.append(Trial(planned, finger, starts, duration_s, motor, trace, linkage, log, markers))
    return trials


def run_session(session: Session, effects: Mapping[str, Sequence[Drawn]]) -> dict[str, list[Trial]]:
    """All trials by finger; effects: by finger."""
    return {name: run_finger(session, finger, effects.get(name, ())) for name, finger in session.hand.fingers.items()}
