"""`report.html` of a diagnosis: verdict, ranked findings, the replay before and after, residual maps, the effects'
curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..output import new_file
from ..report.page import Cell, Section, figures, key, listing, note, page, table
from ..report.style import INK, MUTED, SERIES, drawing
from .findings import FILES, Finding, Findings
from .name.term import DISCRETE
from .prove.replays import Replay

Array = NDArray[np.float64]

POINTS = 700
CELLS = 40
BY_SPEED = ("quadratic_damping", "asymmetric_viscous_friction")
BY_TIME = ("clock_drift", "thermal_friction_drift")
VERDICTS = {
    "consistent": "Nothing is missing: the declared model explains the recordings within their noise.",
    "mismatch": "Something is missing, and it is named below.",
    "unexplained": "Something is missing, but it is none of the known effects.",
}


def write_page(
    findings: Findings, stations: Sequence[Any], replays: Sequence[Replay], title: str, folder: Path
) -> Path:
    """Write `report.html` into `folder`, whole or not at all; stations: those of the diagnosis, with their balances.
    replays: of the compiled files, before and after."""
    target = folder / FILES[1]
    with new_file(target) as staging:
        staging.write_bytes(render(findings, stations, replays, title))
    return target


def render(findings: Findings, stations: Sequence[Any], replays: Sequence[Replay], title: str) -> bytes:
    """The page as UTF-8."""
    count = len(findings.findings)
    tiles = [(findings.verdict, "verdict"), (str(count), "finding" if count == 1 else "findings")]
    if findings.channels and "before" in findings.lack_of_fit:  # without a channel nothing was balanced
        tiles += [(f"{findings.lack_of_fit[k]:.2f}", f"residual over noise variance, {k}") for k in ("before", "after")]
    sections = [Section("findings", "Findings", _lead(findings), tuple(_ranked(findings)))]
    sections += [_replayed(replay, f"replay-{i}") for i, replay in enumerate(replays)]
    shapes = {_where(u["where"]): u["shape"] for u in findings.unexplained}
    places = [_where(vars(s)) for s in stations]
    apart = [s.missing or s.believed or p in shapes for s, p in zip(stations, places, strict=True)]
    told = {_where(channel) for channel in findings.channels if channel["effects"]}
    sections += [
        _station(s, f"station-{i}", shapes.get(p, ""), s.believed or p in told)
        for i, (s, p, own) in enumerate(zip(stations, places, apart, strict=True))
        if own
    ]
    calm = [s for s, own in zip(stations, apart, strict=True) if not own]
    if calm:
        sections.append(
            Section(
                "consistent",
                "Consistent channels",
                "Nothing is missing here; residual of the declared model, mean over strokes.",
                (figures(*(_first_map(s) for s in calm)), _key()),
            )
        )
    if findings.channels:
        sections.append(
            Section(
                "channels",
                "Every channel",
                "p: probability of residuals as structured as these if nothing is missing.",
                (_channels(findings),),
            )
        )
    return page(f"Diagnosis of {title}", VERDICTS[findings.verdict], tiles, sections)


def _lead(findings: Findings) -> str:
    if findings.findings:
        return findings.findings[0].statement
    if findings.unexplained:
        return "; ".join(f"{_place(u['where'])}: {u['shape']}" for u in findings.unexplained) + "."
    return "No finding."


def _ranked(findings: Findings) -> list[Any]:
    if not findings.findings:
        return [listing(list(findings.notes))] if findings.notes else []
    rows = []
    for f in findings.findings:
        unit, scale = _unit(f.fit.get("unit"))
        place, share = (
            str(f.where.get("finger") or f.where.get("actuator") or "all"),
            f"{f.where.get('share_of_mismatch', 0):.0%}",
        )
        rows.append(
            [
                _words(f.effect),
                place,
                unit,
                share,
                f"{f.probability:.3f}",
                *(_number(f.fit.get(k), scale) for k in ("before", "after", "noise_floor")),
                _interval(f.fit.get("ci95_reduction"), scale),
            ]
        )
    columns = (
        "effect",
        "finger",
        "unit",
        "share",
        "probability",
        "error before",
        "after",
        "noise",
        "95 % of the reduction",
    )
    out = [table(columns, rows, text_columns=3), note("; ".join(sorted({_proof(f) for f in findings.findings})) + ".")]
    held = []
    sized = ((f.effect, *item) for f in findings.findings for item in f.parameters.items() if item[0] not in DISCRETE)
    for effect, name, value in sized:
        unit, scale = _unit(value.get("unit"))
        held.append(
            [_words(effect), str(name), unit, _number(value["value"], scale), _interval(value.get("ci95"), scale)]
        )
    if held:
        out.append(table(("of", "parameter", "unit", "value", "95 % interval"), held, text_columns=3))
    out.append(
        table(
            ("effect", "where it is put right"),
            [[_words(f.effect), Cell(_kept(f), "wrap")] for f in findings.findings],
            text_columns=2,
        )
    )
    said = [f.statement for f in findings.findings[1:]]  # the first one leads
    more = [
        f"Not told apart from {', '.join(_words(m) for m in f.members if m != f.effect)}: {_words(f.effect)}."
        for f in findings.findings
        if len(f.members) > 1
    ]
    more += [f"Next experiment: {findings.next_experiment}."] if findings.next_experiment else []
    more += [f"Unexplained: {_place(u['where'])}, {u['shape']}." for u in findings.unexplained]
    out = [listing(said), *out] if said else out
    return [*out, listing([*more, *findings.notes])] if more or findings.notes else out


def _kept(finding: Finding) -> str:
    """Where a finding is written, in words."""
    if finding.correction is not None:
        copied = finding.effect != "command_as_measurement"
        return f"in the corrected copy of the session: {finding.correction}" if copied else finding.correction
    model = finding.model or {}
    if model.get("mjcf"):
        return f"in the MJCF, {model['mjcf']}; URDF: {model['urdf']}"
    if model.get("callback"):
        return f"by the passive-force callback, {model['callback']}; URDF: {model['urdf']}"
    return str(model.get("note") or "in no file")


def _proof(finding: Finding) -> str:
    kept = finding.fit.get("held_out") or []
    engine = str(finding.fit.get("engine") or "no replay")
    told = [
        engine,
        f"{len(kept)} recording{'s' if len(kept) > 1 else ''} kept out" if kept else "in-sample",
        str(finding.fit.get("note") or ""),
    ]
    return f"{_words(finding.effect)}: {', '.join(t for i, t in enumerate(told) if t and not (i and t in engine))}"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _unit(unit: Any) -> tuple[str, float]:
    """A unit as it is read, and the factor to it: markers move by millimetres."""
    return ("mm", 1e3) if unit == "m" else (str(unit or ""), 1.0)


def _number(value: Any, scale: float = 1.0) -> str:
    return "" if value is None or not np.isfinite(value) else f"{scale * value:.4g}"


def _interval(value: Any, scale: float = 1.0) -> str:
    return "" if value is None else f"{scale * value[0]:.4g} to {scale * value[1]:.4g}"


def _channels(findings: Findings) -> Any:
    rows = [
        [
            str(c["finger"] or ""),
            str(c["joint"] or ""),
            str(c["signal"]),
            ", ".join(c["effects"]).replace("_", " "),
            f"{c['p_before']:.2g}",
            f"{c['p_after']:.2g}",
        ]
        for c in findings.channels
    ]
    return table(("finger", "joint", "signal", "named", "p before", "p after"), rows, text_columns=4)


def _key() -> Any:
    """What the colours mean; made anew for each section, for an element stands in one place only."""
    return key(("c1", "position rises"), ("c2", "position falls"), ("muted", "noise of one sample"))


def _replayed(replay: Replay, name: str) -> Section:
    """The compiled files' residual map before and after, on recordings that took no part."""
    fit = replay.finding.fit
    place = _place({**replay.finding.where, "signal": None})
    at, axis = _axis(
        replay.finding.effect,
        replay.finding.where.get("region"),
        replay.position,
        replay.velocity,
        replay.position_unit,
    )
    largest = _largest(at, replay.velocity, replay.before)
    drawn = [
        (f"{label} [{replay.unit}]", _map(at, replay.velocity, residual, replay.noise, axis, replay.unit, largest))
        for label, residual in (
            ("model as it was: recorded minus replayed", replay.before),
            ("model with its effects", replay.after),
        )
    ]
    said = (
        f"{_words(replay.finding.effect)}, {place}: {fit['before']:.4g} to {fit['after']:.4g} {replay.unit}, noise {fit['noise_floor']:.4g}, "
        f"replayed by MuJoCo on {', '.join(replay.trials)}."
    )
    return Section(name, f"Replay: {place} {_words(replay.finding.effect)}", said, (figures(*drawn), _key()))


