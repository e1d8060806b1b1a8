"""`report.html` of a diagnosis: verdict, ranked findings, residual maps before and after, the effects' curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..report.page import Cell, Section, figures, key, listing, note, page, table
from ..report.style import INK, MUTED, SERIES, drawing
from .findings import Finding, Findings

Array = NDArray[np.float64]

POINTS = 700
VERDICTS = {
    "consistent": "Nothing is missing: the declared model explains the recordings within their noise.",
    "mismatch": "Something is missing, and it is named below.",
    "unexplained": "Something is missing, but it is none of the known effects.",
}


def write_page(findings: Findings, stations: Sequence[Any], title: str, folder: Path) -> Path:
    """Write `report.html` into `folder`, whole or not at all; stations: those of the diagnosis, with their balances."""
    folder.mkdir(parents=True, exist_ok=True)
    target, sibling = folder / "report.html", folder / ".report.html.part"
    sibling.write_bytes(render(findings, stations, title))
    sibling.replace(target)
    return target


def render(findings: Findings, stations: Sequence[Any], title: str) -> bytes:
    """The page as UTF-8."""
    tiles = [(findings.verdict, "verdict"), (str(len(findings.findings)), "findings")]
    if "before" in findings.lack_of_fit:
        tiles += [(f"{findings.lack_of_fit[k]:.2f}", f"residual over noise variance, {k}") for k in ("before", "after")]
    sections = [Section("findings", "Findings", _lead(findings), tuple(_ranked(findings)))]
    drawn = [s for s in stations if s.missing or s.believed] or list(stations)
    for station in drawn:
        sections.append(_station(station, f"station-{len(sections)}"))
    sections.append(Section("channels", "Every channel", "p: probability of residuals as structured as these if nothing is missing.",
                            (_channels(findings),)))
    return page(f"Diagnosis of {title}", VERDICTS[findings.verdict], tiles, sections)


def _lead(findings: Findings) -> str:
    if findings.findings:
        return findings.findings[0].statement
    if findings.unexplained:
        return "; ".join(f"{u['where']['finger']} {u['where']['signal']}: {u['shape']}" for u in findings.unexplained) + "."
    return "No finding."


def _ranked(findings: Findings) -> list[Any]:
    if not findings.findings:
        return []
    rows = [[f.effect.replace("_", " "), str(f.where.get("finger") or "all"), f"{f.where.get('share_of_mismatch', 0):.0%}",
             f"{f.probability:.3f}", _number(f.fit.get("before")), _number(f.fit.get("after")),
             _number(f.fit.get("noise_floor")), str(f.fit.get("unit", "")), Cell(f.statement, "wrap")] for f in findings.findings]
    columns = ("effect", "finger", "share", "probability", "error before", "after", "noise", "unit", "statement")
    out = [table(columns, rows, text_columns=2), note("; ".join(sorted({_proof(f) for f in findings.findings})))]
    if findings.next_experiment:
        out.append(listing([f"Next experiment: {findings.next_experiment}."]))
    return out


def _proof(finding: Finding) -> str:
    kept = finding.fit.get("held_out") or []
    return f"{finding.effect.replace('_', ' ')}: {finding.fit.get('engine')}, {f'{len(kept)} recordings kept out' if kept else 'in-sample'}"


def _number(value: Any) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.4g}"


def _channels(findings: Findings) -> Any:
    rows = [[str(c["finger"]), str(c["joint"] or ""), str(c["signal"]), f"{c['p_before']:.2g}", f"{c['p_after']:.2g}",
             ", ".join(c["effects"]).replace("_", " ")] for c in findings.channels]
    return table(("finger", "joint", "signal", "p before", "p after", "named"), rows, text_columns=3)


def _station(station: Any, name: str) -> Section:
    naming = station.naming
    place = " ".join(x for x in (station.finger, station.joint, station.signal) if x)
    balance = naming.balance
    position, velocity = balance.gather(lambda s: s.position), balance.gather(lambda s: s.velocity)
    unit, effort = balance.states[0].position_unit, balance.states[0].effort_unit
    use = balance.steady
    drawn = [(f"{label}: residual, mean over strokes [{effort}]", _map(position[use], velocity[use], (balance.effort - f.prediction)[use],
              balance.sigma, unit, effort)) for label, f in (("declared model", naming.declared), ("with what was named", naming.fit))]
    if station.believed:
        drawn += [(f"{f.term.effect.name.replace('_', ' ')}: its part and what is left of the data", _curve(naming, f, unit, effort))
                  for f in station.kept[:3]]
    return Section(name, place, station.line() + ".",
                   (figures(*drawn), key(("c1", "position rises"), ("c2", "position falls"), ("muted", "noise of one sample"))))


def _map(position: Array, velocity: Array, residual: Array, sigma: float, unit: str, effort: str) -> bytes:
    """Mean residual over position, per direction, with the noise of one sample as a band."""
    with drawing() as d:
        edges = np.quantile(position, np.linspace(0, 1, 41))
        d.axes.axhspan(-sigma, sigma, color=MUTED, alpha=0.15, linewidth=0)
        d.axes.axhline(0, color=INK, linewidth=0.6)
        for colour, way in ((SERIES[0], velocity > 0), (SERIES[1], velocity <= 0)):
            cell = np.clip(np.searchsorted(edges, position[way], side="right") - 1, 0, 39)
            count = np.bincount(cell, minlength=40)
            mean = np.bincount(cell, residual[way], minlength=40) / np.maximum(count, 1)
            seen = count > 2
            d.axes.plot((0.5 * (edges[1:] + edges[:-1]))[seen], mean[seen], color=colour)
        d.axes.set_xlabel(f"position [{unit}]")
        d.axes.set_ylabel(f"residual [{effort}]")
    return d.svg


def _curve(naming: Any, named: Any, unit: str, effort: str) -> bytes:
    """The effect's own part over the variable in which it acts, through the residual of the rest of the model."""
    balance, fit = naming.balance, naming.fit
    rest = balance.fit(tuple(t for t in fit.terms if t is not named.term))
    use = np.flatnonzero(balance.steady)
    region = named.term.effect.region(balance.states, named.term.shape) or {}
    speed = "speed" in region or named.term.effect.name in ("quadratic_damping", "asymmetric_viscous_friction")
    at = balance.gather(lambda s: s.velocity if speed else s.position)
    shown = use[:: max(1, len(use) // POINTS)]
    way = balance.gather(lambda s: s.velocity) > 0
    part = fit.prediction - rest.prediction
    with drawing() as d:
        d.axes.plot(at[shown], (balance.effort - rest.prediction)[shown], ".", color=MUTED, markersize=2)
        for colour, mine in ((SERIES[0], way), (SERIES[1], ~way)):
            index = shown[mine[shown]]
            d.axes.plot(at[index], part[index], ".", color=colour, markersize=3)
        d.axes.set_xlabel(f"velocity [{unit}/s]" if speed else f"position [{unit}]")
        d.axes.set_ylabel(f"[{effort}]")
    return d.svg
