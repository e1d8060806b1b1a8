"""One checked item."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """item: what was checked, of which file. figure: what was measured, in the unit that the sentence names (None for
    yes or no)."""

    item: str
    passed: bool
    figure: float | None
    sentence: str


def table(findings: Sequence[Finding]) -> str:
    """Findings as a Markdown table."""
    rows = [f"| {f.item} | {'yes' if f.passed else '**no**'} | {f.sentence} |" for f in findings]
    return "\n".join(["| item | passed | |", "| --- | --- | --- |", *rows])