def _maps(station: Any) -> tuple[Array, Array, list[Array], float, str, str]:
    """Steady samples of a station: position, velocity, residuals of the declared and of the final model, noise,
    units."""
    balance = station.naming.balance
    use = balance.steady
    residuals = [(balance.effort - f.prediction)[use] for f in (station.naming.declared, station.naming.fit)]
    return (
        balance.gather(lambda s: s.position)[use],
        balance.gather(lambda s: s.velocity)[use],
        residuals,
        balance.sigma,
        balance.states[0].position_unit,
        balance.states[0].effort_unit,
    )


def _place(where: Mapping[str, Any]) -> str:
    """Finger (or its motor), joint and signal, as far as they are known."""
    return " ".join(
        str(x) for x in (where.get("finger") or where.get("actuator"), where.get("joint"), where.get("signal")) if x
    )


def _first_map(station: Any) -> tuple[str, bytes]:
    position, velocity, residuals, sigma, unit, effort = _maps(station)
    return f"{_place(vars(station))} [{effort}]", _map(
        position, velocity, residuals[0], sigma, f"position [{unit}]", effort
    )


def _where(where: Mapping[str, Any]) -> tuple[Any, ...]:
    """Where a station is, or an entry of what is unexplained."""
    return tuple(where.get(k) for k in ("finger", "joint", "signal"))


