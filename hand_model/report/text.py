"""The same figures for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..hand import Hand
from ..replay import MODES, Residuals
from .identified import axis_sd_deg, centre_sd_mm, chosen_deg, frame_words
from .motors import MAIN, motor_rows
from .page import Cell
from .replayed import by_finger, distances_mm, noise_ratio, trials_words
from .words import number


def columns(head: Sequence[str], rows: Sequence[Sequence[str | Cell]], words: int = 1) -> str:
    """Rows in columns as wide as they need; the first `words` columns aligned left."""
    cells = [[c.text if isinstance(c, Cell) else c for c in row] for row in [list(head), *rows]]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    lines = []
    for row in cells:
        padded = [c.ljust(w) if i < words else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))]
        lines.append("  ".join(padded).rstrip())
    return "\n".join(lines)


def hand_text(hand: Hand) -> str:
    """Axes, centres and errors of a learned hand."""
    rows = []
    for finger in hand.fingers:
        for k, joint in enumerate(finger.joints):
            held = "–"
            if finger.encoder_maps:
                fitted = finger.encoder_maps[k]
                held = number(chosen_deg(fitted.rmse_held_out_rad, fitted.coefficients))
            axis = " ".join(f"{v:7.4f}" for v in joint.axis_palm)
            centre = " ".join(f"{1e3 * v:7.2f}" for v in joint.centre_palm)
            arc = f"{np.rad2deg(np.ptp(joint.range_rad)):.0f}"
            row = [
                finger.name,
                joint.name,
                axis,
                number(axis_sd_deg(hand, joint)),
                centre,
                number(centre_sd_mm(hand, joint)),
                arc,
                held,
            ]
            rows.append([*row, "axis not determined" if joint.degenerate else ""])
    head = ["finger", "joint", "axis", "± deg", "centre [mm]", "± mm", "arc deg", "encoder rmse deg", ""]
    lines = [f"{hand.name}, {hand.side} hand, marker noise {1e3 * hand.noise_m:.3f} mm", "", columns(head, rows, 2)]
    if hand.motors:
        lines += ["", columns(["motor", *MAIN, "current noise"], motor_rows(hand.motors))]
    notes = [*filter(None, [frame_words(hand)]), *hand.notes]
    return "\n".join([*lines, *(f"note: {n}" for n in notes)])


def residuals_text(residuals: Residuals) -> str:
    """Marker error per finger and mode."""
    modes = [m for m in MODES if any(m in t.residual_palm for t in residuals.trials)]
    rows = []
    for name, trials in by_finger(residuals).items():
        for mode in modes:
            values = distances_mm(trials, mode)
            if len(values):
                figures = [number(float(v)) for v in np.quantile(values, [0.5, 0.25, 0.75, 0.0, 1.0])]
                rows.append([name, mode, *figures, number(noise_ratio(trials, mode)) if mode != "measured" else "–"])
    agreement = max(residuals.agreement_m.values())
    head = ["finger", "driven by", "median", "25 %", "75 %", "least", "most", "over noise"]
    lines = [f"marker error [mm], {trials_words(residuals)}", "", columns(head, rows, 2), ""]
    lines.append(f"engines: at most {agreement:.1e} m apart")
    return "\n".join([*lines, *(f"note: {n}" for n in residuals.notes)])
