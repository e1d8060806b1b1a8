"""What a diagnosis says (`hand-findings/1`): a frozen record, written as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

FORMAT = "hand-findings/1"


@dataclass(frozen=True)
class Finding:
    """One effect that the declared model lacks, in the fields of the format. members: the format's `class`."""

    effect: str
    members: tuple[str, ...]
    probability: float
    alternatives: tuple[Mapping[str, Any], ...]
    where: Mapping[str, Any]
    statement: str
    parameters: Mapping[str, Any]
    fit: Mapping[str, Any]
    model: Mapping[str, Any] | None
    correction: str | None = None


@dataclass(frozen=True)
class Findings:
    """Everything a diagnosis says. verdict: "consistent", "mismatch" or "unexplained"; xml: the improved model."""

    session: str
    verdict: str
    lack_of_fit: Mapping[str, Any]
    protocol: Mapping[str, Any]
    findings: tuple[Finding, ...]
    rejected: tuple[Mapping[str, Any], ...] = ()
    unexplained: tuple[Mapping[str, Any], ...] = ()
    next_experiment: str = ""
    declared: Mapping[str, Any] = field(default_factory=dict)
    xml: bytes = field(default=b"", repr=False)
    declared_xml: bytes = field(default=b"", repr=False)

    def to_json(self) -> str:
        """The JSON text of findings.json, the same for the same findings."""
        table = {"format": FORMAT, **asdict(self)}
        table.pop("xml")
        table.pop("declared_xml")
        for finding in table["findings"]:
            finding["class"] = finding.pop("members")
            if finding["correction"] is None:
                finding.pop("correction")
        return json.dumps(_plain(table), indent=2, ensure_ascii=False) + "\n"

    def write(self, folder: str | Path) -> None:
        """Write findings.json, rig.xml (patched) and rig_declared.xml (fitted, nothing added), each in one rename."""
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        files = {"findings.json": self.to_json().encode(), "rig.xml": self.xml, "rig_declared.xml": self.declared_xml}
        for name, content in files.items():
            if content:
                part = path / f".{name}.part"
                part.write_bytes(content)
                os.replace(part, path / name)


def _plain(value: Any) -> Any:
    """Numbers JSON can hold: nan and infinity become null."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, (np.floating, float)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
