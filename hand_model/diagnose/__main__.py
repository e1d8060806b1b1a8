"""`python -m hand_model.diagnose SESSION OUTPUT [SESSION OUTPUT ...]`: sessions diagnosed in a process of its own,
models written and proved."""

from __future__ import annotations

import sys
import time

from ..errors import HandModelError
from . import Findings
from .diagnosis import diagnose


def main(arguments: list[str]) -> int:
    """Diagnose each session into its output folder; a refused session gets findings that say why."""
    for session, output in zip(arguments[::2], arguments[1::2], strict=True):
        begin = time.perf_counter()
        try:
            diagnose(session, output=output)
        except HandModelError as error:
            Findings("unexplained", {}, {}, notes=(str(error),)).save(output)
        print(f"{session} {time.perf_counter() - begin:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
