"""`hand-model compile HAND --output DIR`"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable

SUMMARY = "write a learned hand as URDF and MJCF"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("hand", metavar="HAND", help="a .hand file, from identify")
    parser.add_argument(
        "--output", required=True, metavar="DIR", help="the folder to write; an earlier compiled hand is replaced"
    )
    parser.add_argument(
        "--newton-metre-per-unit",
        type=float,
        metavar="X",
        help="torque at the proximal joint per raw unit of current (default: efforts stay raw)",
    )


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """Compile and list the files."""
    from ..compile import compile
    from ..hand import load_hand

    description = compile(load_hand(options.hand), options.output, options.newton_metre_per_unit)
    for model in description.models:
        print(f"{model.mjcf}\n{model.urdf}\n{model.scene}")
    return 0
