"""The part of a rig's report that shows angles against angles along a transmission."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..rig.findings import CouplingResidual
from .page import Section, figures, key, table
from .pictures import POINTS
from .residual_pictures import before_and_after, error_field, full_colour, rms
from .style import INK, SERIES, drawing

Array = NDArray[np.float64]


def couplings_section(residuals: Sequence[CouplingResidual]) -> Section:
    """Angles against angles: map before and after, residual through the load (or the velocity), one recording in
    time."""
    drawn, rows = [], []
    for c in residuals:
        scale = f"± {full_colour(c.before):.2g} {c.unit}"
        for words, values in ((f"declared polynomial ({scale})", c.before), ("with what was found", c.after)):
            drawn.append(
                (
                    f"{c.coupling}: {words}",
                    error_field(
                        c.position, c.velocity, values, full_colour(c.before), "position upstream", "velocity upstream"
                    ),
                )
            )
        x, label = (c.velocity, "velocity upstream") if c.load is None else (c.load, "load [N m or N]")
        drawn.append((f"{c.coupling}: residual", before_and_after(x, label, c.before, c.after, f"residual [{c.unit}]")))
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
            a, b = rms(c.before[mine]), rms(c.after[mine])
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
