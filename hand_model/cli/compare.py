"""`hand-model compare A.hand B.hand [--output DIR]`"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable

SUMMARY = "the thesis's checks: two sessions of one hand (repeatability), left and right (mirror), parallel axes"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("first", metavar="A", help="a .hand file")
    parser.add_argument(
        "second", metavar="B", help="a .hand file: of the same side (repeatability) or of the other one (mirror)"
    )
    parser.add_argument("--output", metavar="DIR", help="folder for a page (comparison.html)")


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """Print the three tables; with --output also write them as a page."""
    from ..hand import load_hand
    from ..output import new_folder
    from ..report.comparison import comparison_page, comparison_text

    a, b = load_hand(options.first), load_hand(options.second)
    text = comparison_text(a, b)
    if options.output:
        with new_folder(options.output, ("comparison.html",)) as staging:
            (staging / "comparison.html").write_bytes(comparison_page(a, b))
        text += f"\n\n{options.output}/comparison.html"
    print(text)
    return 0
