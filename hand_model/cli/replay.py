"""`hand-model replay DIR SESSION --output REPORT`; a rig session brings its own model: `hand-model replay SESSION
--output REPORT`.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..session import Session

SUMMARY = "replay a compiled hand against a session: marker error, synchronisation, engines, as a page"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "description", metavar="DIR", nargs="?", help="a compiled hand, from compile; a rig session needs none"
    )
    parser.add_argument("session", metavar="SESSION", help="folder with a session.toml")
    parser.add_argument("--output", required=True, metavar="REPORT", help="folder for report.html and figures.json")


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """Replay, write the page, print the figures."""
    from ..errors import SessionError
    from ..output import refuse_foreign
    from ..report import OUTPUTS
    from ..session import read_session

    refuse_foreign(options.output, OUTPUTS)
    session = read_session(options.session)
    if session.rig is not None and options.description is None:
        return _rig(session, options.output)
    if options.description is None:
        raise SessionError(
            f"{session.path}: a session of a hand is replayed on a compiled hand; name its folder before the session"
        )
    from ..replay import replay
    from ..report import write_report
    from ..report.text import residuals_text

    residuals = replay(options.description, session, say)
    page = write_report(residuals, options.output)
    print(residuals_text(residuals))
    print(f"\n{page}")
    return 0


def _rig(session: Session, output: str) -> int:
    from ..report.rig import rig_text, write_rig_report
    from ..rig.replay import replay_rig

    residuals = replay_rig(session, couplings=True)
    page = write_rig_report(session, residuals, output)
    print(rig_text(session, residuals))
    print(f"\n{page}")
    return 0
