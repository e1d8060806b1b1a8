"""Sets of sessions: which effect hides where, and the answers, kept apart."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .effects import EFFECTS, Settings
from .hand import SEGMENTS, Finger, describe, draw_hand
from .laboratory import Laboratory, draw_laboratory
from .outside import OUTSIDE
from .session import Recorder

WEAK, BACKGROUND = 0.4, 0.1


@dataclass
class Case:
    """One session to be made; `second` says whether the second effect sits on the other finger."""

    kind: str
    effects: list[str] = field(default_factory=list)
    apart: bool = False


def merge(into: Settings, more: Settings) -> None:
    """Add settings group by group; what is there already stays."""
    for group, values in more.items():
        mine = into.setdefault(group, {})
        for key, value in values.items():
            mine.setdefault(key, value)


def draw_named(name: str, rng: np.random.Generator, strength: float, finger: Finger) -> tuple[Settings, dict[str, Any]]:
    """Settings and answer entry of one effect."""
    if name.startswith("outside:"):
        draw, signal = OUTSIDE[name.removeprefix("outside:")]
        return draw(rng, strength, finger), {"effect": name, "finger": finger.name, "joint": None, "signal": signal}
    effect = EFFECTS[name]
    settings = effect.draw(rng, strength, finger)
    joint = effect.joint
    for key in ("slip", "support"):
        if key in settings.get("marker", {}):
            joint = SEGMENTS[settings["marker"][key][0]]
    for key in ("wobble_joint", "travel_joint"):
        if key in settings.get("kin", {}):
            joint = SEGMENTS[settings["kin"][key]]
    if "swaps" in settings.get("marker", {}):
        joint = "proximal" if "_P" in settings["marker"]["swaps"][0][0] else "distal"
    return settings, {"effect": name, "finger": finger.name, "joint": joint, "signal": effect.signal}


def plan_cases(rng: np.random.Generator, counts: dict[str, int], only: str | None) -> list[Case]:
    """The sessions of a set."""
    names = [only] if only else list(EFFECTS)
    scalable = [name for name in names if only or EFFECTS[name].scalable]
    cases = [Case("single", [names[i % len(names)]]) for i in range(counts["single"])]
    cases += [Case("none") for _ in range(counts["none"])]
    for kind in ("weak", "messy"):
        order = rng.permutation(len(scalable))
        cases += [Case(kind, [scalable[order[i % len(order)]]]) for i in range(counts[kind])]
    for _ in range(counts["pair"]):
        first = EFFECTS[str(rng.choice(scalable))]
        others = [effect.name for effect in EFFECTS.values() if effect.scalable and effect.station != first.station]
        cases.append(Case("pair", [first.name, str(rng.choice(others))], apart=rng.random() < 0.25))
    kinds = list(OUTSIDE)
    order = rng.permutation(len(kinds))
    cases += [Case("outside", ["outside:" + kinds[order[i % len(kinds)]]]) for i in range(counts["outside"])]
    return cases


def make_case(case: Case, folder: Path, seed: int, anywhere: bool = False) -> dict[str, Any]:
    """Record one session and return its answer; anywhere: in a laboratory of its own."""
    laboratory = draw_laboratory(np.random.default_rng([seed, 1])) if anywhere else Laboratory()
    rng = np.random.default_rng(seed)
    hand = draw_hand(rng)
    target = hand.fingers[int(rng.random() < 0.25)]
    other = hand.fingers[1] if target is hand.fingers[0] else hand.fingers[0]
    settings: dict[str, Settings] = {target.name: {}, other.name: {}}
    entries: list[dict[str, Any]] = []
    strength = WEAK if case.kind == "weak" else 1.0
    for i, name in enumerate(case.effects):
        finger = other if case.apart and i == 1 else target
        drawn, entry = draw_named(name, rng, strength, finger)
        merge(settings[finger.name], drawn)
        entries.append(entry)
    if case.kind == "messy":
        for effect in EFFECTS.values():
            if effect.scalable and effect.name not in case.effects:
                merge(settings[target.name], effect.draw(rng, BACKGROUND, target))
    for finger in (target, other):  # one log clock serves both fingers
        if "skew" in settings[finger.name].get("rec", {}):
            for each in settings.values():
                each.setdefault("rec", {})["skew"] = settings[finger.name]["rec"]["skew"]
    Recorder(
        folder,
        hand,
        settings,
        rng,
        noise=1.5 if case.kind == "weak" else 1.0,
        short=case.kind == "weak",
        laboratory=laboratory,
    ).write()
    if not entries:
        entries = [{"effect": "none", "finger": target.name, "joint": None, "signal": "current"}]
    flat: Settings = {}
    for finger in (target, other):
        merge(flat, settings[finger.name])
    answer: dict[str, Any] = {
        "case": folder.name,
        "seed": seed,
        "kind": case.kind,
        "background": case.kind == "messy",
        "effects": entries,
        "laboratory": asdict(laboratory),
        "settings": flat,
        "settings_by_finger": settings,
    }
    answer.update(describe(hand, settings))
    return answer


def make_set(out: Path, seed: int, counts: dict[str, int], only: str | None, anywhere: bool = False) -> None:
    """Record a set into `out` and its answers into `out`.answers; anywhere: each session in a laboratory of its own."""
    rng = np.random.default_rng(seed)
    cases = plan_cases(rng, counts, only)
    order = rng.permutation(len(cases))
    answers_folder = out.with_name(out.name + ".answers")
    answers: list[dict[str, Any]] = []
    for i, index in enumerate(order):
        folder = out / f"case_{i:03d}"
        began = time.perf_counter()
        answer = make_case(cases[index], folder, seed * 10000 + int(index), anywhere)
        target = answers_folder / folder.name
        target.mkdir(parents=True)
        (target / "answer.json").write_text(json.dumps(answer, indent=1) + "\n")
        answers.append(answer)
        label = ", ".join(entry["effect"] for entry in answer["effects"])
        print(f"{folder.name} {cases[index].kind}: {label} ({time.perf_counter() - began:.1f} s)", flush=True)
    (answers_folder / "answers.json").write_text(json.dumps(answers, indent=1) + "\n")
