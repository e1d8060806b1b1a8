"""Check a compiled folder against the conventions of descriptions: every item measured, none taken from the files' own
words."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from ..compile.readme import VERIFICATION
from ..description import Description, Model, read_description
from ..errors import DescriptionError, did_you_mean
from .agreement import agreement
from .coupling import direction, mimic, stiffness
from .finding import Finding, table
from .kinematics import digits, hinges, limits
from .layout import files, geoms, inertias, names
from .mirror import mirror
from .rest import contact_free, keyframes, quiet

__all__ = ["ITEMS", "Finding", "check", "record", "table"]

PER_MODEL = {
    "names": names,
    "hinges": hinges,
    "digits": digits,
    "limits": limits,
    "engines agree": agreement,
    "coupling": direction,
    "coupling stiffness": stiffness,
    "mimic": mimic,
    "inertias": inertias,
    "geoms": geoms,
    "keyframes": keyframes,
    "contact": contact_free,
    "quiet": quiet,
}
ITEMS = ("files", *PER_MODEL, "mirror")


def check(folder: str | Path, other: str | Path | None = None, items: Collection[str] = ITEMS) -> list[Finding]:
    """Findings on every variant of a compiled hand; `other` is the compiled hand of the other side, for the mirror
    relation.

    items: which to measure. An item that cannot be measured has not passed. Raises DescriptionError where the folder is
    no compiled hand, or an item has another name.
    """
    for item in items:
        if item not in ITEMS:
            raise DescriptionError(f'there is no item "{item}" to check; {did_you_mean(item, ITEMS)}')
    description = read_description(folder)
    findings = [files(description)] if "files" in items else []
    for model in description.models:
        findings += [_measured(item, description, model) for item in PER_MODEL if item in items]
    if other is not None and "mirror" in items:
        findings.append(mirror(description, read_description(other)))
    return findings


def _measured(item: str, description: Description, model: Model) -> Finding:
    try:
        return PER_MODEL[item](description, model)
    except (DescriptionError, KeyError, ValueError, AttributeError) as error:  # what a damaged file makes readers raise
        return Finding(f"{item}: {model.stem}", False, None, f"cannot be measured: {error}")


def record(folder: str | Path, findings: list[Finding]) -> None:
    """Put the findings into the folder's README, in place of what its section *Verification* said before."""
    path = Path(folder) / "README.md"
    head = path.read_text().split(VERIFICATION)[0]
    passed = sum(f.passed for f in findings)
    text = (
        f"{head}{VERIFICATION}\n\nMeasured by `hand-model check`: "
        f"{passed} of {len(findings)} items passed.\n\n{table(findings)}\n"
    )
    staging = path.with_name(".README.md.new")
    staging.write_text(text)
    os.replace(staging, path)
