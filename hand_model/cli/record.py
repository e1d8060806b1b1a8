"""`hand-model record DIR`: the twin writes a session."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable

SUMMARY = "let the twin record a session of a BeBionic hand, with something hidden in it if asked"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("folder", metavar="DIR", help="the session folder to write (new or empty)")
    parser.add_argument("--side", choices=("left", "right"), default="left")
    parser.add_argument(
        "--seed", type=int, default=0, help="another specimen in another laboratory for each (default: 0)"
    )
    parser.add_argument("--fingers", metavar="A,B", help="thumb_0, thumb_1, index, middle, ring, little (default: all)")
    parser.add_argument(
        "--effect", action="append", default=[], metavar="NAME", help="hide an effect; may be given several times"
    )
    parser.add_argument(
        "--format", choices=("c3d", "tsv", "trc", "csv"), default="c3d", help="of the marker files (default: c3d)"
    )
    parser.add_argument("--answer", metavar="FILE", help="where to write what was hidden (otherwise it is not kept)")


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """Record and name the folder."""
    from ..errors import HandModelError, did_you_mean
    from ..output import new_file, refuse_folder
    from ..twin import CATALOGUE, bebionic, record

    for name in options.effect:
        if name not in CATALOGUE:
            raise HandModelError(f'the twin has no effect "{name}"; {did_you_mean(name, CATALOGUE)}')
    if options.answer:
        refuse_folder(options.answer)  # before a session is written whose answer could not be
    fingers = options.fingers.split(",") if options.fingers else None
    truth = bebionic(options.side, options.seed, fingers)
    answer = record(truth, options.folder, options.seed, tuple(options.effect), mocap_format=options.format)
    if options.answer:
        with new_file(options.answer) as staging:
            answer.save(staging)
    print(f"{answer.path}: {len(answer.trials)} trials of {', '.join(f.name for f in truth.fingers)}")
    return 0
