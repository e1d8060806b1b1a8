"""Findings of a rig: those of any session, and the rig's MJCF as it was fitted and as it was improved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..diagnose.findings import Finding, Findings

__all__ = ["Finding", "Findings", "RigFindings"]


@dataclass(frozen=True)
class RigFindings(Findings):
    """What a rig's diagnosis says. session: its name; declared: fitted declared parameters; declared_xml, xml: the MJCF
    with those, and with the effects that were found as well."""

    session: str = ""
    declared: Mapping[str, float] = field(default_factory=dict)
    xml: bytes = field(default=b"", repr=False)
    declared_xml: bytes = field(default=b"", repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The whole as the format has it, with the session's name and the declared parameters."""
        return {**super().to_dict(), "session": self.session, "declared": dict(self.declared)}

    def write(self, folder: str | Path) -> None:
        """Write rig.xml (improved), rig_declared.xml (fitted, nothing added) and findings.json, each whole or not at all."""
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        for name, content in (("rig.xml", self.xml), ("rig_declared.xml", self.declared_xml)):
            if content:
                part = path / f".{name}.part"
                part.write_bytes(content)
                part.replace(path / name)
        self.save(path)
