"""`hand-model diagnose SESSION [--model DIR] --output DIR`"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from .progress import Progress

if TYPE_CHECKING:
    from ..diagnose import Finding

SUMMARY = "say what physics is missing: where recording and declared model differ, what was left out, how sure that is"


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("session", metavar="SESSION", help="folder with a session.toml, of a hand or a rig")
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--model",
        metavar="DIR",
        help="a compiled hand or a .hand file into which the effects are written (default: identified here); "
        "a rig brings its own",
    )
    which.add_argument("--no-model", action="store_true", help="write no model: findings and report only")
    parser.add_argument(
        "--output", required=True, metavar="DIR", help="folder for findings.json, report.html and the improved model"
    )


def run(options: Namespace, say: Progress) -> int:
    """Diagnose and print the findings."""
    from ..diagnose import diagnose
    from ..session import read_session

    session = read_session(options.session)
    findings = diagnose(session, False if options.no_model else options.model, options.output, say, say.share)
    say.clear()
    print(f"verdict: {findings.verdict}")
    for finding in findings.findings:
        print(f"- {finding.statement}")
        if session.rig is None:  # a rig's statement ends with its proof
            print(f"  {_proof(finding)}")
    for entry in findings.unexplained:
        place = " ".join(str(entry["where"][k]) for k in ("finger", "joint", "signal") if entry["where"].get(k))
        print(f"- unexplained: {place + ': ' if place else ''}{entry['shape']}")
    for note in findings.notes:
        print(f"note: {note}")
    if findings.next_experiment:
        print(f"next: {findings.next_experiment}")
    print(f"\n{Path(options.output) / 'findings.json'}")
    return 0


def _proof(finding: Finding) -> str:
    """Probability, what cannot be told from it, and the error before and after on recordings kept out."""
    fit, others = finding.fit, [name for name in finding.members if name != finding.effect]
    scale, unit = (1e3, "mm") if fit.get("unit") == "m" else (1.0, str(fit.get("unit")))
    words = [f"probability {finding.probability:.2f}"]
    if others:
        words.append(f"not told here from {', '.join(others)}")
    if fit.get("before") is not None and fit.get("after") is not None:
        where = "of recordings kept out" if fit["held_out"] else "of the same recordings"
        words.append(
            f"error {where} {scale * fit['before']:.3g} -> {scale * fit['after']:.3g} {unit} (noise "
            f"{scale * fit['noise_floor']:.3g})"
        )
    return "; ".join(words)
