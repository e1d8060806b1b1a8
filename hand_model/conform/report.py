"""What a comparison of two descriptions says: findings, tables, text for a terminal, JSON."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

CAUSES = {
    "joints_exchanged": "joints stand under each other's names",
    "sign_flipped": "a joint turns the other way",
    "offset_dropped": "the zeros of a joint differ (an MJCF `ref`, or a turned origin, that the other file lost)",
    "equality_reversed": "joint1 and joint2 of a coupling are the wrong way round",
    "numbers_rounded": "one file's numbers are those of the other with fewer digits",
    "axis_shifted": "a joint's axis lies elsewhere",
    "axis_tilted": "a joint's axis points elsewhere",
    "link_displaced": "the links beyond a joint, or a fixed point, sit elsewhere along or around it",
    "linear_mimic": "a straight line stands for a linkage that is none",
    "mimic_chain": "a mimic follows a joint that is a mimic itself",
    "coupling_missing": "one file ties two joints, the other leaves them free",
    "coupling_differs": "the two files tie joints by different laws",
    "limits_shifted": "limits have moved on to the next joint",
    "limits_exchanged": "two joints have each other's limits",
    "limits_degrees": "limits in degrees where radians are read, or the reverse",
    "limits_mirrored": "limits with both signs turned over",
    "limits_differ": "limits differ",
    "missing_joint": "a joint has no partner",
    "joint_type": "a hinge stands against a slide",
    "mirrored": "one description is the mirror image of the other (left and right)",
    "unexplained": "something remains that no cause here explains",
}
"""Every cause that a finding can name, and what it means."""


@dataclass(frozen=True)
class Finding:
    """One disagreement or note. cause: a key of CAUSES. layer: 1 names, limits, relations; 2 frames; 3 points and axes.

    where: joints or links, as named in a. figures: name with unit -> number. disagrees: it decides the verdict.
    """

    cause: str
    layer: int
    where: tuple[str, ...]
    text: str
    figures: Mapping[str, float] = field(default_factory=dict)
    disagrees: bool = True


@dataclass(frozen=True)
class JointRow:
    """A joint pair. angle_deg, shift_mm: between the two axes, seen from the link before. a = sign * b - offset."""

    a: str
    b: str
    paired_by: str
    angle_deg: float
    shift_mm: float
    sign: int
    offset_deg: float
    limits_a: tuple[float, float] | None
    limits_b: tuple[float, float] | None


@dataclass(frozen=True)
class LinkRow:
    """A link pair. frame_*: the constant transform from the link's frame in a to that of `frame_of` in b (a convention,
    estimated after exchanges and offsets are taken out, never used to pass).

    raw_*: largest difference over the poses as the files are written, modulo the base; rest_*: what is not constant of
    it.
    """

    a: str
    b: str
    frame_of: str
    frame_mm: tuple[float, float, float]
    frame_deg: float
    raw_mm: float
    raw_deg: float
    rest_mm: float
    rest_deg: float


@dataclass(frozen=True)
class ConformReport:
    """The comparison of description a with description b; `ok` is the verdict, `findings` the reasons."""

    a: str
    b: str
    ok: bool
    findings: tuple[Finding, ...]
    joints: tuple[JointRow, ...]
    links: tuple[LinkRow, ...]
    base: tuple[str, str]
    base_mm: tuple[float, float, float]
    base_deg: float
    paired_by: str
    unpaired: tuple[tuple[str, ...], tuple[str, ...]]
    poses: int
    evaluated_by: str
    explained_mm: float
    seconds: float
    warnings: tuple[str, ...] = ()

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes of the disagreements, each once, in the order of the findings."""
        return tuple(dict.fromkeys(f.cause for f in self.findings if f.disagrees))

    def __bool__(self) -> bool:
        return self.ok

    def to_json(self) -> str:
        """The whole report as JSON."""
        return json.dumps(_plain(dataclasses.asdict(self)), indent=1, allow_nan=False) + "\n"

    def text(self) -> str:
        """The report for a terminal."""
        out = [f"{'AGREE' if self.ok else 'DISAGREE'}  a = {self.a}", f"{'' if self.ok else '   '}       b = {self.b}"]
        out += ["", f"Pairing ({self.paired_by}); base {self.base[0]} = {self.base[1]}"]
        out += ["", "1  Names, limits, relations", *self._findings(1)]
        out += [
            "",
            "2  Frame conventions (estimated and shown, never used to pass)",
            *self._frames(),
            *self._findings(2),
        ]
        out += ["", "3  Axes and points", *self._axes(), *self._findings(3)]
        out += ["", f"{self.poses} random poses, evaluated by {self.evaluated_by}, in {self.seconds:.2f} s"]
        if not self.ok and any(f.layer == 3 and f.disagrees for f in self.findings):
            out.append(
                f"With exchanges, signs and offsets undone, {_mm(self.explained_mm)} remain at the farthest link."
            )
        out += [f"warning: {w}" for w in self.warnings]
        return "\n".join(out) + "\n"

    def _findings(self, layer: int) -> list[str]:
        rows = [f for f in self.findings if f.layer == layer]
        return [f"   {'x' if f.disagrees else '-'} {f.cause}: {f.text}" for f in rows] or ["   nothing differs"] * (
            layer != 2
        )

    def _frames(self) -> list[str]:
        turned = [r for r in self.links if r.frame_deg > 1e-3 or np.linalg.norm(r.frame_mm) > 1e-3]
        shift = ", ".join(f"{v:.4g}" for v in self.base_mm)
        out = [
            f"   base: {self.base_deg:.4g} deg, ({shift}) mm"
            if self.base_deg or any(self.base_mm)
            else "   base: the same frame"
        ]
        if not turned:
            return [*out, "   links: the same frames"]
        for r in turned:
            out.append(
                f"   {_names(r.a, r.frame_of)}: {r.frame_deg:.4g} deg, ({', '.join(f'{v:.4g}' for v in r.frame_mm)}) mm"
            )
        return out

    def _axes(self) -> list[str]:
        width = max(len(_names(j.a, j.b)) for j in self.joints)
        out = [
            f"   {'joint':{width}}  {'paired by':9} {'angle/deg':>10} {'shift/mm':>10} {'sign':>4} {'offset/deg':>10}"
        ]
        for j in self.joints:
            numbers = f"{_small(j.angle_deg):>10} {_small(j.shift_mm):>10} {j.sign:+4d} {_small(j.offset_deg):>10}"
            out.append(f"   {_names(j.a, j.b):{width}}  {j.paired_by:9} {numbers}")
        far = sorted(self.links, key=lambda r: -r.raw_mm)[:5]
        if far and far[0].raw_mm > 1e-7:
            out.append("   largest differences at the links, as written | after one constant transform:")
            for r in far:
                out.append(
                    f"   {_names(r.a, r.b)}: {_mm(r.raw_mm)}, {r.raw_deg:.4g} deg | {_mm(r.rest_mm)}, "
                    f"{r.rest_deg:.4g} deg"
                )
        return out


def _names(a: str, b: str) -> str:
    return a if a == b else f"{a} = {b}"


def _small(value: float) -> str:
    return "0" if abs(value) < 1e-9 else f"{value:.4g}"


def _mm(value: float) -> str:
    return f"{value:.3g} mm"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
