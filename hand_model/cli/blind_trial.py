"""`hand-model blind-trial --cases N --seed S`"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable

SUMMARY = "hide effects in recordings of the twin, diagnose them blindly, open the answers and score"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--cases", type=int, default=20, help="how many sessions (default: 20)")
    parser.add_argument("--seed", type=int, default=0, help="of everything (default: 0)")
    parser.add_argument(
        "--output", metavar="DIR", help="keep sessions, answers and findings here (default: a temporary folder)"
    )


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """Run the trial and print the score; the answers' hash and the progress go to stderr at once."""
    import sys

    from ..blind_trial import blind_trial
    from ..errors import HandModelError

    if options.cases < 1:
        raise HandModelError(f"--cases {options.cases}: one or more are needed")
    trial = blind_trial(
        options.cases, options.seed, options.output, say=lambda line: print(line, file=sys.stderr, flush=True)
    )
    print(f"answers.json SHA-256 {trial.sha256}\n\n{trial.table()}")
    return 0
