"""`hand-model identify SESSION --output FILE`"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path

SUMMARY = "learn a hand from a recording session: axes, centres, encoder maps, linkages"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("session", metavar="SESSION", help="folder with a session.toml")
    parser.add_argument("--output", required=True, metavar="FILE", help="the .hand file to write")


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """Identify, write, print what was learned."""
    from ..errors import HandModelError
    from ..hand import load_hand
    from ..identify import identify
    from ..output import new_file, refuse_folder
    from ..report.text import hand_text

    target = Path(options.output)
    if target.is_dir():
        raise HandModelError(f"{target}: is a folder; name a file such as {target / 'left.hand'}")
    refuse_folder(target)
    if target.exists():
        load_hand(target)  # only a .hand file may be replaced
    hand = identify(options.session, say)
    with new_file(target) as staging:
        hand.save(staging)
    print(hand_text(hand))
    print(f"\n{target}")
    return 0
