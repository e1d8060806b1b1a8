"""What is read from answers and strokes, held to recordings that took no part.

No compiled file is replayed for it: a delay and a loss of speed show in events. Their figures are learned from the
recordings that are not kept for validation, and foretell those that are; where these tell nothing, all tell both, and
no recording is said to be held out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reduction import reduction
from .strokes import (
    STROKES,
    Pushed,
    Stroke,
    ceiling,
    fastest,
    load_rise,
    log_speeds,
    pushed,
    sag,
    speed_coefficients,
    speed_design,
)

Array = NDArray[np.float64]

FEWEST = 3  # answers, or strokes, of recordings kept out


def delay_foretold(late_s: Array, kept_out: NDArray[np.bool_], trials: Sequence[str]) -> dict[str, Any]:
    """`fit` of a delay: by how much answers (e,) are late [s], and late beside the delay of the others. kept_out: (e,),
    or empty; trials: names of the recordings kept out. The floor is by how much the answers of either differ among
    themselves."""
    held = kept_out if kept_out.size == late_s.size else np.zeros(late_s.size, bool)
    apart = min(held.sum(), (~held).sum()) >= FEWEST
    learned, told = (late_s[~held], late_s[held]) if apart else (late_s, late_s)
    parts = [learned, told] if apart else [late_s]
    scatter = sum(float(np.sum((x - x.mean()) ** 2)) for x in parts) / max(len(late_s) - len(parts), 1)
    return {
        "metric": "command_latency",
        "unit": "s",
        **reduction([told], [told - np.mean(learned)], [np.arange(len(told))]),
        "noise_floor": float(np.sqrt(scatter)),
        "held_out": list(trials) if apart else [],
        "engine": "events",
    }


def sag_foretold(strokes: Sequence[Stroke]) -> dict[str, Any]:
    """`fit` of a loss of speed under load: what the logarithms of the strokes' mean speeds are off by, of a drive that
    goes as fast as it is told, and of one that loses speed as the other recordings tell it."""
    learned, told, names = _apart(strokes, lambda some: np.isfinite(sag(some).sag))
    commanded, rise = sorted({s.commanded for s in learned}), load_rise(learned)
    design, y = speed_design(learned, rise, commanded), log_speeds(learned)
    ahead, speeds = speed_design(told, rise, commanded), log_speeds(told)
    loaded = speed_coefficients(design, y, len(commanded))
    plain = np.linalg.lstsq(design[:, : len(commanded)], y, rcond=None)[0]
    errors = [[speeds - ahead[:, : len(beta)] @ beta] for beta in (plain, loaded)]
    return _of_strokes(reduction(*errors, [np.arange(len(told))]), _scatter(strokes), names)


def _scatter(strokes: Sequence[Stroke]) -> float:
    """Standard deviation of log speed that all strokes together leave beside their own loss."""
    commanded, y = sorted({s.commanded for s in strokes}), log_speeds(strokes)
    design = speed_design(strokes, load_rise(strokes), commanded)
    left = y - design @ speed_coefficients(design, y, len(commanded))
    return float(np.sqrt(np.sum(left**2) / max(len(y) - design.shape[1], 1)))


def ceiling_foretold(strokes: Sequence[Stroke]) -> dict[str, Any]:
    """`fit` of a limit of the drive: what its fastest strokes lose of their speed, and lose beyond what keeps the
    current within the limit that the other recordings tell."""
    learned, told, names = _apart(strokes, lambda some: np.isfinite(ceiling(some)[0]))
    found, top = pushed(learned), fastest(learned)
    mine = [s for s in told if s.way > 0 and s.commanded == top[0].commanded] if top else []
    if found is None or not mine:
        return _of_strokes(dict.fromkeys(("before", "after", "ci95_reduction")), None, names)
    model, *_, over = found
    lost, left = _lost(model, strokes, mine)
    _, free = _lost(model, strokes, top)
    floor = float(np.sqrt(np.mean(free[~over] ** 2))) if (~over).any() else None
    blocks = np.repeat(np.arange(len(mine)), [len(s.time_s) for s in mine])
    return _of_strokes(reduction([lost], [left], [blocks]), floor, names)


def _lost(model: Pushed, strokes: Sequence[Stroke], mine: Sequence[Stroke]) -> tuple[Array, Array]:
    """Share (n,) of full speed that strokes have lost, and that less what a limit takes."""
    lost, needed = model.lost(strokes, mine)
    taken = np.maximum(needed - model.limit, 0.0) / model.viscous
    return lost / model.full, (lost - taken) / model.full


def _apart(
    strokes: Sequence[Stroke], tells: Callable[[list[Stroke]], bool]
) -> tuple[list[Stroke], list[Stroke], list[str]]:
    """Strokes that figures are learned from, those of the same commanded speeds that they are held to, and the names of
    the recordings kept out; all strokes twice, and no name, where either are too few to tell."""
    learned = [s for s in strokes if not s.kept_out]
    known = {s.commanded for s in learned}
    told = [s for s in strokes if s.kept_out and s.commanded in known]
    if len(told) >= FEWEST and tells(learned):
        return learned, told, list(dict.fromkeys(s.trial for s in told))
    return list(strokes), list(strokes), []


def _of_strokes(fall: dict[str, Any], floor: float | None, held_out: Sequence[str]) -> dict[str, Any]:
    return {
        "metric": "speed_loss",
        "unit": "1",
        **fall,
        "noise_floor": floor,
        "held_out": list(held_out),
        "engine": STROKES,
    }
