"""Check a compiled folder against the conventions of descriptions: every item measured, none taken from the files' own words."""

from __future__ import annotations

import os
from pathlib import Path

from ..compile.readme import VERIFICATION
from ..description import read_description
from .agreement import agreement
from .coupling import direction, mimic, stiffness
from .finding import Finding, table
from .kinematics import digits, hinges, limits
from .layout import files, geoms, inertias, names
from .mirror import mirror
from .rest import contact_free, keyframes, quiet

__all__ = ["Finding", "check", "record", "table"]

PER_MODEL = (names, hinges, digits, limits, agreement, direction, stiffness, mimic, inertias, geoms, keyframes, contact_free, quiet)


def check(folder: str | Path, other: str | Path | None = None) -> list[Finding]:
    """Findings on every variant of a compiled hand; `other` is the compiled hand of the other side, for the mirror relation.

    Raises DescriptionError where the folder is no compiled hand.
    """
    description = read_description(folder)
    findings = [files(description)]
    for model in description.models:
        findings += [measure(description, model) for measure in PER_MODEL]
    if other is not None:
        findings.append(mirror(description, read_description(other)))
    return findings


def record(folder: str | Path, findings: list[Finding]) -> None:
    """Put the findings into the folder's README, in place of what its section *Verification* said before."""
    path = Path(folder) / "README.md"
    head = path.read_text().split(VERIFICATION)[0]
    passed = sum(f.passed for f in findings)
    text = f"{head}{VERIFICATION}\n\nMeasured by `hand-model check`: {passed} of {len(findings)} items passed.\n\n{table(findings)}\n"
    staging = path.with_name(".README.md.new")
    staging.write_text(text)
    os.replace(staging, path)
