"""What an effect does to a recording: hooks at the stations of the signal path, and how effects are declared.

An effect is a function decorated with `effect(...)`; it draws its parameters once per session and returns an Influence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import HandModelError, did_you_mean
from .motor import DriveTerms, Motion
from .schedule import TrialPlan
from .streams import stream
from .truth import FingerTruth, HandTruth, MotorTruth

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Influence:
    """Hooks, all optional; each changes one station and leaves what lies upstream of it alone.

    start: called before each trial of the finger. terms: in the drive's balance. drive: (motion, percent) -> percent
    that reaches the proximal segment. proximal: (motion, angle) -> angle. linkage: (motion, angle) -> proximal angle
    that reaches the linkage. distal: (motion, angle) -> angle. Angles (n,) [rad]. pose: (joint index, angle) ->
    quaternions (n, 4) and shifts (n, 3) [m], applied after the hinge in the parent's frame. encoder: (motion,
    percent) -> percent as read. current: (motion, raw) -> raw as measured. log: edits the columns. clock_rate: factor
    on the log's clock. segment: (trial, time_s, segment, markers (n, k, 3)) -> the same, in the segment's frame, hand
    open [m]. palm: (trial, time_s, markers (n, 3, 3)) -> the same, palm frame. world: (trial, time_s, label -> (n,
    3)) -> the same.
    """

    start: Callable[[TrialPlan], None] | None = None
    terms: DriveTerms | None = None
    drive: Callable[[Motion, Array], Array] | None = None
    proximal: Callable[[Motion, Array], Array] | None = None
    linkage: Callable[[Motion, Array], Array] | None = None
    distal: Callable[[Motion, Array], Array] | None = None
    pose: Callable[[int, Array], tuple[Array, Array]] | None = None
    encoder: Callable[[Motion, Array], Array] | None = None
    current: Callable[[Motion, Array], Array] | None = None
    log: Callable[[TrialPlan, dict[str, Array]], dict[str, Array]] | None = None
    clock_rate: float = 1.0
    segment: Callable[[TrialPlan, Array, str, Array], Array] | None = None
    palm: Callable[[TrialPlan, Array, Array], Array] | None = None
    world: Callable[[TrialPlan, Array, dict[str, Array]], dict[str, Array]] | None = None
    turns_palm: bool = False


@dataclass(frozen=True)
class Hidden:
    """An effect to hide. strength: 1 is the default size. form: one of the effect's physical forms; parameters: fixed
    values.

    What is None or absent is drawn from the session's seed.
    """

    effect: str
    finger: str | None = None
    strength: float = 1.0
    form: str | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass
class Draw:
    """What an effect sees while it is set up, and where its choices are noted for the answer."""

    truth: HandTruth
    finger: FingerTruth
    motor: MotorTruth
    schedule: Sequence[TrialPlan]
    strength: float
    rng: np.random.Generator
    fixed: Mapping[str, float]
    form: str
    parameters: dict[str, float] = field(default_factory=dict)
    where: dict[str, Any] = field(default_factory=dict)

    def uniform(self, name: str, low: float, high: float) -> float:
        """A parameter that does not depend on the strength."""
        value = float(self.rng.uniform(low, high))
        return self.note(name, float(self.fixed.get(name, value)))

    def size(self, name: str, low: float, high: float) -> float:
        """A parameter in proportion to the strength."""
        value = float(self.rng.uniform(low, high)) * self.strength
        return self.note(name, float(self.fixed.get(name, value)))

    def raw(self, name: str, low: float, high: float) -> float:
        """A load [raw] in proportion to the strength, drawn as a share of the motor's Coulomb friction."""
        value = float(self.rng.uniform(low, high)) * self.strength * self.motor.coulomb
        return self.note(name, float(self.fixed.get(name, value)))

    def note(self, name: str, value: float) -> float:
        """Write a parameter into the answer."""
        self.parameters[name] = value
        return value

    def sign(self, name: str = "sign") -> float:
        """Plus or minus one."""
        return self.note(name, float(self.fixed.get(name, self.rng.choice([-1.0, 1.0]))))

    def moment(self, low: float = 0.25, high: float = 0.7) -> float:
        """A moment [s of the session] inside the finger's first flexion, noted with its trial."""
        trial = next((t for t in self.schedule if t.kind == "flexion" and t.finger == self.finger.name), None)
        if trial is None:
            raise HandModelError(f'an effect with a moment needs a flexion trial of finger "{self.finger.name}"')
        share = self.uniform("moment_share", low, high)
        self.where["trials"] = [trial.name]
        return self.note("moment_s", trial.start_s + share * trial.duration_s)


