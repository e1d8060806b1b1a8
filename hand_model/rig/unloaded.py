"""Does a measured effort carry the loads that the recordings are told to carry?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .balance import Rows
from .declared import CORRELATED

CARRIED = 0.1  # of the told loads: a channel that shows less is no effort of this machine, in no unit of it
SURE = 3.0  # standard deviations


def unloaded(rows: Sequence[Rows]) -> float | None:
    """Share of the effort by which the trials' own bodies load a joint (`set` of a mass) that its measured effort shows
    beside any declared parameters and an offset, where it is surely no tenth; None where it is more, or unknown. rows: of
    one joint, one or more.

    A weight that somebody hung up is the surest thing that is known of a recording: friction, gears and levers may be
    others than declared, but what drives the joint has to carry it.
    """
    carried = np.concatenate([_carried(r) for r in rows])
    effort = np.concatenate([r.effort[r.moving] for r in rows])
    columns = np.concatenate([np.column_stack([r.columns, np.ones(len(r.effort))])[r.moving] for r in rows])
    size = np.abs(columns).max(0, initial=0.0)
    columns = columns[:, size > 0] / size[size > 0]
    both = np.stack([carried, effort], axis=1)
    left_carried, left = (both - columns @ np.linalg.lstsq(columns, both, rcond=1e-9)[0]).T
    power = float(left_carried @ left_carried)
    if power <= 1e-9 * float(carried @ carried):
        return None
    lacking = float(left_carried @ left) / power  # the balance has taken all of the told load off the effort
    rest = left - lacking * left_carried
    sd = float(np.sqrt(rest @ rest / len(rest) * CORRELATED / power))
    share = 1.0 + lacking
    return share if abs(share) + SURE * sd < CARRIED else None


def _carried(row: Rows) -> np.ndarray:
    """Effort (m,) of a trial's own bodies beyond the declared ones, at the moving samples."""
    return -row.filtered(row.load_known)[row.moving]
