"""Make a set of sessions with something hidden in them: sessions of a two-finger hand, independent of every other
recorder.

A session takes about 1 s, a messy one 3 to 5 s. `lab` draws hand, instruments, controller and protocol, `plant` steps
the drive at 2 kHz, `effects` draws a law per effect (variants, each with one amplitude), `size` turns the amplitude
until the declared model, refitted to the noise-free truth by `observer`, is off by a drawn multiple of the channel's
noise (mismatch_over_noise in the answers).

At full strength that multiple is log-uniform: current 0.5-1.5, markers 0.5-1.3, slips 0.7-1.7, clock 1-3, contact and
change of preload 0.4-0.9, presliding 1.1-2. Not sized but drawn: sag 8-15 % of the speed at full load, command delay
60-140 ms, swap 0.6-3 s, limit of the drive (only where it is alone: it may stall otherwise), mains hum, command as
measurement. Where the largest plausible amplitude stays below 0.4 the law is drawn again, and the best of six is kept,
so that a few are smaller.

weak: 40 % of that at ordinary noise, then all noise times 1.4-1.8, and a shorter protocol. messy: the main effect at
full strength, every other (but command_as_measurement) at a tenth of its amplitude, or of its mismatch if its law is
not proportional. pair: two of different groups in one finger. outside: something that the vocabulary has no word for.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sixth_recorder.effects.table import ALONE, EFFECTS, JOINABLE, MAIN, OUTSIDE, VOCABULARY
from sixth_recorder.lab import CONTROLLERS, Lab
from sixth_recorder.machine import Machine
from sixth_recorder.plant import library
from sixth_recorder.record import record
from sixth_recorder.size import TRACE, fit, make_safe

KINDS = ("single", "none", "pair", "weak", "messy", "outside")
WEAK, BACKGROUND = 0.4, 0.1  # strengths
LEAST = 0.4  # mismatch over noise at full strength below which a law is drawn again
REDRAWS = 5


def make_set(out: Path, seed: int, counts: dict[str, int]) -> None:
    """Write `out/case_000/...` and `out.answers/answers.json`; counts by kind of KINDS.

    Raises ValueError for another kind, CompilerError where there is no C compiler."""
    unknown = set(counts) - set(KINDS)
    if unknown:
        raise ValueError(f"unknown kinds {sorted(unknown)}; known are {', '.join(KINDS)}")
    library()  # before anything is written
    rng = np.random.default_rng(seed)
    cases = _cases(rng, counts)
    out.mkdir(parents=True, exist_ok=True)
    place = out.with_name(out.name + ".answers")
    place.mkdir(parents=True, exist_ok=True)
    answers = []
    for i, j in enumerate(rng.permutation(len(cases))):
        kind, names = cases[j]
        folder = out / f"case_{i:03d}"
        if folder.exists():
            shutil.rmtree(folder)
        effects, settings = make_case(folder, np.random.default_rng([seed, i]), kind, names)
        answers.append({"case": folder.name, "kind": kind, "effects": effects, "settings": settings})
    (place / "answers.json").write_text(json.dumps(answers, indent=1, default=float))


def make_case(
    folder: Path, rng: np.random.Generator, kind: str, names: list[str]
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Record one session with the named effects, the main one first, all in one finger; returns them and the
    settings."""
    turned = True if names[:1] == ["gravity_load"] and rng.random() < 0.8 else None
    lab = Lab(rng, kind, turned)
    machines = {finger.name: Machine(finger) for finger in lab.fingers}
    finger = lab.fingers[int(rng.integers(2))]
    machine = machines[finger.name]
    machine.all_machines = list(machines.values())
    effects = []
    for i, name in enumerate(names):
        strength = BACKGROUND
        if i == 0 or kind == "pair":
            strength = WEAK if kind == "weak" else 1.0
        alone = len(names) == 1
        rounds = 5 if strength > TRACE else 3
        entry, hide = fit(name, lab, finger, rng, strength, rounds, alone)
        for k in range(REDRAWS):  # this laboratory may be unable to show it
            seen = entry["parameters"]["mismatch_over_noise"]
            if strength < TRACE or seen is None or seen > LEAST * strength:
                break
            if kind == "outside" and k > 1:
                name = str(rng.choice(list(OUTSIDE)))
            other, hide_other = fit(name, lab, finger, rng, strength, alone=alone)
            if (other["parameters"]["mismatch_over_noise"] or 9) > seen:
                entry, hide = other, hide_other
        effects.append(entry)
        hide(machine)
    for each in machines.values():
        make_safe(each)
    record(lab, machines, folder)
    return effects, _settings(lab)


def _deck(rng: np.random.Generator, names: list[str]) -> Iterator[str]:
    """The names in a new order again and again."""
    while True:
        yield from (str(name) for name in rng.permutation(names))


def _cases(rng: np.random.Generator, counts: dict[str, int]) -> list[tuple[str, list[str]]]:
    """Kinds and effects."""
    decks = {
        "single": _deck(rng, MAIN),
        "weak": _deck(rng, JOINABLE),
        "messy": _deck(rng, JOINABLE),
        "outside": _deck(rng, list(OUTSIDE)),
    }
    cases = []
    for kind in KINDS:
        for _ in range(counts.get(kind, 0)):
            names = [next(decks[kind])] if kind in decks else []
            if kind == "messy":
                names += [name for name in VOCABULARY if name not in (*names, ALONE)]
            elif kind == "pair":
                names = _two(rng)
            cases.append((kind, names))
    return cases


def _two(rng: np.random.Generator) -> list[str]:
    """Two effects of different groups."""
    while True:
        one, two = (str(name) for name in rng.choice(JOINABLE, 2, replace=False))
        if EFFECTS[one].group != EFFECTS[two].group:
            return [one, two]


def _settings(lab: Lab) -> dict[str, Any]:
    """What the laboratory drew."""
    fingers = {
        finger.name: {
            "angle_full": finger.full,
            "proximal_polynomial": finger.proximal_map.tolist(),
            "distal_polynomial": finger.distal_map.tolist(),
            "axes": [axis.tolist() for axis in finger.axes],
            "centres": [centre.tolist() for centre in finger.centres],
            "open_counts": finger.open,
            "range_counts": finger.counts,
            "resolution": finger.resolution,
            "jitter": finger.jitter,
            "sigma_current": lab.sigma_current[finger.name],
            "plant": {name: round(float(value), 6) for name, value in finger.plant.p.items() if value},
        }
        for finger in lab.fingers
    }
    return {
        "side": lab.side,
        "controller": CONTROLLERS[lab.control],
        "fingers": fingers,
        "sigma_marker": lab.sigma_marker,
        "marker_coloured": lab.marker_coloured,
        "rate_mocap": lab.rate_mocap,
        "rate_log": lab.rate_log,
        "log_jitter": lab.log_jitter,
        "lost_rows": lab.lost,
        "current_quantum": lab.current_quantum,
        "current_coloured": lab.current_coloured,
        "restless": lab.restless,
        "speed_full": lab.speed_full,
        "palm_turned": lab.turned,
        "excitation_mocap": lab.excitation_mocap,
        "noise_factor": lab.noise_factor,
        "occlusion": lab.occlusion,
        "clock_offset": lab.clock_offset,
    }
