"""Makes sets of sealed sessions and, beside them, their answers.

from seventh_recorder.compose import make_set
make_set(Path("set"), seed=1, counts={"single": 35, "none": 6, "pair": 4})
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .catalogue import OUTSIDE, VOCABULARY
from .effect import Effect
from .hand import FULL_ANGLES, draw_hand
from .mocap import Room
from .plan import NOISE, Plan
from .session import record
from .stepper import CompilerError

__all__ = ["KINDS", "CompilerError", "make_set"]

KINDS = ("single", "none", "pair", "weak", "messy", "outside")
JOINABLE = tuple(effect for effect in VOCABULARY if effect.joinable)
FIRST_SHARE = 0.65  # of the hidden effects sit in the index finger (all six measured ones do)


@dataclass(frozen=True)
class Case:
    """One session to be made: its kind, and the effects with their strengths, main one first."""

    kind: str
    effects: tuple[tuple[Effect, float], ...]


def _rounds(effects: tuple[Effect, ...], rng: np.random.Generator) -> Iterator[Effect]:
    """The effects for ever, each round in a fresh order."""
    while True:
        for i in rng.permutation(len(effects)):
            yield effects[i]


def _cases(counts: dict[str, int], rng: np.random.Generator) -> list[Case]:
    """What the set holds, in shuffled order."""
    unknown = set(counts) - set(KINDS)
    if unknown:
        raise ValueError(f"unknown kinds {sorted(unknown)}; known: {', '.join(KINDS)}")
    cases: list[Case] = []
    singles, weak, messy = _rounds(VOCABULARY, rng), _rounds(VOCABULARY, rng), _rounds(JOINABLE, rng)
    pairs, others = _rounds(JOINABLE, rng), _rounds(OUTSIDE, rng)
    for kind in KINDS:
        for _ in range(counts.get(kind, 0)):
            if kind == "none":
                chosen: tuple[tuple[Effect, float], ...] = ()
            elif kind == "pair":
                first = next(pairs)
                second = next(e for e in pairs if e is not first)
                chosen = ((first, 1.0), (second, 1.0))
            elif kind == "messy":
                main = next(messy)
                chosen = ((main, 1.0), *((e, 0.1) for e in JOINABLE if e is not main))
            else:
                source = {"single": singles, "weak": weak, "outside": others}[kind]
                chosen = ((next(source), 0.4 if kind == "weak" else 1.0),)
            cases.append(Case(kind, chosen))
    return [cases[i] for i in rng.permutation(len(cases))]


def _noise(kind: str, rng: np.random.Generator) -> dict[str, float]:
    """Noise of counts, raw current and markers (mm), spread round what was measured."""
    more = 1.5 if kind == "weak" else 1.0
    return {name: more * value * float(np.exp(rng.uniform(-0.15, 0.2))) for name, value in NOISE.items()}


def _make(folder: Path, case: Case, rng: np.random.Generator) -> dict[str, object]:
    """Record one case; its answer."""
    other = str(rng.choice([name for name in FULL_ANGLES if name != "index"]))
    names = ["index", other] if rng.random() < 0.5 else [other, "index"]
    hand, noise = draw_hand(names, rng), _noise(case.kind, rng)
    room = Room(noise["marker_mm"], rng)
    target = "index" if rng.random() < FIRST_SHARE else other
    plans = [Plan(finger, noise, room.up_palm) for finger in hand.fingers]
    hidden = plans[names.index(target)]
    by_turn = [*reversed(case.effects)]
    by_turn.sort(key=lambda chosen: chosen[0].name == "current_saturation")  # last: what it may cut is known then
    put = {effect.name: effect.put(hidden, strength, rng) for effect, strength in by_turn}
    record(folder, hand, plans, room, case.kind == "weak", rng)
    effects = [
        {
            "effect": effect.name,
            "finger": target,
            "joint": put[effect.name].get("joint", effect.joint),
            "signal": effect.signal,
            "strength": strength,
        }
        for effect, strength in case.effects
    ]
    settings = {effect.name: put[effect.name] for effect, _ in case.effects}
    return {"case": folder.name, "kind": case.kind, "effects": effects, "settings": settings, "noise": noise}


def make_set(out: Path, seed: int, counts: dict[str, int]) -> None:
    """Write sessions ``out/case_000`` ... and ``<out>.answers/answers.json``; the same seed gives the same set."""
    out = Path(out)
    cases = _cases(counts, np.random.default_rng([7, seed]))
    out.mkdir(parents=True)
    answers = [_make(out / f"case_{i:03d}", case, np.random.default_rng([7, seed, i])) for i, case in enumerate(cases)]
    beside = out.with_name(out.name + ".answers")
    beside.mkdir()
    (beside / "answers.json").write_text(json.dumps(answers, indent=1))
