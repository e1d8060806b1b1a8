"""What an outsider has in common with all others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from ..base import Array, DriveState, Effect, Shape

UNLIKELY = 4.0  # log evidence by which an outsider must beat what the table holds: more than the width of a class


class Outsider(Effect):
    """An effect that the table does not name."""

    listed: ClassVar[bool] = False
    covers: ClassVar[tuple[str, ...]] = ()  # effects that are a special case of it: none of them beside it
    part_of: ClassVar[str | None] = None  # an effect of the table that leaves this trace, elsewhere or beside it

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """What is known comes first."""
        return -UNLIKELY


def of_its_record(state: DriveState, columns: Array, records: int) -> Array:
    """Columns (n, k) of one recording among those of the first `records` of a session, (n, records k); zero of any
    other."""
    out = np.zeros((len(columns), records, columns.shape[1]))
    record = int(state.extra["trial_index"][0]) if "trial_index" in state.extra else records
    if record < records:
        out[:, record] = columns
    return out.reshape(len(columns), -1)


def place_in_session(state: DriveState) -> Array:
    """Where each sample lies in the session (n,): its recording's number plus the share of that which has passed."""
    index = state.extra.get("trial_index", np.zeros(len(state.time_s)))
    return index + np.clip((state.time_s - state.time_s[0]) / max(float(np.ptp(state.time_s)), 1e-9), 0.0, 1 - 1e-9)


def moments(states: tuple[DriveState, ...]) -> Shape:
    """A moment of the session [s] while something is recorded, with starts all along."""
    recorded = np.concatenate([s.elapsed_s[np.isfinite(s.effort)] for s in states])
    starts = np.quantile(recorded, np.linspace(0.04, 0.96, 24))
    return Shape(
        "moment",
        "s",
        float(starts[0]),
        float(max(starts[-1], starts[0] + 1e-9)),
        tuple(np.unique(starts).tolist()),
        edge=True,
    )
