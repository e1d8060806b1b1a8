"""`hand-model check DIR [OTHER]`: a compiled hand against its conventions. `hand-model check A.urdf B.xml`: two
descriptions.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path

SUMMARY = (
    "check a compiled hand (DIR, or both sides), or two descriptions of one hand against each other (A.urdf B.xml)"
)


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("first", metavar="DIR|A", help="a compiled hand; or a URDF or MJCF file")
    parser.add_argument(
        "second", metavar="OTHER|B", nargs="?", help="the compiled hand of the other side; or a URDF or MJCF file"
    )
    parser.add_argument("--pair", metavar="FILE", help="pair.toml that settles which names belong together (two files)")
    parser.add_argument("--fix", metavar="DIR", help="folder for corrected copies (two files)")
    parser.add_argument("--json", action="store_true", help="the report as JSON (two files)")
    parser.add_argument(
        "--accept",
        action="append",
        default=[],
        metavar="CAUSE",
        help="report a cause without failing on it (two files)",
    )


def run(options: Namespace, say: Callable[[str], None]) -> int:
    """0 where everything passes, 1 where something differs."""
    if Path(options.first).is_dir():
        given = [f"--{name}" for name in ("pair", "fix", "json", "accept") if getattr(options, name)]
        if given:
            from ..errors import HandModelError

            raise HandModelError(
                f"{given[0]} is for two descriptions, and {options.first} is a folder; name A.urdf B.xml"
            )
        return _folder(options.first, options.second)
    if options.second is None:
        from ..errors import DescriptionError

        raise DescriptionError(f"{options.first}: is no folder of a compiled hand; or name two files, A.urdf B.xml")
    from ..conform import main_check

    return main_check(
        options.first, options.second, options.pair, fix=options.fix, json=options.json, accept=options.accept
    )


def _folder(first: str, second: str | None) -> int:
    from ..check import check

    findings = check(first, second)
    for finding in findings:
        print(f"{'ok  ' if finding.passed else 'FAIL'}  {finding.item}: {finding.sentence}")
    passed = sum(f.passed for f in findings)
    print(f"\n{passed} of {len(findings)} items passed")
    return 0 if passed == len(findings) else 1