@dataclass(frozen=True)
class Declared:
    """An entry of the twin's catalogue. station: "drive", "transmission", "kinematics", "channel", "recording" or
    "outside".
    """

    name: str
    station: str
    signal: str
    forms: tuple[str, ...]
    joint: str | None
    build: Callable[[Draw], Influence]


CATALOGUE: dict[str, Declared] = {}


def effect(
    name: str, station: str, signal: str, forms: tuple[str, ...] = ("plain",), joint: str | None = None
) -> Callable:
    """Declare an effect of the twin: the decorated function draws parameters and returns its Influence."""

    def enter(build: Callable[[Draw], Influence]) -> Callable[[Draw], Influence]:
        CATALOGUE[name] = Declared(name, station, signal, forms, joint, build)
        return build

    return enter


@dataclass(frozen=True)
class Active:
    """An effect set up for one session: its influence, and what the answer says of it."""

    influence: Influence
    finger: str
    answer: Mapping[str, Any]


def activate(hidden: Hidden, truth: HandTruth, schedule: Sequence[TrialPlan], seed: int) -> Active:
    """Draw an effect's parameters; raises HandModelError for unknown effects, fingers or forms."""
    if hidden.effect not in CATALOGUE:
        raise HandModelError(f'the twin has no effect "{hidden.effect}"; {did_you_mean(hidden.effect, CATALOGUE)}')
    if not (math.isfinite(hidden.strength) and hidden.strength >= 0):
        raise HandModelError(
            f'effect "{hidden.effect}" has strength {hidden.strength}; a number of zero or more is needed'
        )
    declared = CATALOGUE[hidden.effect]
    finger = truth.finger(hidden.finger) if hidden.finger else truth.fingers[0]
    rng = stream(seed, "effect", hidden.effect, finger.name)
    form = hidden.form or str(rng.choice(declared.forms))
    if form not in declared.forms:
        raise HandModelError(f'effect "{hidden.effect}" has no form "{form}"; {did_you_mean(form, declared.forms)}')
    draw = Draw(truth, finger, truth.motors[finger.actuator], schedule, hidden.strength, rng, hidden.parameters, form)
    influence = declared.build(draw)
    answer = {
        "effect": hidden.effect,
        "finger": finger.name,
        "actuator": finger.actuator,
        "joint": declared.joint,
        "signal": declared.signal,
        "station": declared.station,
        "strength": hidden.strength,
        "form": form,
        "parameters": draw.parameters,
        **draw.where,
    }
    return Active(influence, finger.name, answer)


def merge_terms(parts: Sequence[DriveTerms]) -> DriveTerms:
    """All terms of several effects on one drive."""
    return DriveTerms(
        load=sum((p.load for p in parts), ()),
        friction=sum((p.friction for p in parts), ()),
        advance=sum((p.advance for p in parts), ()),
        speed_factor=sum((p.speed_factor for p in parts), ()),
        sense=sum((p.sense for p in parts), ()),
        current_limit=min((p.current_limit for p in parts), default=float("inf")),
        command_delay_s=sum(p.command_delay_s for p in parts),
        replace_coulomb=any(p.replace_coulomb for p in parts),
    )
