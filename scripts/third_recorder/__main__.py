"""python -m third_recorder OUT --seed S --single 36 --none 4 --pair 10 --weak 10 --messy 10 --outside 10"""

from __future__ import annotations

import argparse
from pathlib import Path

from .compose import KINDS, make_set
from .motor import CompilerError


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="third_recorder", description="Record sessions of a hand with something hidden in them."
    )
    parser.add_argument("out", type=Path, help="folder of the sessions; the answers go to OUT.answers")
    parser.add_argument("--seed", type=int, default=1)
    for kind in KINDS:
        parser.add_argument(f"--{kind}", type=int, default=0, help=f"number of {kind} sessions")
    arguments = parser.parse_args()
    if arguments.out.exists() and any(arguments.out.iterdir()):
        parser.error(f"{arguments.out} is not empty")
    try:
        make_set(arguments.out, arguments.seed, {kind: getattr(arguments, kind) for kind in KINDS})
    except CompilerError as error:
        parser.exit(1, f"{error}\n")


if __name__ == "__main__":
    main()