def _station(station: Any, name: str, unexplained: str, told: bool) -> Section:
    """unexplained: what it varies with, "" where nothing is; told: whether its names stand."""
    position, velocity, residuals, sigma, unit, effort = _maps(station)
    stands = (*station.kept, *station.outsiders) if told else ()
    first = stands[0].term if stands else None
    at, axis = (
        (position, f"position [{unit}]")
        if first is None
        else _axis(
            first.effect.name, first.effect.region(station.naming.balance.states, first.shape), position, velocity, unit
        )
    )
    largest = _largest(at, velocity, residuals[0])
    drawn = [
        (f"{label} [{effort}]", _map(at, velocity, residual, sigma, axis, effort, largest))
        for label, residual in zip(("declared model, fitted: residual", "with what was named"), residuals, strict=True)
    ]
    drawn += [
        (
            f"{_words(f.term.effect.name)}: its part through the data less the rest [{effort}]",
            _curve(station.naming, f, unit, effort),
        )
        for f in stands[:3]
    ]
    said = (
        f"{_place(vars(station))}: unexplained, {unexplained}"
        if unexplained and not station.missing
        else station.line(told).replace("_", " ")
    )
    return Section(name, _place(vars(station)), said + ".", (figures(*drawn), _key()))


def _axis(
    effect: str, region: Mapping[str, Any] | None, position: Array, velocity: Array, unit: str
) -> tuple[Array, str]:
    """Over what (n,) an effect shows best, speed or position, and its name."""
    if "speed" in (region or {}) or effect in BY_SPEED:
        return np.abs(velocity), f"speed [{unit}/s]"
    return position, f"position [{unit}]"


