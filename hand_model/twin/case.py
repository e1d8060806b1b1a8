"""Blind-trial cases: a hand, a plan and what is hidden, all drawn from one seed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import HandModelError, did_you_mean
from .bebionic import bebionic
from .influence import CATALOGUE, Hidden
from .record import Answer, record
from .schedule import Plan, shortened
from .streams import stream
from .truth import HandTruth

KINDS = ("single", "none", "pair", "messy", "outside", "weak")
BACKGROUND = 0.1  # strength of every other effect in a messy case
WEAK = 0.4
# A refused channel hides whatever else is recorded, and an asymmetric Coulomb friction is a preload by definition.
ALONE = ("command_as_measurement", "asymmetric_friction")

# Effects that imitate each other closely enough that a pair of them would be a riddle rather than a test.
FAMILIES = (
    ("stribeck_friction", "quadratic_damping", "asymmetric_viscous_friction"),
    ("elastoplastic_hysteresis", "presliding_friction", "viscoelastic_spring"),
    ("detent_load", "nonlinear_spring", "end_stop_contact", "external_contact"),
    ("drive_backlash", "series_elasticity", "clock_drift", "spring_decoupling"),
    ("linkage_backlash", "linkage_compliance"),
    ("coupling_deadband", "distal_stop"),
    ("joint_wobble", "moving_centre"),
    ("marker_slip", "support_slip", "palm_marker_slip", "marker_swap"),
    ("drive_sag", "current_saturation"),
)


@dataclass(frozen=True)
class Case:
    """One case of a blind trial. hidden: what to hide, the main effect first; nothing where it is empty."""

    seed: int
    kind: str
    truth: HandTruth
    plan: Plan
    hidden: tuple[Hidden, ...]

    def record(self, folder: str | Path) -> Answer:
        """Write the session; the answer is returned, with the kind of case in its table."""
        answer = record(self.truth, folder, self.seed, self.hidden, self.plan)
        return replace(answer, table={"case": self.kind, **answer.table})


def vocabulary() -> tuple[str, ...]:
    """Names of the effects inside the project's vocabulary that the twin can hide."""
    return tuple(name for name, declared in CATALOGUE.items() if declared.station != "outside")


def outside() -> tuple[str, ...]:
    """Names of the effects that the vocabulary does not hold."""
    return tuple(name for name, declared in CATALOGUE.items() if declared.station == "outside")


def draw_case(seed: int, kind: str = "single", effect: str | None = None, strength: float | None = None) -> Case:
    """Draw a case: side, two fingers, geometry, noise, sampling, programs and what is hidden.

    kind: "single", "none", "pair" (two effects of different families), "messy" (one at full strength, every other at a
    tenth), "outside" (not in the vocabulary), "weak" (noisier, shorter, 40 % of the strength). effect: the main effect
    instead of a drawn one; strength: instead of one drawn between 1 and 1.6. Raises HandModelError for unknown names.
    """
    if kind not in KINDS:
        raise HandModelError(f'no case of kind "{kind}"; {did_you_mean(kind, KINDS)}')
    if effect is not None and effect not in CATALOGUE:
        raise HandModelError(f'the twin has no effect "{effect}"; {did_you_mean(effect, CATALOGUE)}')
    rng = stream(seed, "case", kind)
    truth, plan = _laboratory(rng, seed, kind)
    if kind == "none":
        return Case(seed, kind, truth, plan, ())
    names = _draw_names(rng, kind, effect)
    size = strength if strength is not None else float(rng.uniform(1.0, 1.6)) * (WEAK if kind == "weak" else 1.0)
    affected = truth.fingers[0].name
    hidden = [Hidden(names[0], affected, size)]
    hidden += [Hidden(name, affected, BACKGROUND if kind == "messy" else size) for name in names[1:]]
    return Case(seed, kind, truth, plan, tuple(hidden))


def _laboratory(rng: np.random.Generator, seed: int, kind: str) -> tuple[HandTruth, Plan]:
    side = str(rng.choice(["left", "right"]))
    actuators = rng.choice(
        ["thumb", "index", "middle", "ring", "little"], 2, replace=False, p=[0.12, 0.22, 0.22, 0.22, 0.22]
    )
    fingers = [str(rng.choice(["thumb_0", "thumb_1"])) if a == "thumb" else str(a) for a in actuators]
    truth = bebionic(side, seed, fingers)
    plan = Plan(middle_percent=float(round(rng.uniform(40, 60))))
    if kind == "weak":
        louder = replace(truth.log, current_raw=1.4 * truth.log.current_raw)
        truth = replace(truth, log=louder, mocap=replace(truth.mocap, noise_m=min(4e-4, 1.4 * truth.mocap.noise_m)))
        return truth, shortened(plan, rng)
    cycles = [str(s) for s in rng.permutation(["full", "fast", "medium", "low", "slow"])]
    return truth, replace(plan, flexion=(*cycles[:4], *cycles[:3]), validation=(*cycles[1:4], cycles[4]))


def _draw_names(rng: np.random.Generator, kind: str, effect: str | None) -> list[str]:
    inside = list(vocabulary())
    if kind == "outside":
        return [effect or str(rng.choice(outside()))]
    mixed = [name for name in inside if name not in ALONE]
    main = effect or str(rng.choice(mixed if kind in ("pair", "messy") else inside))
    if kind == "messy":
        return [main, *(name for name in mixed if name != main)]
    if kind == "pair":
        like = next((family for family in FAMILIES if main in family), (main,))
        return [main, str(rng.choice([name for name in mixed if name not in like]))]
    return [main]
