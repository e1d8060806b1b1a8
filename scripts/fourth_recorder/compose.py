"""Sets of sessions: which effect hides where, and the answers, kept apart."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .effects import EFFECTS, OUTSIDE, Drawn, Form, Site
from .effects.draw import CLEAR, TRACE, WEAK
from .hand import SEGMENTS, Finger
from .motor import library
from .record import record
from .session import Session, draw_session
from .size import CLEAR_GAIN, clear_size
from .trial import run_session

# In the order in which they are planned, with the number that stands for each in seeds.
KINDS = {"single": 1, "none": 2, "outside": 3, "pair": 4, "weak": 5, "messy": 6}
UNSCALABLE = ("command_as_measurement", "asymmetric_friction")  # not made weak, paired nor hidden among traces


@dataclass(frozen=True)
class Case:
    """One session to be made; a messy one has a trace of every other effect too."""

    kind: str
    effects: tuple[str, ...]
    seed: int


def case_seed(seed: int, kind: str, number: int) -> int:
    """Of the session of a kind and number in the set of a seed."""
    return int(np.random.SeedSequence([seed, KINDS[kind], number]).generate_state(1)[0] % 2**31)


def plan_cases(seed: int, counts: dict[str, int]) -> list[Case]:
    """The sessions of a set, in their order."""
    rng = np.random.default_rng([seed, 999])
    singles = list(EFFECTS)
    rng.shuffle(singles)
    scalable = [name for name in EFFECTS if name not in UNSCALABLE]
    pools = {kind: [str(name) for name in rng.permutation(scalable)] for kind in ("pair", "weak", "messy")}
    pools |= {"single": singles, "outside": list(OUTSIDE)}
    cases = []
    for kind in KINDS:
        pool, each = pools.get(kind, []), {"none": 0, "pair": 2}.get(kind, 1)
        for i in range(counts[kind]):
            names = tuple(pool[(each * i + k) % len(pool)] for k in range(each))
            cases.append(Case(kind, names, case_seed(seed, kind, i)))
    return [cases[i] for i in rng.permutation(len(cases))]


def place_effects(rng: np.random.Generator, case: Case, session: Session) -> list[tuple[str, Finger]]:
    """Effects of a case and the fingers they hide in, mostly the index."""
    fingers = session.hand.fingers
    (other_name,) = (name for name in fingers if name != "index")
    main, other = fingers["index"], fingers[other_name]
    if rng.random() >= 0.75:
        main, other = other, main
    placed = [(name, main) for name in case.effects]
    if case.kind == "pair" and rng.random() >= 0.55:
        placed[1] = (case.effects[1], other)
    return placed


def entry(name: str, finger: Finger, drawn: Drawn, strength: float, size: float) -> dict[str, Any]:
    """An effect's in the answer."""
    effect = EFFECTS.get(name) or OUTSIDE[name]
    return {
        "effect": name,
        "finger": finger.name,
        "joint": effect.joint if drawn.joint is None else SEGMENTS[drawn.joint],
        "actuator": finger.name if effect.driven else None,
        "marker": drawn.marker,
        "strength": strength,
        "size": size,
        "figures": plain(drawn.figures),
    }


def draw_sized(
    rng: np.random.Generator, kind: str, session: Session, name: str, finger: Finger
) -> tuple[Drawn, float, float]:
    """An effect that a session of a kind hides in a finger, its strength, and its size; of the table's as large as it
    takes to show."""
    form, strength = Form(rng), WEAK if kind == "weak" else CLEAR
    size = strength
    if name in EFFECTS:
        size = clear_size(session, finger, name, form, CLEAR_GAIN * (3.0 if kind == "weak" else 1.0)) * strength
    return (EFFECTS.get(name) or OUTSIDE[name]).draw(Site(session, finger, size, form)), strength, size


def make_case(case: Case, folder: Path) -> dict[str, Any]:
    """Record one session and return its answer."""
    rng = np.random.default_rng(case.seed)
    session = draw_session(rng, case.kind, case.seed)
    hidden: dict[str, list[Drawn]] = {name: [] for name in session.hand.fingers}
    entries, traces = [], []
    placed = place_effects(rng, case, session)
    for name, finger in placed:
        drawn, strength, size = draw_sized(rng, case.kind, session, name, finger)
        hidden[finger.name].append(drawn)
        entries.append(entry(name, finger, drawn, strength, size))
    if case.kind == "messy":
        main, finger = placed[0]
        for name in (each for each in EFFECTS if each not in (main, "command_as_measurement")):
            drawn = EFFECTS[name].draw(Site(session, finger, TRACE, Form(rng)))
            hidden[finger.name].append(drawn)
            traces.append(entry(name, finger, drawn, TRACE, TRACE))
    record(session, run_session(session, hidden), folder)
    settings = describe(session, traces)
    return {"case": folder.name, "kind": case.kind, "effects": entries, "settings": settings}


def describe(session: Session, traces: list[dict[str, Any]]) -> dict[str, Any]:
    """What was set in a session, for the answer."""
    return {
        "units": "position % of range, speed %/s, current raw, angles rad, lengths mm, landmark frame",
        "minor_effects": traces,
        "session": plain(asdict(session)),
    }


def plain(value: Any) -> Any:
    """The same of Python's own types, for JSON."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value


def make_set(out: Path, seed: int, counts: dict[str, int]) -> None:
    """Record a set into `out`/case_xxx and its answers into `out`.answers/answers.json; counts: sessions of each kind
    of KINDS. Raises CompilerError where there is no C compiler."""
    library()  # before anything is written
    answers_folder = out.with_name(out.name + ".answers")
    out.mkdir(parents=True, exist_ok=True)
    answers_folder.mkdir(parents=True)
    answers: list[dict[str, Any]] = []
    for i, case in enumerate(plan_cases(seed, counts)):
        folder = out / f"case_{i:03d}"
        began = time.perf_counter()
        answers.append(make_case(case, folder))
        label = ", ".join(case.effects) or "none"
        print(f"{folder.name} {case.kind}: {label} ({time.perf_counter() - began:.1f} s)", flush=True)
    (answers_folder / "answers.json").write_text(json.dumps(answers, indent=1) + "\n")
