"""The command line `hand-model`: one file per command, nothing heavy imported before a command runs."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from ..errors import HandModelError, did_you_mean
from .progress import Progress

# Command -> module here with SUMMARY, add_arguments(parser) and run(options, say) -> exit status.
COMMANDS = {
    "demo": "demo",
    "identify": "identify",
    "compile": "compile",
    "replay": "replay",
    "diagnose": "diagnose",
    "touch": "touch",
    "compare": "compare",
    "check": "check",
    "record": "record",
    "blind-trial": "blind_trial",
}
# Matrices here are small: threads inside BLAS cost several times what they gain. Set before numpy loads; a user's own
# setting stays.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# Status where the input or the request is wrong; 1 is for a check that ran and found something.
BAD_INPUT = 2


class _Parser(argparse.ArgumentParser):
    """argparse, with one sentence for a mistake."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f'{self.prog}: {message}; see "{self.prog} --help"\n')


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit status: 0 done, 1 a check found something, 2 bad input (one sentence on
    stderr).
    """
    words = list(sys.argv[1:] if argv is None else argv)
    if words and not words[0].startswith("-") and words[0] not in COMMANDS:
        print(f'hand-model: no command "{words[0]}"; {did_you_mean(words[0], COMMANDS)}', file=sys.stderr)
        return BAD_INPUT
    options = _parser().parse_args(words)
    for name in THREADS:
        os.environ.setdefault(name, "1")
    progress = _progress(options)
    try:
        try:
            status = options.run(options, progress)
        finally:
            progress.clear()
        sys.stdout.flush()
        return status
    except HandModelError as error:
        return _refuse(options.command, str(error))
    except BrokenPipeError:  # the reader of our output has gone, as in `hand-model ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        return _refuse(options.command, f"{error.filename or 'a file'}: {error.strerror or error}")
    except KeyboardInterrupt:
        return _refuse(options.command, "stopped", 130)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="hand-model", description="From recordings of a real robot hand to a simulated hand that behaves like it."
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=_Parser)
    for name, module_name in COMMANDS.items():
        module = importlib.import_module(f".{module_name}", __name__)
        command = commands.add_parser(name, help=module.SUMMARY, description=module.SUMMARY)
        module.add_arguments(command)
        command.add_argument("--quiet", action="store_true", help="no progress lines on stderr")
        command.add_argument("--verbose", action="store_true", help="progress lines even where stderr is no terminal")
        command.set_defaults(run=module.run)
    return parser


def _progress(options: argparse.Namespace) -> Progress:
    terminal = sys.stderr.isatty() and not options.quiet
    return Progress(sys.stderr, options.verbose or terminal, terminal)


def _refuse(command: str, message: str, status: int = BAD_INPUT) -> int:
    print(f"hand-model {command}: {' '.join(message.split())}", file=sys.stderr)
    return status
