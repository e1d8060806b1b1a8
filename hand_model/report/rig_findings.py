"""The report of a rig's diagnosis: what is missing, where it shows, and what it is worth on recordings held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..output import new_file
from ..rig.findings import NOT_TAKEN, CouplingResidual, RigFindings
from ..rig.inverse import EffortResidual, effort_residuals
from ..rig.model import RigModel, load_rig
from ..rig.replay import simulate_trial
from ..session import Session
from .page import Cell, Element, Section, figures, key, listing, note, page, table
from .pictures import POINTS
from .style import INK, SERIES, drawing
from .words import count

Array = NDArray[np.float64]
CELLS = (28, 20)  # of a map, along position and velocity
BINS = 32
PICTURES = 8
BY_POSITION = frozenset(
    {
        "nonlinear_spring",
        "end_stop_contact",
        "detent_load",
        "torque_ripple",
        "gravity_load",
        "position_dependent_friction",
        "elastoplastic_hysteresis",
        "viscoelastic_spring",
    }
)
BY_TIME = frozenset({"thermal_friction_drift"})
Pair = tuple[EffortResidual, EffortResidual]


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
    pairs = [] if swing or findings.lack_of_fit.get("before") is None else _pairs(rig, findings)
    sections = [Section("findings", "What is missing", _conclusion(findings), tuple(_findings(findings)))]
    if pairs:
        sections += [_map(rig, pairs), _effects(rig, findings, pairs), _validation(rig, findings, pairs)]
    if swing:
        sections += _motion(rig, findings)
    if findings.couplings:
        sections.append(_couplings(findings.couplings))
    sections.append(
        Section(
            "next",
            "Next",
            (findings.next_experiment or "Nothing more is asked for.").replace("_", " "),
            _rest(findings),
        )
    )
    lead = (
        f"{session.path.name}: the declared model, fitted, against {count(len(rig.trials), 'trial')}; "
        "what is named below was chosen on the training trials and measured on the others, "
        "by MuJoCo on the written files."
    )
    return page(session.hand or session.path.name, lead, _tiles(findings), sections)


def _tiles(findings: RigFindings) -> list[tuple[str, str]]:
    lack, tiles = findings.lack_of_fit, [(findings.verdict, "verdict")]
    if lack.get("before"):
        tiles += [
            (f"{lack['after'] / lack['before']:.2f}", "held-out error, all effects over declared"),
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
    head = ("joint", "effect", "not told from", "probability", "held-out error before", "after", "unit")
    parts = (
        [table(head, rows, "By share of the mismatch; each was measured beside those found before it", text_columns=3)]
        if rows
        else []
    )
    return [*parts, listing([f.statement for f in findings.findings])] if rows else []


def _pairs(rig: RigModel, findings: RigFindings) -> list[Pair]:
    """Residuals of the declared and of the improved file, by joint and trial."""
    known = set(findings.lack_of_fit.get("joints", {}))
    sides = [effort_residuals(replace(rig, xml=xml)) for xml in (findings.declared_xml, findings.xml)]
    after = {(r.trial, r.joint): r for r in sides[1]}
    return [(r, after[r.trial, r.joint]) for r in sides[0] if r.joint in known and len(r.error) > 10]


def _map(rig: RigModel, pairs: Sequence[Pair]) -> Section:
    drawn = []
    for joint in list(dict.fromkeys(a.joint for a, _ in pairs))[:PICTURES]:
        mine = [p for p in pairs if p[0].joint == joint]
        q, v, before = (np.concatenate(x) for x in zip(*[_states(a) for a, _ in mine], strict=True))
        scale = f"± {_limit(before):.2g} {rig.effort_unit(joint)}"
        drawn.append((f"{joint}: declared model ({scale})", _cells(q, v, before, before, rig, joint)))
        improved = np.concatenate([b.error for _, b in mine])
        drawn.append((f"{joint}: with what was found", _cells(q, v, improved, before, rig, joint)))
    words = "Mean residual effort over position and velocity, all trials: what the declared model leaves has a shape."
    return Section(
        "map",
        "Map of the mismatch",
        words,
        (
            figures(*drawn),
            note(
                "Red: more effort recorded than simulated; blue: less. "
                "Both pictures of a joint share the scale in brackets."
            ),
        ),
    )


def _states(r: EffortResidual) -> tuple[Array, Array, Array]:
    """Position, velocity and residual of the moving samples (k,)."""
    row = r.row
    return row.position[:: row.step][row.moving], row.velocity[:: row.step][row.moving], r.error


def _limit(values: Array) -> float:
    """Colours saturate here."""
    return float(np.percentile(np.abs(values), 95)) or 1.0


def _cells(q: Array, v: Array, error: Array, scale: Array, rig: RigModel, joint: str) -> bytes:
    unit = rig.unit(joint)
    return _field(q, v, error, _limit(scale), f"position [{unit}]", f"velocity [{unit}/s]")


def _field(q: Array, v: Array, error: Array, limit: float, across: str, up: str) -> bytes:
    """Mean error in cells of q and v, red above and blue below, colours full at limit."""
    sides = [np.linspace(*np.percentile(x, [0.5, 99.5]), n + 1) for x, n in zip((q, v), CELLS, strict=True)]
    total, _, _ = np.histogram2d(q, v, sides, weights=error)
    seen, _, _ = np.histogram2d(q, v, sides)
    mean = np.where(seen > 0, total / np.maximum(seen, 1), np.nan)
    with drawing() as d:
        d.axes.pcolormesh(*sides, mean.T, cmap="RdBu_r", vmin=-limit, vmax=limit)
        d.axes.set_xlabel(across)
        d.axes.set_ylabel(up)
    return d.svg


def _effects(rig: RigModel, findings: RigFindings, pairs: Sequence[Pair]) -> Section:
    drawn = []
    acting: dict[tuple[str, str], list[str]] = {}  # joint and variable -> effects that act through it: one picture
    for f in (f for f in findings.findings if f.fit.get("metric") == "effort_rmse"):
        acting.setdefault((f.where["joint"], _variable(f.effect)), []).append(f.effect.replace("_", " "))
    for (joint, variable), effects in list(acting.items())[:PICTURES]:
        mine = [p for p in pairs if p[0].joint == joint]
        held = [p for p in mine if p[0].validate] or mine
        if held:
            drawn.append((f"{joint}: {', '.join(dict.fromkeys(effects))}", _through(joint, variable, held, rig)))
    words = "Residual effort on held-out trials against what each effect acts through, mean and middle 80 % in bins."
    body = (key(("c1", "declared model"), ("ink", "with what was found")), figures(*drawn)) if drawn else ()
    return Section("effects", "Effects through the data", words if drawn else "No effect to show.", body)


def _variable(effect: str) -> str:
    """What an effect acts through."""
    return (
        "position"
        if effect in BY_POSITION
        else "time"
        if effect in BY_TIME
        else "load"
        if effect == "load_dependent_friction"
        else "velocity"
    )


def _through(joint: str, variable: str, held: Sequence[Pair], rig: RigModel) -> bytes:
    """Residual before and after against the variable."""
    q, v, before = (np.concatenate(x) for x in zip(*[_states(a) for a, _ in held], strict=True))
    after = np.concatenate([b.error for _, b in held])
    time_s = np.concatenate([a.row.time_s[:: a.row.step][a.row.moving] for a, _ in held])
    load = np.concatenate([a.expected[a.row.moving] for a, _ in held])
    x, label = {
        "position": (q, f"position [{rig.unit(joint)}]"),
        "time": (time_s, "time [s]"),
        "load": (load * np.sign(v), f"declared effort along the motion [{rig.effort_unit(joint)}]"),
        "velocity": (v, f"velocity [{rig.unit(joint)}/s]"),
    }[variable]
    return _sides(x, label, before, after, f"residual [{rig.effort_unit(joint)}]")


def _sides(x: Array, label: str, before: Array, after: Array, up: str) -> bytes:
    """Residual before and after against x: mean and middle 80 % in bins."""
    with drawing() as d:
        for values, colour in ((before, SERIES[0]), (after, INK)):
            centre, low, mean, high = _binned(x, values)
            d.axes.fill_between(centre, low, high, color=colour, alpha=0.18, linewidth=0)
            d.axes.plot(centre, mean, color=colour)
        d.axes.set_xlabel(label)
        d.axes.set_ylabel(up)
    return d.svg


def _binned(x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """Centres of bins with as many samples each, or more where many share a value; tenth percentile, mean and ninetieth
    of y."""
    parts: list[Array] = []
    for part in (p for p in np.array_split(np.argsort(x), BINS) if len(p)):
        if parts and x[part].mean() - x[parts[-1]].mean() < 0.5 * np.ptp(x) / BINS:
            parts[-1] = np.concatenate([parts[-1], part])
        else:
            parts.append(part)
    low, high = (np.array([np.percentile(y[p], k) for p in parts]) for k in (10, 90))
    return np.array([x[p].mean() for p in parts]), low, np.array([y[p].mean() for p in parts]), high


def _validation(rig: RigModel, findings: RigFindings, pairs: Sequence[Pair]) -> Section:
    held = [p for p in pairs if p[0].validate] or list(pairs)
    rows = [
        [
            a.trial,
            a.joint,
            f"{_rms(a.error):.4g}",
            f"{_rms(b.error):.4g}",
            f"{_rms(b.error) / max(_rms(a.error), 1e-300):.2f}",
            rig.effort_unit(a.joint),
        ]
        for a, b in held
    ]
    drawn = []
    for a, b in list({a.joint: (a, b) for a, b in held}.values())[:PICTURES]:
        grid = a.row.time_s[:: a.row.step]
        keep = slice(None, None, max(1, len(grid) // POINTS))
        with drawing(height=3.3, panels=(2.2, 1)) as d:
            d.axes.plot(grid[keep], a.row.effort[keep], color=SERIES[1], linewidth=1.6)
            for side, colour in ((a, SERIES[0]), (b, INK)):
                d.axes.plot(grid[keep], side.expected[keep], color=colour, linewidth=0.9)
                left = np.full(len(grid), np.nan)  # at rest friction is unknown: no error there
                left[a.row.moving] = side.error
                d.panels[1].plot(grid[keep], left[keep], color=colour, linewidth=0.9)
            d.axes.set_ylabel(f"effort [{rig.effort_unit(a.joint)}]")
            d.panels[1].set_ylabel("left")
            d.panels[1].set_xlabel("time [s]")
        drawn.append((f"{a.trial}, {a.joint}", d.svg))
    head = ("trial", "joint", "declared", "with what was found", "ratio", "unit")
    words = (
        f"Effort by inverse dynamics of the two files on {count(len({a.trial for a, _ in held}), 'trial')} held out."
    )
    return Section(
        "validation",
        "Before and after",
        words,
        (
            table(head, rows, "Root mean square of the effort error, moving samples", text_columns=2),
            key(("c2", "recorded"), ("c1", "declared model"), ("ink", "with what was found")),
            figures(*drawn),
            *_open_loop(findings),
        ),
    )


def _open_loop(findings: RigFindings) -> list[Element]:
    """The same files simulated: position error over whole trials or over the horizon that a simulation carries."""
    told = findings.lack_of_fit.get("open_loop")
    if told is None:
        return []
    if "not_run" in told:
        return [note(f"Motion not simulated in open loop: {told['not_run']}.")]
    how = "over whole trials" if told["horizon_s"] == "whole" else f"over {told['horizon_s']:g} s from recorded states"
    rows = [
        [j, f"{p['before']:.4g}", f"{p['after']:.4g}", f"{p['after'] / max(p['before'], 1e-300):.2f}", p["unit"]]
        for j, p in told["joints"].items()
    ]
    head = ("joint", "declared", "with what was found", "ratio", "unit")
    return [
        table(head, rows, f"Root mean square position error, simulated by MuJoCo in open loop {how}", text_columns=1)
    ]


def _couplings(residuals: Sequence[CouplingResidual]) -> Section:
    """Angles against angles: map before and after, residual through the load (or the velocity), one recording in
    time."""
    drawn, rows = [], []
    for c in residuals:
        scale = f"± {_limit(c.before):.2g} {c.unit}"
        for words, values in ((f"declared polynomial ({scale})", c.before), ("with what was found", c.after)):
            drawn.append(
                (
                    f"{c.coupling}: {words}",
                    _field(c.position, c.velocity, values, _limit(c.before), "position upstream", "velocity upstream"),
                )
            )
        x, label = (c.velocity, "velocity upstream") if c.load is None else (c.load, "load [N m or N]")
        drawn.append((f"{c.coupling}: residual", _sides(x, label, c.before, c.after, f"residual [{c.unit}]")))
        one = c.trial == c.trial[0]
        keep = np.flatnonzero(one)[:: max(1, int(one.sum()) // POINTS)]
        with drawing() as d:
            d.axes.plot(c.time_s[keep], c.before[keep], color=SERIES[0], linewidth=1.0)
            d.axes.plot(c.time_s[keep], c.after[keep], color=INK, linewidth=1.0)
            d.axes.set_xlabel("time [s]")
            d.axes.set_ylabel(f"residual [{c.unit}]")
        drawn.append((f"{c.coupling}: {c.trial[0]}", d.svg))
        for name in dict.fromkeys(c.trial):
            mine = c.trial == name
            a, b = _rms(c.before[mine]), _rms(c.after[mine])
            rows.append([str(name), c.coupling, f"{a:.4g}", f"{b:.4g}", f"{b / max(a, 1e-300):.2f}", c.unit])
    words = (
        "What the angle of one encoder leaves of the next along the transmission, on the trials held out: "
        "lost motion turns over with the direction, stretch follows the load."
    )
    head = ("trial", "coupling", "declared polynomial", "with what was found", "ratio", "unit")
    return Section(
        "couplings",
        "Between the encoders",
        words,
        (
            key(("c1", "declared polynomial"), ("ink", "with what was found")),
            figures(*drawn),
            table(head, rows, "Root mean square of the angle error", text_columns=2),
        ),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _motion(rig: RigModel, findings: RigFindings) -> list[Section]:
    joint, drawn, rows = rig.joints[0], [], []
    states: list[Array] = []
    for trial in rig.select(True) or rig.trials:
        recorded = trial.position[joint]
        sides = [simulate_trial(replace(rig, xml=x), trial)[1][:, 0] for x in (findings.declared_xml, findings.xml)]
        errors = [_rms((s - recorded)[np.isfinite(recorded)]) for s in sides]
        rows.append([trial.name, *(f"{e:.4g}" for e in errors), f"{errors[1] / max(errors[0], 1e-300):.2f}"])
        good = np.isfinite(recorded)
        speed = np.gradient(recorded[good], trial.time_s[good])
        states.append(np.stack([recorded[good], speed, *((recorded - s)[good] for s in sides)]))
        keep = slice(None, None, max(1, len(recorded) // POINTS))
        with drawing() as d:
            d.axes.plot(trial.time_s[keep], recorded[keep], color=SERIES[1], linewidth=1.6)
            for values, colour in zip(sides, (SERIES[0], INK), strict=True):
                d.axes.plot(trial.time_s[keep], values[keep], color=colour, linewidth=0.9)
            d.axes.set_xlabel("time [s]")
            d.axes.set_ylabel(f"position [{rig.unit(joint)}]")
        drawn.append((trial.name, d.svg))
    q, v, before, after = np.concatenate(states, 1)
    scale = f"± {_limit(before):.2g} {rig.unit(joint)}"
    maps = figures(
        (f"declared model ({scale})", _cells(q, v, before, before, rig, joint)),
        (f"with what was found ({scale})", _cells(q, v, after, before, rig, joint)),
    )
    shape = Section(
        "map",
        "Map of the mismatch",
        "Mean position error of the simulation over recorded position and velocity, trials held out.",
        (maps, note("Red: recorded ahead of simulated; blue: behind.")),
    )
    words = "Motion simulated by MuJoCo in open loop over whole trials, from the recorded start."
    return [
        shape,
        Section(
            "validation",
            "Before and after",
            words,
            (
                table(
                    ("trial", "declared", "with what was found", "ratio"), rows, f"Position rmse [{rig.unit(joint)}]"
                ),
                key(("c2", "recorded"), ("c1", "declared model"), ("ink", "with what was found")),
                figures(*drawn[:PICTURES]),
            ),
        ),
    ]


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
    parts = [listing(said)] if said else []
    if withdrawn:
        parts += [note("Chosen on the training recordings, then withdrawn:"), listing(withdrawn)]
    return (*parts, *([note(f"Tried and not taken: {', '.join(tried)}.")] if tried else []))


__all__ = ["rig_findings_page", "write_rig_findings"]
