"""The part of a rig's report that shows motion: declared and improved model simulated in open loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..rig.findings import RigFindings
from ..rig.model import RigModel
from ..rig.replay import position_error, simulate_trial
from .page import Section, figures, key, note, table
from .pictures import POINTS
from .residual_pictures import PICTURES, error_by_state, full_colour, rms
from .style import INK, SERIES, drawing

Array = NDArray[np.float64]


def motion_sections(rig: RigModel, findings: RigFindings) -> list[Section]:
    """Map and table of the simulated position error on held-out trials, before and after, and every one in time."""
    joint, drawn, rows = rig.joints[0], [], []
    states: list[Array] = []
    for trial in rig.select(True) or rig.trials:
        recorded = trial.position[joint]
        sides = [simulate_trial(replace(rig, xml=x), trial)[1][:, 0] for x in (findings.declared_xml, findings.xml)]
        good = np.isfinite(recorded)
        errors = [rms(position_error(s[good], recorded[good])[0]) for s in sides]
        rows.append([trial.name, *(f"{e:.4g}" for e in errors), f"{errors[1] / max(errors[0], 1e-300):.2f}"])
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
    scale = f"± {full_colour(before):.2g} {rig.unit(joint)}"
    maps = figures(
        (f"declared model ({scale})", error_by_state(q, v, before, before, rig, joint)),
        (f"with what was found ({scale})", error_by_state(q, v, after, before, rig, joint)),
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
