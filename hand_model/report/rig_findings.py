"""The report of a rig's diagnosis: what is missing, where it shows, and what it is worth on recordings held out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..output import new_file
from ..rig.findings import NOT_TAKEN, RigFindings
from ..rig.model import load_rig
from ..rig.words import told_on
from ..session import Session
from .page import Cell, Element, Section, listing, note, page, table
from .rig_couplings import couplings_section
from .rig_effort import effects_section, effort_pairs, mismatch_map, validation_section
from .rig_motion import motion_sections
from .words import count

Array = NDArray[np.float64]


def write_rig_findings(session: Session, findings: RigFindings, folder: str | Path) -> Path:
    """Write `report.html` beside the findings, whole or not at all; returns its path."""
    target = Path(folder) / "report.html"
    with new_file(target) as staging:
        staging.write_bytes(rig_findings_page(session, findings))
    return target


def rig_findings_page(session: Session, findings: RigFindings) -> bytes:
    """The page as bytes."""
    rig = load_rig(session)
    swing = findings.lack_of_fit.get("metric") == "position_rmse"
    pairs = [] if swing or findings.lack_of_fit.get("before") is None else effort_pairs(rig, findings)
    sections = [Section("findings", "What is missing", _conclusion(findings), tuple(_findings(findings)))]
    if pairs:
        sections += [
            mismatch_map(rig, pairs),
            effects_section(rig, findings, pairs),
            validation_section(rig, findings, pairs),
        ]
    if swing:
        sections += motion_sections(rig, findings)
    if findings.couplings:
        sections.append(couplings_section(findings.couplings))
    sections.append(
        Section(
            "next",
            "Next",
            (findings.next_experiment or "Nothing more is asked for.").replace("_", " "),
            _rest(findings),
        )
    )
    measured_on = "the others" if rig.select(True) else "the same: none was held out"
    lead = (
        f"{session.path.name}: the declared model, fitted, against {count(len(rig.trials), 'trial')}; "
        f"what is named below was chosen on the training trials and measured on {measured_on}, "
        "by MuJoCo on the written files."
    )
    return page(session.hand or session.path.name, lead, _tiles(findings), sections)


def _tiles(findings: RigFindings) -> list[tuple[str, str]]:
    lack, tiles = findings.lack_of_fit, [(findings.verdict, "verdict")]
    error = told_on("error", findings.protocol["held_out"])
    if lack.get("before"):
        tiles += [
            (f"{lack['after'] / lack['before']:.2f}", f"{error}, all effects over declared"),
            (f"{lack['one_effect'] / lack['before']:.2f}", "with the first effect alone"),
        ]
    return tiles


def _conclusion(findings: RigFindings) -> str:
    if findings.lack_of_fit.get("before") is None:
        return "No effort channel can be trusted: nothing is fitted, and nothing is claimed."
    named = [f for f in findings.findings if f.model is not None]
    if not named:
        return "No effect known here lowers the error on the recordings held out."
    names = ", ".join(dict.fromkeys(f.effect.replace("_", " ") for f in named))
    return f"{count(len(named), 'departure')} from the declared model: {names}."


def _findings(findings: RigFindings) -> list[Element]:
    rows = []
    for f in findings.findings:
        known = f.fit["before"] is not None
        rows.append(
            [
                f.where.get("joint") or "",
                f.effect.replace("_", " "),
                Cell(", ".join(m.replace("_", " ") for m in f.members if m != f.effect) or "–", "wrap"),
                f"{f.probability:.2f}",
                f"{f.fit['before']:.4g}" if known else "–",
                f"{f.fit['after']:.4g}" if known else "–",
                f.fit.get("unit") or "",
            ]
        )
    head = ("joint", "effect", "not told from", "probability", "error before", "after", "unit")
    parts = (
        [table(head, rows, "By share of the mismatch; each was measured beside those found before it", text_columns=3)]
        if rows
        else []
    )
    return [*parts, listing([f.statement for f in findings.findings])] if rows else []


def _tried(rejected: Mapping[str, str]) -> str:
    """Effect and variant in words."""
    variant = rejected.get("variant")
    return rejected["effect"].replace("_", " ") + (f" ({variant})" if variant else "")


def _rest(findings: RigFindings) -> tuple[Element, ...]:
    said = [
        f"{u['where']['joint'] or 'the joint'}: {100 * u['share_of_mismatch']:.0f} % of the mismatch stays unexplained."
        for u in findings.unexplained
    ]
    withdrawn = [
        f"{_tried(r)}{' at ' + r['where'] if 'where' in r else ''}: {r['reason']}."
        for r in findings.rejected
        if r["reason"] != NOT_TAKEN
    ]
    tried = sorted({_tried(r) for r in findings.rejected if r["reason"] == NOT_TAKEN})
    said += [f"{n[:1].upper()}{n[1:]}." for n in findings.notes]
    parts = [listing(said)] if said else []
    if withdrawn:
        parts += [note("Chosen on the training recordings, then withdrawn:"), listing(withdrawn)]
    return (*parts, *([note(f"Tried and not taken: {', '.join(tried)}.")] if tried else []))


__all__ = ["rig_findings_page", "write_rig_findings"]
