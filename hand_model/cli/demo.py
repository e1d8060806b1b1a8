"""`hand-model demo [--output DIR]`"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable

SUMMARY = "run the whole loop on a session that comes with the package"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--side",
        choices=("left", "right"),
        default="right",
        help="which of the two sessions (default: right, six fingers)",
    )
    parser.add_argument(
        "--output", default="hand_model_demo", metavar="DIR", help="folder to write (default: hand_model_demo)"
    )


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """Run it; what it does is its result, and goes to stdout."""
    from ..demo import demo

    demo(options.side, options.output, lambda line: print(line, flush=True))
    return 0
