"""The command line of a recorder: which set to make, and where."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path


def main(program: str, kinds: Sequence[str], make_set: Callable[[Path, int, dict[str, int]], None]) -> None:
    """Make one set: OUT --seed S, and a number of sessions of each kind."""
    parser = argparse.ArgumentParser(prog=program, description="Simulated recordings with something hidden in them.")
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    for kind in kinds:
        parser.add_argument(f"--{kind}", type=int, default=0, metavar="N")
    args = parser.parse_args()
    make_set(args.out, args.seed, {kind: getattr(args, kind) for kind in kinds})
