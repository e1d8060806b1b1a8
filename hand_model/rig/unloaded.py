"""Does a measured effort carry the loads that the recordings are told to carry?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .balance import Rows
from .declared import CORRELATED

Array = NDArray[np.float64]
CARRIED = 0.1  # of the told loads: a channel that shows less is no effort of this machine, in no unit of it
SURE = 3.0  # standard deviations


def unloaded(rows: Sequence[Rows]) -> float | None:
    """Share of the effort by which the trials' own bodies load a joint (`set` of a mass) that its measured effort shows
    beside any declared parameters and an offset, where it is surely no tenth; None where it is more, or unknown. rows: of
    one joint, one or more.

    A weight that somebody hung up is the surest thing that is known of a recording: friction, gears and levers may be
    others than declared, but what drives the joint has to carry it.
    """
    # effort of the trials' own bodies beyond the declared ones
    carried = np.concatenate([-r.filtered(r.load_known)[r.moving] for r in rows])
    if not carried.any():
        return None
    effort = np.concatenate([r.effort[r.moving] for r in rows])
    left_carried, left = left_beside_declared(rows, np.stack([carried, effort], axis=1)).T
    power = float(left_carried @ left_carried)
    if power <= 1e-9 * float(carried @ carried):
        return None
    lacking = float(left_carried @ left) / power  # the balance has taken all of the told load off the effort
    rest = left - lacking * left_carried
    sd = float(np.sqrt(rest @ rest / len(rest) * CORRELATED / power))
    share = 1.0 + lacking
    return share if abs(share) + SURE * sd < CARRIED else None


def left_beside_declared(rows: Sequence[Rows], values: Array) -> Array:
    """What declared columns, of whatever coefficients, and an offset leave of values (m,) or (m, k) at the moving samples
    of rows of one joint."""
    x = np.concatenate([np.concatenate([r.columns, np.ones((len(r.effort), 1))], 1)[r.moving] for r in rows])
    x = x / (np.abs(x).max(0) + 1e-300)
    return values - x @ np.linalg.lstsq(x, values, rcond=1e-9)[0]
