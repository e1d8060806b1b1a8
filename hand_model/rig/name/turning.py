"""Frictions that need a distance to turn round, as candidates at a joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...effects import DriveState
from ...effects.base import Shape
from ...effects.path import dahl, lugre
from ..balance import Rows
from ..declared import DeclaredFit
from ..laws import ALL_TURNING, BRISTLES, BRISTLES_BY_LEVEL, BY_LEVEL, TURNING
from ..model import RigModel
from .candidate import Candidate

REACHES = tuple(np.geomspace(0.004, 0.5, 8))  # of the range, over which friction turns round
SHORTEST = 0.25  # of the shortest of these
STATIC_RATIOS, ENDS = (0.3, 1.0), (0.05, 4.0)  # what bristles hold besides while slow, over what they hold


def turning_round(
    stop: Candidate,
    rig: RigModel,
    fit: DeclaredFit,
    joint: str,
    train: tuple[DriveState, ...],
    rows: list[Rows],
) -> list[Candidate]:
    """Friction that needs a distance to turn round: a constant one, one in proportion to the load, both together (the
    declared dry friction is then none that turns at once), one that falls with speed (the bristles of a LuGre model,
    Canudas de Wit et al. 1995, slow against their own state), what these hold while slow beside one that does not fall, and where trials declare
    Coulomb levels, one for each.
    stop: the constant one as the catalogue has it."""
    span = max(float(np.ptp(state.position)) for state in train)
    wider = replace(stop.shapes["reach"], low=SHORTEST * REACHES[0] * span)
    stop = replace(
        stop,
        grid=tuple({"form": form, "reach": float(share * span)} for form in (0.0, 1.0) for share in REACHES),
        shapes={**stop.shapes, "reach": wider},
    )
    slow = tuple({"reach": float(share * span), **knee} for share in REACHES[::2] for knee in knees(rows))
    load = {r.trial: np.abs(r.load(fit.theta))[:, None] for r in fit.rows if r.joint == joint}
    found = [
        stop,
        replace(
            stop,
            effect="load_dependent_friction",
            variant=TURNING,
            amplitudes=(("per_load", "1", 0.0, np.inf),),
            columns=lambda r, s: load[r.trial] * stop.columns(r, s),
        ),
        replace(
            stop,
            effect="load_dependent_friction",
            variant=ALL_TURNING,
            amplitudes=(("per_load", "1", 0.0, np.inf), ("yield_load", rig.effort_unit(joint), 0.0, np.inf)),
            columns=lambda r, s: np.column_stack([load[r.trial], np.ones(len(r.position))]) * stop.columns(r, s),
        ),
        replace(
            stop,
            effect="stribeck_friction",
            variant=TURNING,
            amplitudes=(("static_excess", rig.effort_unit(joint), 0.0, np.inf),),
            grid=tuple({"form": 0.0, **shape} for shape in slow),
            columns=lambda r, s: stop.columns(r, s) * np.exp(-((r.velocity / s["stribeck_speed"]) ** 2))[:, None],
        ),
    ]
    slack = _bristles(stop, slow)
    found.append(slack)
    key = f"joint:{joint}:frictionloss"
    level = {t.name: float(np.atleast_1d(t.set[key])[0]) for t in rig.trials if key in t.set}
    levels = np.unique(list(level.values()))
    if len(levels) > 1 and all(t.name in level for t in rig.trials):
        found.append(
            replace(
                stop,
                variant=BY_LEVEL,
                amplitudes=tuple((f"yield_load_{k:g}", "effort", 0.0, np.inf) for k in levels),
                columns=lambda r, s: (levels == level[r.trial]) * stop.columns(r, s),
            )
        )
        # of one recording a level more than one of these would say anything
        found.append(
            replace(
                slack,
                variant=BRISTLES_BY_LEVEL,
                columns=lambda r, s: level[r.trial] / levels.mean() * slack.columns(r, s),
            )
        )
    return found


def _bristles(stop: Candidate, slow: Sequence[Mapping[str, float]]) -> Candidate:
    """What the bristles of a LuGre model hold while slow beyond those that always hold the same: beside friction that
    turns round over the same way, the whole model (Canudas de Wit et al. 1995). slow: reaches and Stribeck speeds to
    begin with."""

    def columns(row: Rows, shape: Mapping[str, float]) -> np.ndarray:
        level = 1.0 + shape["static_ratio"] * np.exp(-((row.velocity / shape["stribeck_speed"]) ** 2))
        more = lugre(row.position, shape["reach"], level) - dahl(row.position, shape["reach"])
        return more[:, None] / shape["static_ratio"]

    return replace(
        stop,
        effect="stribeck_friction",
        variant=BRISTLES,
        amplitudes=(("static_excess", stop.amplitudes[0][1], 0.0, np.inf),),
        grid=tuple({**shape, "static_ratio": ratio} for shape in slow for ratio in STATIC_RATIOS),
        shapes={"reach": stop.shapes["reach"], "static_ratio": Shape("static_ratio", "1", *ENDS, STATIC_RATIOS)},
        columns=columns,
    )


def knees(rows: list[Rows], count: int = 4) -> tuple[dict[str, float], ...]:
    """Stribeck speeds between the slow and the fast ones of what moves: at rest friction is unknown, and one that acts
    there alone would be named for what holds the joint while it stands."""
    speeds = np.concatenate([np.abs(r.velocity) for r in rows])
    moving = speeds > np.concatenate([np.full(len(r.velocity), r.rest_speed) for r in rows])
    # of a joint that is held throughout all there is
    speeds = speeds[moving] if moving.any() else np.maximum(speeds, 1e-12)
    return tuple({"stribeck_speed": float(s)} for s in np.geomspace(*np.percentile(speeds, [10, 90]), count))
