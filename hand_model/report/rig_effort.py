"""The part of a rig's report that shows efforts: declared and improved model by inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..rig.findings import Finding, RigFindings
from ..rig.inverse import EffortResidual, effort_residuals
from ..rig.model import RigModel
from .page import Element, Section, figures, key, note, table
from .pictures import POINTS
from .residual_pictures import PICTURES, before_and_after, error_by_state, full_colour, rms
from .style import INK, SERIES, drawing
from .words import count

Array = NDArray[np.float64]

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
MOST_WAVES = 8  # that are seen in a picture of a joint's range
Pair = tuple[EffortResidual, EffortResidual]


def effort_pairs(rig: RigModel, findings: RigFindings) -> list[Pair]:
    """Residuals of the declared and of the improved file, by joint and trial."""
    known = set(findings.lack_of_fit.get("joints", {}))
    sides = [effort_residuals(replace(rig, xml=xml)) for xml in (findings.declared_xml, findings.xml)]
    after = {(r.trial, r.joint): r for r in sides[1]}
    return [(r, after[r.trial, r.joint]) for r in sides[0] if r.joint in known and len(r.error) > 10]


def mismatch_map(rig: RigModel, pairs: Sequence[Pair]) -> Section:
    """What the declared model leaves, over position and velocity of each joint, before and after."""
    drawn = []
    for joint in list(dict.fromkeys(a.joint for a, _ in pairs))[:PICTURES]:
        mine = [p for p in pairs if p[0].joint == joint]
        q, v, before = (np.concatenate(x) for x in zip(*[_states(a) for a, _ in mine], strict=True))
        scale = f"± {full_colour(before):.2g} {rig.effort_unit(joint)}"
        drawn.append((f"{joint}: declared model ({scale})", error_by_state(q, v, before, before, rig, joint)))
        improved = np.concatenate([b.error for _, b in mine])
        drawn.append((f"{joint}: with what was found", error_by_state(q, v, improved, before, rig, joint)))
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


def effects_section(rig: RigModel, findings: RigFindings, pairs: Sequence[Pair]) -> Section:
    """The residual against what each effect acts through, before and after."""
    drawn = []
    # joint, variable and period -> effects that act through it: one picture
    acting: dict[tuple[str, str, float], list[str]] = {}
    for f in (f for f in findings.findings if f.fit.get("metric") == "effort_rmse"):
        place = f.where["joint"], _variable(f.effect), _turn(f, pairs)
        acting.setdefault(place, []).append(f.effect.replace("_", " "))
    for (joint, variable, turn), effects in list(acting.items())[:PICTURES]:
        mine = [p for p in pairs if p[0].joint == joint]
        held = [p for p in mine if p[0].validate] or mine
        if held:
            drawn.append((f"{joint}: {', '.join(dict.fromkeys(effects))}", _through(joint, variable, turn, held, rig)))
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


def _turn(finding: Finding, pairs: Sequence[Pair]) -> float:
    """The period [position unit] of what comes so often over a joint's range that a picture of the range shows none of
    it; zero else."""
    period = finding.parameters.get("period", {}).get("value") or 0.0
    span = max((float(np.ptp(a.row.position)) for a, _ in pairs if a.joint == finding.where["joint"]), default=0.0)
    return float(period) if period * MOST_WAVES < span else 0.0


def _through(joint: str, variable: str, turn: float, held: Sequence[Pair], rig: RigModel) -> bytes:
    """Residual before and after against the variable; against where in its turn a position is, where there is one."""
    q, v, before = (np.concatenate(x) for x in zip(*[_states(a) for a, _ in held], strict=True))
    after = np.concatenate([b.error for _, b in held])
    time_s = np.concatenate([a.row.time_s[:: a.row.step][a.row.moving] for a, _ in held])
    load = np.concatenate([a.expected[a.row.moving] for a, _ in held])
    unit = rig.unit(joint)
    x, label = {
        "position": (q % turn, f"position within each {turn:.3g} {unit} [{unit}]")
        if turn
        else (q, f"position [{unit}]"),
        "time": (time_s, "time [s]"),
        "load": (load * np.sign(v), f"declared effort along the motion [{rig.effort_unit(joint)}]"),
        "velocity": (v, f"velocity [{unit}/s]"),
    }[variable]
    return before_and_after(x, label, before, after, f"residual [{rig.effort_unit(joint)}]")


def validation_section(rig: RigModel, findings: RigFindings, pairs: Sequence[Pair]) -> Section:
    """Effort errors on held-out trials, before and after, and one recording of each joint in time."""
    held = [p for p in pairs if p[0].validate] or list(pairs)
    rows = [
        [
            a.trial,
            a.joint,
            f"{rms(a.error):.4g}",
            f"{rms(b.error):.4g}",
            f"{rms(b.error) / max(rms(a.error), 1e-300):.2f}",
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