def _largest(at: Array, velocity: Array, residual: Array) -> float:
    """Largest mean residual of the map's cells: both maps of a pair are drawn to it."""
    return max((float(np.nanmax(np.abs(m))) for _, m in _means(at, velocity, residual)), default=0.0)


def _means(at: Array, velocity: Array, residual: Array) -> list[tuple[Array, Array]]:
    """Middle and mean residual (k,) of cells along `at` (n,), for rising and for falling positions."""
    edges = _edges(at)
    cells = len(edges) - 1
    out = []
    for way in (velocity > 0, velocity <= 0):
        cell = np.clip(np.searchsorted(edges, at[way], side="right") - 1, 0, cells - 1)
        count = np.bincount(cell, minlength=cells)
        mean = np.bincount(cell, residual[way], minlength=cells) / np.maximum(count, 1)
        seen = count > 2
        out.append(((0.5 * (edges[1:] + edges[:-1]))[seen], mean[seen]))
    return [o for o in out if len(o[0])]


def _edges(at: Array) -> Array:
    """Edges (k,) of cells of equal occupation, or wider where many samples share a value: moves at one speed are one
    cell, not a zigzag."""
    quantiles = np.quantile(at, np.linspace(0, 1, CELLS + 1))
    least = 0.5 * (quantiles[-1] - quantiles[0]) / CELLS
    edges = [quantiles[0]]
    for edge in quantiles[1:]:
        if edge - edges[-1] >= least:
            edges.append(edge)
    return np.array([*edges[: max(len(edges) - 1, 1)], quantiles[-1]])


def _map(
    at: Array, velocity: Array, residual: Array, sigma: float, axis: str, effort: str, largest: float = 0.0
) -> bytes:
    """Mean residual over position or speed (n,), whose name is `axis`, per direction, with the noise of one sample as a
    band."""
    with drawing() as d:
        d.axes.axhspan(-sigma, sigma, color=MUTED, alpha=0.15, linewidth=0)
        d.axes.axhline(0, color=INK, linewidth=0.6)
        for colour, (middle, mean) in zip(SERIES, _means(at, velocity, residual), strict=False):
            d.axes.plot(middle, mean, color=colour)
        if largest:
            span = 1.08 * max(largest, sigma)
            d.axes.set_ylim(-span, span)
        d.axes.set_xlabel(axis)
        d.axes.set_ylabel(f"residual [{effort}]")
    return d.svg


def _curve(naming: Any, named: Any, unit: str, effort: str) -> bytes:
    """The effect's own part over the variable in which it acts, through the residual of the rest of the model."""
    balance, fit = naming.balance, naming.fit
    rest = balance.fit(tuple(t for t in fit.terms if t is not named.term))
    use = np.flatnonzero(balance.steady)
    at, axis = _along(balance, named.term, unit)
    shown = use[:: max(1, len(use) // POINTS)]
    way = balance.gather(lambda s: s.velocity) > 0
    part = fit.prediction - rest.prediction
    with drawing() as d:
        d.axes.plot(at[shown], (balance.effort - rest.prediction)[shown], ".", color=MUTED, markersize=2)
        for colour, mine in ((SERIES[0], way), (SERIES[1], ~way)):
            index = shown[mine[shown]]
            d.axes.plot(at[index], part[index], ".", color=colour, markersize=3)
        d.axes.set_xlabel(axis)
        d.axes.set_ylabel(f"[{effort}]")
    return d.svg


def _along(balance: Any, term: Any, unit: str) -> tuple[Array, str]:
    """The variable (n,) in which an effect acts, with its sign, and its name."""
    if term.effect.name in BY_TIME:
        return balance.gather(lambda s: s.elapsed_s), "time [s]"
    if "speed" in (term.effect.region(balance.states, term.shape) or {}) or term.effect.name in BY_SPEED:
        return balance.gather(lambda s: s.velocity), f"velocity [{unit}/s]"
    return balance.gather(lambda s: s.position), f"position [{unit}]"
