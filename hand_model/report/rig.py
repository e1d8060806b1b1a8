"""The report of a rig's replay: how far the simulated motion and effort are from the recorded ones."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..output import new_folder
from ..rig.replay import JointResidual, RigResiduals
from ..session import Session
from .page import Cell, Section, figures, key, page, table
from .pictures import POINTS
from .replay_report import FIGURES, FORMAT, OUTPUTS, PAGE
from .style import INK, SERIES, drawing
from .text import columns
from .words import count, number

Array = NDArray[np.float64]

HEAD = ("trial", "joint", "", "position rmse", "of range [%]", "effort rmse", "samples")
COUPLED = ("trial", "coupling", "", "angle rmse", "polynomial alone", "samples")
# Simulations shown; the first of each joint say what the rest say.
PICTURES = 6


def write_rig_report(session: Session, residuals: RigResiduals, folder: str | Path) -> Path:
    """Write `report.html` and `figures.json`, whole or not at all; returns the page's path."""
    with new_folder(folder, OUTPUTS) as staging:
        (staging / PAGE).write_bytes(rig_page(session, residuals))
        rows = [
            {
                "trial": r.trial,
                "joint": r.joint,
                "held_out": r.validate,
                "position_rmse": r.position_rmse if r.followed else None,
                "diverged": r.diverged,
                "effort_rmse": _known(r.effort_rmse),
                "samples": r.samples,
            }
            for r in residuals.joints
        ]
        held = [
            {
                "trial": a.trial,
                "coupling": a.coupling,
                "held_out": a.validate,
                "unit": a.unit,
                "angle_rmse": a.angle_rmse,
                "angle_rmse_polynomial": a.plain_rmse,
                "samples": a.samples,
            }
            for a in residuals.couplings
        ]
        whole = {"format": FORMAT, "rig": session.hand, "joints": rows, "couplings": held}
        text = json.dumps(whole, indent=1, allow_nan=False)
        (staging / FIGURES).write_text(text + "\n")
    return Path(folder) / PAGE


def rig_page(session: Session, residuals: RigResiduals) -> bytes:
    """The page as bytes."""
    body = [table(HEAD, rows(session, residuals), "Position in rad or m, effort in N m or N", text_columns=3)]
    if residuals.couplings:
        caption = "Angle of the dependent joint, by the polynomial with what the file keeps besides, and by it alone"
        body.append(table(COUPLED, coupled(residuals), caption, text_columns=3))
    drawn = [(f"{r.trial}, {r.joint}", _simulation(r, session)) for r in residuals.joints if r.followed]
    if drawn:
        body += [key(("c1", "recorded"), ("ink", "simulated in open loop")), figures(*drawn[:PICTURES])]
    lead = (
        f"{session.path.name}: the declared model, as its file stands, against "
        f"{count(len({r.trial for r in residuals.joints}), 'trial')}."
    )
    return page(
        session.hand or session.path.name,
        lead,
        (),
        [Section("replay", "Replay", rig_words(session, residuals), tuple(body))],
    )


def rig_words(session: Session, residuals: RigResiduals) -> str:
    """One sentence: errors on validation trials, on all where none validates."""
    held = any(r.validate for r in residuals.joints)
    chosen = [r for r in residuals.joints if r.validate or not held]
    ran = [r for r in chosen if r.followed]
    words = f"On {count(len({r.trial for r in chosen}), 'validation trial' if held else 'trial')}"
    if ran:
        share = [100 * _share(session, r) for r in ran if np.isfinite(_share(session, r))]
        words += (
            f", the motion simulated in open loop is off by {number(float(np.median(share)), 1)} % of the recorded "
            "range (median)"
        )
    if len(ran) < len(chosen):
        words += f"; {count(len(chosen) - len(ran), 'simulation')} left the recorded range or could not be run"
    effort = [r.effort_rmse for r in chosen if np.isfinite(r.effort_rmse)]
    if effort:
        words += f"; effort by inverse dynamics is off by {float(np.median(effort)):.3g} (median, N m or N)"
    return words + "."


def rig_text(session: Session, residuals: RigResiduals) -> str:
    """The table and the sentence for a terminal."""
    tables = [columns(HEAD, rows(session, residuals), 3)]
    if residuals.couplings:
        tables.append(columns(COUPLED, coupled(residuals), 3))
    return "\n\n".join([*tables, rig_words(session, residuals)])


def coupled(residuals: RigResiduals) -> Sequence[Sequence[str]]:
    """One row per trial and coupling."""
    return [
        [
            a.trial,
            a.coupling,
            "validation" if a.validate else "",
            f"{a.angle_rmse:.4g} {a.unit}",
            f"{a.plain_rmse:.4g} {a.unit}",
            str(a.samples),
        ]
        for a in residuals.couplings
    ]


def rows(session: Session, residuals: RigResiduals) -> Sequence[Sequence[str | Cell]]:
    """One row per trial and joint."""
    return [
        [
            r.trial,
            r.joint,
            "validation" if r.validate else "",
            f"{r.position_rmse:.4g}" if r.followed else "diverged" if r.diverged else "–",
            number(100 * _share(session, r), 1) if r.followed else "–",
            f"{r.effort_rmse:.4g}" if np.isfinite(r.effort_rmse) else "–",
            str(r.samples),
        ]
        for r in residuals.joints
    ]


def _recorded(session: Session, r: JointResidual) -> tuple[Array, Array]:
    """Time from the trial's start (n,) [s] and recorded position (n,); empty where no column holds it."""
    log = next(t for t in session.trials if t.name == r.trial).log()
    column = next((c for c, quantity in session.rig.signals.items() if quantity == f"joint:{r.joint}:position"), None)
    if column is None or column not in log.columns:
        return np.zeros(0), np.zeros(0)
    return log.time_s - log.time_s[0], log.column(column)


def _share(session: Session, r: JointResidual) -> float:
    """Position error over the recorded range; nan where either is not known."""
    recorded = _recorded(session, r)[1]
    spread = float(np.nanmax(recorded) - np.nanmin(recorded)) if np.isfinite(recorded).any() else 0.0
    return r.position_rmse / spread if spread > 0 else float("nan")


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _simulation(r: JointResidual, session: Session) -> bytes:
    time_s, recorded = _recorded(session, r)
    with drawing() as d:
        if len(time_s):
            keep = slice(None, None, max(1, len(time_s) // POINTS))
            d.axes.plot(time_s[keep], recorded[keep], color=SERIES[0], linewidth=1.6)
        keep = slice(None, None, max(1, len(r.time_s) // POINTS))
        d.axes.plot(r.time_s[keep] - r.time_s[0], r.simulated[keep], color=INK, linewidth=0.9)
        d.axes.set_xlabel("time [s]")
        d.axes.set_ylabel(f"{r.joint} position")
    return d.svg
