"""Make sets of sessions with something hidden in them, and the answers."""

import json
from pathlib import Path

import numpy as np

from eighth_recorder.catalogue import OUTSIDE, VOCABULARY, coexist
from eighth_recorder.hand import draw_hand
from eighth_recorder.session import record

KINDS = ("single", "none", "pair", "weak", "messy", "outside")
FULL, WEAK, BACKGROUND = 1.0, 0.4, 0.1


def make_set(out: Path, seed: int, counts: dict[str, int]) -> None:
    """Write OUT/case_000 ... and OUT.answers/answers.json."""
    unknown = sorted(set(counts) - set(KINDS))
    if unknown:
        raise ValueError(f"unknown kinds {unknown}; known: {list(KINDS)}")
    out = Path(out)
    cases = deal(np.random.default_rng([seed, 0]), counts)
    answers = []
    for number, (kind, effects) in enumerate(cases):
        rng = np.random.default_rng([seed, 1, number])
        name = f"case_{number:03d}"
        answers.append({"case": name, "kind": kind, **make_case(out / name, rng, kind, effects)})
    folder = out.parent / f"{out.name}.answers"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "answers.json").write_text(json.dumps(answers, indent=1, default=float) + "\n")


def deal(rng, counts: dict[str, int]) -> list[tuple[str, list]]:
    """Which effects each case hides; every kind goes evenly through its catalogue, in a shuffled order."""
    cases = []
    for kind in KINDS:
        pool = OUTSIDE if kind == "outside" else VOCABULARY
        queue = []
        for _ in range(counts.get(kind, 0)):
            if kind == "none":
                cases.append((kind, []))
                continue
            if len(queue) < 2:
                queue += [pool[j] for j in rng.permutation(len(pool))]
            effects = [queue.pop(0)]
            if kind == "pair":
                mates = [
                    j
                    for j, other in enumerate(queue)
                    if coexist(effects[0], other) and not (effects[0].alone or other.alone)
                ]
                while not mates:
                    effects = [queue.pop(0)]
                    queue += [pool[j] for j in rng.permutation(len(pool))]
                    mates = [
                        j
                        for j, other in enumerate(queue)
                        if coexist(effects[0], other) and not (effects[0].alone or other.alone)
                    ]
                effects.append(queue.pop(mates[0]))
            cases.append((kind, effects))
    return [cases[j] for j in rng.permutation(len(cases))]


def make_case(folder: Path, rng, kind: str, effects: list) -> dict:
    """Record one session and say what is in it."""
    hand = draw_hand(rng, weak=kind == "weak")
    strength = WEAK if kind == "weak" else FULL
    finger = hand.fingers[int(rng.integers(len(hand.fingers)))]
    hidden = [hide(effect, finger, hand, rng, strength) for effect in effects]
    if kind == "messy":
        for other in VOCABULARY:
            if not other.alone and all(coexist(other, effect) for effect in effects):
                hidden.append(hide(other, finger, hand, rng, BACKGROUND))
    answer = {"side": hand.side, "effects": [entry for entry, _ in hidden]}
    answer["settings"] = {entry["effect"]: parameters for entry, parameters in hidden}
    answer["motor"] = {
        f.name: {key: f.motor[key] for key in ("m", "b", "Fc", "k", "tau0", "kp", "kd", "bristle_x")}
        for f in hand.fingers
    }
    answer["noise"] = {f.name: {"position": f.position_noise, "current": f.current_noise} for f in hand.fingers}
    answer["kinematics"] = {
        f.name: {
            "axes": f.axes.tolist(),
            "centres_mm": f.centres.tolist(),
            "full": list(f.full),
            "curve": f.curve.tolist(),
            "coupling": f.coupling.tolist(),
        }
        for f in hand.fingers
    }
    record(hand, folder, rng)
    return answer


def hide(effect, finger, hand, rng, strength: float) -> tuple[dict, dict]:
    """Draw one effect into a finger; its entry in the answers, and its settings."""
    parameters = effect.draw(rng, strength, finger, hand)
    finger.hidden.append((effect, parameters))
    entry = {"effect": effect.name, "finger": finger.name, "strength": strength, "law": parameters.get("law")}
    entry.update({key: parameters[key] for key in ("joint", "marker", "channel") if key in parameters})
    return entry, parameters
