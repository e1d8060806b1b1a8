"""Command line: python -m seventh_recorder OUT --seed S --single N --none N --pair N --weak N --messy N --outside N."""

import argparse
from pathlib import Path

from .compose import KINDS, make_set


def main() -> None:
    """Make one set."""
    parser = argparse.ArgumentParser(
        prog="seventh_recorder", description="Simulated recordings with something hidden in them."
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    for kind in KINDS:
        parser.add_argument(f"--{kind}", type=int, default=0, metavar="N")
    args = parser.parse_args()
    make_set(args.out, args.seed, {kind: getattr(args, kind) for kind in KINDS})


if __name__ == "__main__":
    main()
