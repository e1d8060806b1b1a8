"""Sets of sessions: which effect hides where, and the answers, kept apart."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .controllers import NAMES
from .effects import EFFECTS, OUTSIDE
from .effects.draw import CLEAR, TRACE, WEAK
from .hand import SEGMENTS, Finger, Session, draw_session
from .motor import library
from .moves import draw_protocol
from .record import record
from .trial import Trial, set_clipping_levels

KINDS = ("single", "none", "pair", "weak", "messy", "outside")
HANDS = ["bebionic", "hand_a", "lab_hand", "unit7"]
UNSCALABLE = ("command_as_measurement", "asymmetric_friction")  # not made weak nor paired
# Effects of a real hand, of which a messy session has a trace each.
PHYSICAL = [name for name, effect in EFFECTS.items() if effect.family in ("friction", "load", "kinematic")]
PHYSICAL += ["encoder_periodic_error", "drive_sag"]
# Families whose effects are hard to tell apart where they act together.
ALIKE = ({"friction", "load"}, {"electric", "recording"})


@dataclass
class Case:
    """One session to be made."""

    kind: str
    effects: list[str] = field(default_factory=list)


def plan_cases(rng: np.random.Generator, counts: dict[str, int]) -> list[Case]:
    """The sessions of a set, in their order."""
    names = list(EFFECTS)
    scalable = [name for name in names if name not in UNSCALABLE]
    singles = [names[i] for i in rng.permutation(len(names))]
    while len(singles) < counts["single"]:
        singles += [names[i] for i in rng.permutation(len(names))]
    cases = [Case("single", [name]) for name in singles[: counts["single"]]]
    cases += [Case("none") for _ in range(counts["none"])]
    cases += [Case("pair", draw_pair(rng, scalable)) for _ in range(counts["pair"])]
    hideable = [name for name in PHYSICAL if name != "asymmetric_friction"]
    for kind, pool in (("weak", scalable), ("messy", hideable), ("outside", list(OUTSIDE))):
        drawn = rng.choice(pool, counts[kind], replace=counts[kind] > len(pool))
        cases += [Case(kind, [str(name)]) for name in drawn]
    return [cases[i] for i in rng.permutation(len(cases))]


def draw_pair(rng: np.random.Generator, names: list[str]) -> list[str]:
    """Two effects of families that are not alike."""
    while True:
        pair = [str(name) for name in rng.choice(names, 2, replace=False)]
        families = {EFFECTS[name].family for name in pair}
        if len(families) == 2 and families not in ALIKE:
            return pair


def hide(session: Session, name: str, finger: Finger, strength: float, rng: np.random.Generator) -> dict[str, Any]:
    """Put one effect into a session; returns its entry of the answer."""
    effect = EFFECTS.get(name) or OUTSIDE[name]
    drawn = effect.draw(session, finger, strength, rng)
    driven = effect.family not in ("marker", "recording") and not effect.everywhere
    return {
        "effect": name,
        "finger": None if effect.everywhere else finger.name,
        "joint": effect.joint if drawn.joint is None else SEGMENTS[drawn.joint],
        "actuator": finger.actuator if driven else None,
        "marker": drawn.marker,
        "strength": strength,
        "figures": plain(drawn.figures),
    }


def make_case(case: Case, folder: Path, seed: list[int]) -> dict[str, Any]:
    """Record one session and return its answer."""
    rng = np.random.default_rng(seed)
    weak = case.kind == "weak"
    session = draw_session(rng, noise_factor=1.5 if weak else 1.0, short=weak)
    fingers = list(session.fingers.values())
    finger = fingers[int(rng.integers(len(fingers)))]
    traces = []
    if case.kind == "messy":
        for name in PHYSICAL:
            if name not in case.effects:
                traces.append(hide(session, name, fingers[int(rng.integers(len(fingers)))], TRACE, rng))
    entries = []
    for i, name in enumerate(case.effects):
        if i and rng.uniform() < 0.5:
            finger = fingers[int(rng.integers(len(fingers)))]
        entries.append(hide(session, name, finger, WEAK if weak else CLEAR, rng))
    session.name = str(rng.choice(HANDS))
    protocol = draw_protocol(rng, session)
    set_clipping_levels(session, protocol)
    protocol.gaps_s = rng.uniform(4, 20, len(protocol.trials))
    trials = record(rng, session, protocol, folder)
    settings = describe(session, trials, traces)
    return {"case": folder.name, "kind": case.kind, "effects": entries, "settings": settings}


def describe(session: Session, trials: list[Trial], traces: list[dict[str, Any]]) -> dict[str, Any]:
    """What was set in a session, for the answer."""
    return {
        "units": "position % of range, speed %/s, current raw, angles rad, lengths mm, landmark frame",
        "controller": NAMES[session.laboratory.controller],
        "minor_effects": traces,
        "trials": [
            {
                "kind": trial.planned.kind,
                "finger": trial.finger.name,
                "start_s": plain(trial.start_s),
                "length_s": plain(trial.duration_s),
                "contact": plain(trial.touched),
                "push": plain(trial.pushes),
            }
            for trial in trials
        ],
        "session": plain(asdict(session)),
    }


def plain(value: Any) -> Any:
    """The same of Python's own types, for JSON; what never happens (infinity) is null."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def make_set(out: Path, seed: int, counts: dict[str, int]) -> None:
    """Record a set into `out`/case_xxx and its answers into `out`.answers/answers.json; counts: sessions of each kind,
    single, none, pair, weak, messy and outside. Raises CompilerError where there is no C compiler."""
    library()  # before anything is written
    answers_folder = out.with_name(out.name + ".answers")
    out.mkdir(parents=True, exist_ok=True)
    answers_folder.mkdir(parents=True)
    answers: list[dict[str, Any]] = []
    for i, case in enumerate(plan_cases(np.random.default_rng([seed, 777]), counts)):
        folder = out / f"case_{i:03d}"
        began = time.perf_counter()
        answers.append(make_case(case, folder, [seed, i, 31]))
        label = ", ".join(case.effects) or "none"
        print(f"{folder.name} {case.kind}: {label} ({time.perf_counter() - began:.1f} s)", flush=True)
    (answers_folder / "answers.json").write_text(json.dumps(answers, indent=1) + "\n")
