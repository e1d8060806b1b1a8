"""What a diagnosis says (`hand-findings/1`), as frozen dataclasses and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..output import new_file

FORMAT = "hand-findings/1"
FILES, FOLDERS = ("findings.json", "report.html"), ("model_before", "model", "corrected")  # what a diagnosis writes
UNWRITTEN = {"native": False, "mjcf": None, "urdf": "not expressible"}  # `model` of a finding until a file holds it


@dataclass(frozen=True)
class Finding:
    """One named departure. members: the class of effects that these recordings cannot tell from it (itself included).

    parameters: name -> {"value", "unit", "ci95" (null where none is given)}; fit: before, after and noise floor on
    held-out recordings; model: where it is written; correction: for recordings, what was corrected.
    """

    effect: str
    members: tuple[str, ...]
    probability: float
    alternatives: tuple[tuple[str, float], ...]
    where: Mapping[str, Any]
    statement: str
    parameters: Mapping[str, Mapping[str, Any]]
    fit: Mapping[str, Any]
    model: Mapping[str, Any] | None = None
    correction: str | None = None

    @property
    def held(self) -> str | None:
        """What of the declared model holds it already, so that no file gets it; None where nothing does."""
        return None if self.model is None else self.model.get("note")

    def to_dict(self) -> dict[str, Any]:
        """The finding as the format has it."""
        out: dict[str, Any] = {
            "effect": self.effect,
            "class": list(self.members),
            "probability": self.probability,
            "alternatives": [{"effect": name, "probability": p} for name, p in self.alternatives],
            "where": dict(self.where),
            "statement": self.statement,
            "parameters": {k: {**v, "ci95": v.get("ci95")} for k, v in self.parameters.items()},
            "fit": dict(self.fit),
            "model": None if self.model is None else dict(self.model),
        }
        if self.correction is not None:
            out["correction"] = self.correction
        return out


@dataclass(frozen=True)
class Findings:
    """The diagnosis of a session. verdict: "consistent", "mismatch" or "unexplained"."""

    verdict: str
    lack_of_fit: Mapping[str, float | None]
    protocol: Mapping[str, Any]
    findings: tuple[Finding, ...] = ()
    rejected: tuple[Mapping[str, str], ...] = ()
    unexplained: tuple[Mapping[str, Any], ...] = ()
    next_experiment: str | None = None
    channels: tuple[Mapping[str, Any], ...] = ()
    notes: tuple[str, ...] = field(default=())

    def to_dict(self) -> dict[str, Any]:
        """The whole as the format has it; `channels` (what each balance said) and `notes` are additions."""
        return {
            "format": FORMAT,
            "verdict": self.verdict,
            "lack_of_fit": dict(self.lack_of_fit),
            "protocol": dict(self.protocol),
            "findings": [f.to_dict() for f in self.findings],
            "rejected": [dict(r) for r in self.rejected],
            "unexplained": [dict(u) for u in self.unexplained],
            "next_experiment": self.next_experiment,
            "channels": [dict(c) for c in self.channels],
            "notes": list(self.notes),
        }

    def to_json(self) -> str:
        """findings.json as text; numbers that are not finite become null."""
        return json.dumps(_plain(self.to_dict()), indent=1, allow_nan=False) + "\n"

    def save(self, folder: str | Path) -> Path:
        """Write `findings.json` into a folder (made if needed), whole or not at all; returns its path."""
        target = Path(folder) / FILES[0]
        with new_file(target) as staging:
            staging.write_text(self.to_json())
        return target


def rejection(effect: str, finger: str | None, reason: str) -> dict[str, str]:
    """What was considered at a finger (None: at none in particular) and is no finding, as it is told."""
    return {"effect": effect, "where": str(finger), "reason": reason}


def of_one_whole(
    found: Sequence[Finding], unexplained: Sequence[Mapping[str, Any]]
) -> tuple[tuple[Finding, ...], tuple[Mapping[str, Any], ...]]:
    """Findings and what is unexplained with shares of one mismatch, where those of several places together are more:
    each place counts alike."""
    whole = sum(f.where["share_of_mismatch"] for f in found) + sum(u["share_of_mismatch"] for u in unexplained)
    if whole <= 1:
        return tuple(found), tuple(unexplained)

    def part(place: Mapping[str, Any]) -> dict[str, Any]:
        return {**place, "share_of_mismatch": place["share_of_mismatch"] / whole}

    return tuple(replace(f, where=part(f.where)) for f in found), tuple(part(u) for u in unexplained)


def weighed(size: float, contrast: float) -> float:
    """What findings of different channels are ranked by: the geometric mean of what an effect adds over the noise of
    one reading (size) and over all that the channel tells (all root mean squares). By noise alone the best sensor would
    come first, by the signal alone the best motion.

    contrast: standard deviation of the channel's signal over that of its noise.
    """
    return size / math.sqrt(max(contrast, 1.0))


def _plain(value: Any) -> Any:
    """numpy scalars and arrays as Python numbers and lists, nan and infinities as None."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
