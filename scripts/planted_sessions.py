"""Effects planted in recordings of a foreign hand: its motion, its noise and its plant stay what they were.

    python scripts/planted_sessions.py FOLDER --output DIR [--seed 1] [--size 1.0] [--noise 0.0] [--only EFFECT ...]

FOLDER holds session folders with one answer.json each; DIR must be new. Each effect of `planting/` is planted in a
finger in which nothing is hidden, of one session after the other; what is found is held against it and against what was
hidden before. A load is added to the current at the motion as it was: what a controller would do with it is left out.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from planting.compose import EFFECTS, planted
from shown_answers import all_named, answer_of, hidden_in

from hand_model import diagnose


def healthy(source: Path) -> list[str]:
    """Fingers of a session in which nothing is hidden."""
    ill = {finger for _, finger in hidden_in(source)}
    return [f for f in answer_of(source)["motor"] if f not in ill]


def trial(
    source: Path, target: Path, finger: str, effect: str, size: float, seed: int, noise: float
) -> tuple[bool, str]:
    """Plant, diagnose, compare: whether all that is there is named and nothing else, and a line that says so."""
    plant = planted(source, target / "session", finger, effect, size, seed, noise)
    hidden = sorted([*hidden_in(source), (effect, finger)])
    found = diagnose(target / "session", output=target / "findings", model=False)
    named = [(f.effect, f.where["finger"]) for f in found.findings]
    right = all_named(named, hidden)
    figures = {k: round(v, 4) if isinstance(v, float) else v for k, v in plant.figures.items()}
    word = "" if right else "  MISSED"
    return right, f"{target.name}: {named or found.verdict}, hidden {hidden} {figures}{word}"


def main() -> None:
    """The whole trial."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=list(EFFECTS), default=list(EFFECTS))
    options = parser.parse_args()
    if options.output.exists():
        sys.exit(f"{options.output} exists; a new folder is needed")
    sources = sorted(p.parent for p in options.folder.glob("*/answer.json"))
    places = [(s, f) for s in sources for f in healthy(s)]
    order = np.random.default_rng(options.seed).permutation(len(places))
    with ProcessPoolExecutor(options.workers) as pool:
        waiting = []
        for i, effect in enumerate(EFFECTS):
            if effect in options.only:
                source, finger = places[order[i % len(places)]]
                target = options.output / f"{effect}_{source.name}_{finger}"
                seed = 1000 * options.seed + i
                waiting.append(pool.submit(trial, source, target, finger, effect, options.size, seed, options.noise))
        right = 0
        for done in waiting:
            same, line = done.result()
            right += same
            print(line, flush=True)
    print(f"{right} of {len(waiting)} right")


if __name__ == "__main__":
    main()
