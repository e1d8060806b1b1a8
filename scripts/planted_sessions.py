"""Effects planted in recordings of a foreign hand: its motion, its noise and its plant stay what they were.

    python scripts/planted_sessions.py FOLDER --output DIR [--seed 1] [--size 1.0] [--noise 0.0] [--only EFFECT ...]
        [--pairs N] [--messy N]

FOLDER holds session folders with one answer.json each; DIR must be new. Each effect of `planting/` is planted in a
finger in which nothing is hidden, of one session after the other; what is found is held against it and against what was
hidden before. With --pairs or --messy two effects at once, or one with all others at a tenth of their size, instead. A
load is added to the current at the motion as it was: what a controller would do with it is left out.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from planting.cases import Case, messy, pairs, singles
from planting.compose import EFFECTS, planted
from shown_answers import all_named, answer_of, hidden_in

from hand_model import diagnose


def healthy(source: Path) -> list[str]:
    """Fingers of a session in which nothing is hidden."""
    ill = {finger for _, finger in hidden_in(source)}
    return [f for f in answer_of(source)["motor"] if f not in ill]


def trial(case: Case, target: Path, noise: float) -> tuple[bool, bool, str]:
    """Plant, diagnose, compare: whether all that is there is named and nothing else (of a messy case: whether the main
    effect is the first of its finger's), whether it is among the first three, and a line that says so."""
    plants = planted(case.source, target / "session", case.finger, case.sizes, case.seed, noise)
    before = hidden_in(case.source)
    found = diagnose(target / "session", output=target / "findings", model=False)
    named = [(f.effect, f.where["finger"]) for f in found.findings]
    figures = {
        e: {k: round(v, 4) if isinstance(v, float) else v for k, v in plants[e].figures.items()} for e in case.main
    }
    if case.kind == "messy":
        known = {effect for effect, _ in before}  # what is of no finger in particular may be another's
        mine = [e for e, finger in named if finger == case.finger or finger is None and e not in known]
        right, three = mine[:1] == list(case.main), case.main[0] in mine[:3]
        named = [(e, case.finger) for e in mine[:4]]
    else:
        right = three = all_named(named, sorted([*before, *((effect, case.finger) for effect in case.main)]))
    word = "" if right else "  MISSED"
    return right, three, f"{target.name}: {named or found.verdict}, hidden before {before} {figures}{word}"


def main() -> None:
    """The whole trial."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--pairs", type=int, default=0)
    parser.add_argument("--messy", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=list(EFFECTS), default=list(EFFECTS))
    options = parser.parse_args()
    if options.output.exists():
        sys.exit(f"{options.output} exists; a new folder is needed")
    sites = [(s, f) for s in sorted(p.parent for p in options.folder.glob("*/answer.json")) for f in healthy(s)]
    drawn = [
        *pairs(sites, options.only, options.pairs, options.size, options.seed),
        *messy(sites, options.only, options.messy, options.size, options.seed),
    ] or singles(sites, options.only, options.size, options.seed)
    score: dict[str, list[tuple[bool, bool]]] = {}
    with ProcessPoolExecutor(options.workers) as pool:
        waiting = [(c.kind, pool.submit(trial, c, options.output / f"{c.name}_{c.seed}", options.noise)) for c in drawn]
        for kind, done in waiting:
            right, three, line = done.result()
            score.setdefault(kind, []).append((right, three))
            print(line, flush=True)
    for kind, all_of in score.items():
        first, three = (sum(x) for x in zip(*all_of, strict=True))
        last = f", {three} in the first three" if kind == "messy" else ""
        print(f"{kind}: {first} of {len(all_of)} right{last}")


if __name__ == "__main__":
    main()
