"""Findings of a rig: those of any session, and the rig's MJCF as it was fitted and as it was improved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..diagnose.findings import FILES, Finding, Findings
from ..output import new_file
from .model import Drive, RigModel

__all__ = ["CouplingResidual", "Finding", "Findings", "RigFindings"]
Array = NDArray[np.float64]
WITHIN = 0.5  # of a sample
NOT_TAKEN = "error on training recordings left out of the fit does not fall enough"
NOT_TOLD = "interval of its size holds zero"
NOT_BORNE_OUT = "error on validation recordings does not fall enough"


def whereabouts(
    joint: str | None, drive: Drive | None, signal: str, trials: Sequence[str], share: float
) -> dict[str, Any]:
    """Where a finding of a rig is; share: of the mismatch, squared [effort or position unit] until `shares` divides
    it."""
    return {
        "finger": None,
        "joint": joint,
        "actuator": drive.name if drive else None,
        "signal": signal,
        "marker": None,
        "trials": list(trials),
        "region": None,
        "share_of_mismatch": share,
    }


def within_a_sample(found: Sequence[Finding], sample_s: float) -> tuple[list[Finding], tuple[str, ...]]:
    """Findings without delays of less than half a sample [s], and what is said of those: it is how a log is read, which
    holds what was at some instant between two."""
    late_s = [f.parameters["delay"]["value"] if "delay" in f.parameters else np.inf for f in found]
    short = [abs(late) < WITHIN * sample_s for late in late_s]
    notes = tuple(
        f"{f.where['joint']}: efforts and angles are read {1e3 * late:.2g} ms apart, less than half a sample: it is "
        "taken into account, and no effect"
        for f, late, within in zip(found, late_s, short, strict=True)
        if within
    )
    return [f for f, within in zip(found, short, strict=True) if not within], notes


def measured(rig: RigModel, proof: Mapping[str, Any]) -> list[str]:
    """Names of the recordings that a proof was measured on: those held out, where there are any."""
    return list(proof["held_out"]) or [t.name for t in rig.select(False)]


@dataclass(frozen=True)
class CouplingResidual:
    """What one angle leaves of another on the recordings held out: samples (n,) of the independent joint's position and
    velocity, of the load that a named stretch acts through (None: none is named), of the residual before and after.

    trial (n,): which recording each sample belongs to; time_s (n,) [s]; unit: of the residual.
    """

    coupling: str
    dependent: str
    unit: str
    trial: NDArray[np.str_]
    time_s: Array
    position: Array
    velocity: Array
    load: Array | None
    before: Array
    after: Array


@dataclass(frozen=True)
class RigFindings(Findings):
    """What a rig's diagnosis says. session: its name; declared: fitted declared parameters; declared_xml, xml: the MJCF
    with those, and with the effects that were found as well; couplings: angle residuals, for pictures."""

    session: str = ""
    declared: Mapping[str, float] = field(default_factory=dict)
    xml: bytes = field(default=b"", repr=False)
    declared_xml: bytes = field(default=b"", repr=False)
    couplings: tuple[CouplingResidual, ...] = field(default=(), repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The whole as the format has it, with the session's name and the declared parameters."""
        return {**super().to_dict(), "session": self.session, "declared": dict(self.declared)}

    def write(self, folder: str | Path, model: bool = True) -> None:
        """Write findings.json and, with `model`, rig.xml (improved) and rig_declared.xml (fitted, nothing added), each
        whole or not at all; without, those of an earlier run go.
        """
        path = Path(folder)
        earlier = (path / FILES[0]).is_file()
        for name, content in (("rig.xml", self.xml), ("rig_declared.xml", self.declared_xml)):
            if content and model:
                with new_file(path / name) as staging:
                    staging.write_bytes(content)
            elif earlier:
                (path / name).unlink(missing_ok=True)
        self.save(path)
