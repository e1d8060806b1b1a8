"""The report of a replay: one page and its figures as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..output import new_folder
from ..replay import Residuals
from .identified import axes_section, axis_sd_deg, coupling_section, maps_section, repairs_section
from .motors import motors_section
from .page import Section, heading, listing, page
from .published_motors import published_motors_section
from .replayed import (
    best_mode,
    by_finger,
    clock_section,
    distances_mm,
    engines_section,
    error_section,
    map_pictures,
    noise_ratio,
    trials_words,
)
from .words import count, number

PAGE, FIGURES = "report.html", "figures.json"
OUTPUTS = (PAGE, FIGURES)
FORMAT = "hand-report/1"


def write_report(residuals: Residuals, folder: str | Path) -> Path:
    """Write `report.html` and `figures.json` into `folder`, whole or not at all; returns the page's path.

    The same residuals give the same bytes. Raises HandModelError where the folder holds anything else.
    """
    with new_folder(folder, OUTPUTS) as staging:
        (staging / PAGE).write_bytes(replay_page(residuals))
        (staging / FIGURES).write_text(json.dumps(replay_figures(residuals), indent=1, allow_nan=False) + "\n")
    return Path(folder) / PAGE


def replay_page(residuals: Residuals, *further: Section) -> bytes:
    """The page as bytes; further sections come last."""
    hand = residuals.description.hand
    sections = [
        error_section(residuals),
        axes_section(hand),
        maps_section(hand, map_pictures(residuals)),
        coupling_section(hand),
        motors_section(hand),
        published_motors_section(hand, residuals.session),
        clock_section(residuals),
        engines_section(residuals),
        _repairs(residuals),
        *further,
    ]
    title = f"{hand.name}, {hand.side} hand"
    lead = (
        f"{count(len(hand.fingers), 'finger')} identified from {count(_fitted(residuals), 'file')} of a recording "
        "session, compiled to URDF and "
        f"MJCF, and replayed on {trials_words(residuals)}."
    )
    return page(title, lead, _tiles(residuals), [s for s in sections if s is not None])


def _fitted(residuals: Residuals) -> int:
    return len([file for file in residuals.description.hand.provenance if not file.endswith(".toml")])


def _repairs(residuals: Residuals) -> Section:
    section = repairs_section(residuals.description.hand)
    if not residuals.notes:
        return section
    extra = (heading("Of the replay"), listing(residuals.notes))
    return Section(section.name, section.title, section.conclusion, (*section.body, *extra))


def _tiles(residuals: Residuals) -> list[tuple[str, str]]:
    hand, mode = residuals.description.hand, best_mode(residuals)
    trials = list(residuals.trials)
    every = distances_mm(trials, mode)
    how = "driven by encoder counts alone" if mode == "encoder" else "driven by measured angles"
    known = [axis_sd_deg(hand, j) for f in hand.fingers for j in f.joints if not j.degenerate]
    tiles = [(f"{number(float(np.median(every)))} mm", f"median marker error, {how}")]
    if mode == "encoder":
        tiles.append((f"{number(noise_ratio(trials, mode))} ×", "that error over what marker noise alone gives"))
    tiles.append((f"{number(1e3 * hand.noise_m)} mm", "marker noise per coordinate"))
    if known:
        tiles.append((f"± {number(float(np.median(known)))}°", "median uncertainty of an axis in the palm"))
    tiles.append((f"{max(residuals.agreement_m.values()):.0e} m", "largest difference between the engines"))
    return tiles


def replay_figures(residuals: Residuals) -> dict[str, Any]:
    """The figures of the page for other programs, SI units: error per finger, segment and mode, agreement, clocks."""
    fingers: dict[str, Any] = {}
    for name, trials in by_finger(residuals).items():
        fingers[name] = {
            mode: {
                "error_m": _quantiles(1e-3 * distances_mm(trials, mode)),
                "segments": {
                    s: _quantiles(1e-3 * distances_mm(trials, mode, segment=s))
                    for s in dict.fromkeys(trials[0].segment)
                },
                "over_noise": noise_ratio(trials, mode),
            }
            for mode in trials[0].residual_palm
        }
    return {
        "format": FORMAT,
        "hand": residuals.description.hand.name,
        "side": residuals.description.side,
        "trials": [
            {"name": t.trial.name, "finger": t.finger, "held_out": t.held_out, "frames": len(t.time_s)}
            for t in residuals.trials
        ],
        "fingers": fingers,
        "agreement_m": dict(residuals.agreement_m),
        "notes": list(residuals.notes),
    }


def _quantiles(values: Any) -> dict[str, float | int]:
    if len(values) == 0:
        return {"count": 0}
    q = np.quantile(values, [0.0, 0.25, 0.5, 0.75, 1.0])
    return dict(zip(("least", "q25", "median", "q75", "most"), map(float, q), strict=True)) | {"count": len(values)}
