"""`hand-model replay DIR SESSION --output REPORT`"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable

SUMMARY = "replay a compiled hand against a session: marker error, synchronisation, engines, as a page"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("description", metavar="DIR", help="a compiled hand, from compile")
    parser.add_argument("session", metavar="SESSION", help="folder with a session.toml")
    parser.add_argument("--output", required=True, metavar="REPORT", help="folder for report.html and figures.json")


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """Replay, write the page, print the figures."""
    from ..output import refuse_foreign
    from ..replay import replay
    from ..report import OUTPUTS, write_report
    from ..report.text import residuals_text

    refuse_foreign(options.output, OUTPUTS)
    residuals = replay(options.description, options.session, say)
    page = write_report(residuals, options.output)
    print(residuals_text(residuals))
    print(f"\n{page}")
    return 0
