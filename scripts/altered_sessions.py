"""Sessions of a hand as another laboratory would have recorded them, diagnosed: findings should stay what they were.

    python scripts/altered_sessions.py FOLDER --output DIR [--only ALTERATION ...]

FOLDER holds session folders with one answer.json each; DIR must be new. Every session is written in every way of
`alterations.py`, as TSV, TRC, Motive CSV and C3D by turns, and diagnosed without models. What is named and what was
hidden is printed.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from alterations import ALTERATIONS, ENDINGS, altered
from shown_answers import hidden_in

from hand_model import diagnose


def main() -> int:
    """Alter, diagnose, compare; the exit status is 1 where something else than what was hidden is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--only", nargs="+", choices=list(ALTERATIONS), default=list(ALTERATIONS))
    arguments = parser.parse_args()
    right = count = 0
    for i, kind in enumerate(ALTERATIONS):
        if kind not in arguments.only:
            continue
        for j, source in enumerate(sorted(p.parent for p in arguments.folder.glob("*/answer.json"))):
            target = arguments.output / kind / source.name
            altered(source, target / "session", ALTERATIONS[kind], ENDINGS[i % len(ENDINGS)], 100 * i + j)
            hidden = hidden_in(source)
            findings = diagnose(target / "session", output=target / "findings", model=False).findings
            named = [(f.effect, f.where["finger"]) for f in findings]
            same = len(named) == len(hidden) and all(
                n == h or (n[0] == h[0] and n[1] is None) for n, h in zip(named, hidden, strict=True)
            )
            right, count = right + same, count + 1
            print(f"{kind} {source.name}: {named or 'consistent'}, hidden {hidden or 'nothing'}", flush=True)
    print(f"{right} of {count} right")
    return int(right < count)


if __name__ == "__main__":
    sys.exit(main())
