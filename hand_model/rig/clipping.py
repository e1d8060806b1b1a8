"""Efforts that stand on a limit of their reading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .model import RigModel, RigTrial
from .states import fill_gaps

CLIPPED = 0.05  # share of samples on one and the same extreme value
PILED = 10  # times as often as any other value comes, stands a reading on a limit
FEWEST = 20  # different readings: fewer are a coarse channel's; and samples on each of two limits, that pile up there
OUTER = 0.75  # of the greatest reading: beyond, a signal that is not clipped thins out
SYMMETRIC = 0.02  # of a channel's range, by which two limits of one size may differ


def limits(trial: RigTrial, joint: str) -> tuple[float, float]:
    """Least and greatest reading of an effort, each where the channel stands on it and the machine would not: the same
    both ways, in many samples or where no reading a little below comes nearly as often; or on one side alone, in many
    samples while the joint moves, beside which no other value comes as often. Infinite where there is none."""
    values = fill_gaps(trial.time_s, trial.effort[joint])
    found, often = np.unique(values, return_counts=True)
    low, high = float(found[0]), float(found[-1])
    none = (-np.inf, np.inf)
    if len(found) <= FEWEST:
        return none
    least, alike = min(int(often[0]), int(often[-1])), abs(high + low) < SYMMETRIC * (high - low)
    outer = often[1:-1][np.abs(found[1:-1]) > OUTER * high]
    if alike and (least > CLIPPED * len(values) or least > max(FEWEST, PILED * np.max(outer, initial=1))):
        return low, high
    speed = np.abs(np.gradient(fill_gaps(trial.time_s, trial.position[joint]), trial.time_s))
    moving = speed > 0.1 * np.quantile(speed, 0.9)

    def stands(end: float, count: int) -> bool:
        here = (values == end) & moving
        return end != 0 and np.sum(here) > CLIPPED * len(values) and count > PILED * np.max(often[1:-1])

    return (
        low if stands(low, int(often[0])) else none[0],
        high if stands(high, int(often[-1])) else none[1],
    )


def unclipped(rig: RigModel) -> RigModel:
    """The rig without the samples of efforts that stand on a limit of their reading: they say only that it is at least
    that."""
    ends: dict[str, set[float]] = {}
    for trial in rig.trials:
        for joint in (j for j in trial.effort if j in trial.live and j in trial.position):
            ends.setdefault(joint, set()).update(e for e in limits(trial, joint) if np.isfinite(e))

    def without(trial: RigTrial) -> RigTrial:
        # a limit is the channel's: it is one in a recording that stands on it for a moment only, too
        ended = {j: np.isin(e, list(ends[j])) for j, e in trial.effort.items() if ends.get(j)}
        effort = {j: np.where(at, np.nan, trial.effort[j]) for j, at in ended.items()}
        return replace(trial, effort={**trial.effort, **effort}, clipped=ended)

    return replace(rig, trials=tuple(without(t) for t in rig.trials))
