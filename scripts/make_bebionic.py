"""Rebuild assets/bebionic_left and assets/bebionic_right from the published tables, and check them.

Usage: python scripts/make_bebionic.py [--assets DIR]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hand_model.bebionic import SIDES, published_hand
from hand_model.check import check, record, table
from hand_model.compile import compile


def main() -> int:
    """Compile both hands and write what the check measured into their READMEs; 1 where an item does not pass."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--assets", type=Path, default=Path(__file__).resolve().parents[1] / "assets")
    assets = parser.parse_args().assets
    folders = {side: compile(published_hand(side), assets / f"bebionic_{side}").folder for side in SIDES}
    failed = 0
    for side, other in zip(SIDES, reversed(SIDES), strict=True):
        findings = check(folders[side], folders[other])
        record(folders[side], findings)
        print(f"{folders[side]}\n{table(findings)}\n")
        failed += sum(not f.passed for f in findings)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
