"""By how much a drive's current is logged later than its position: the profile likelihood of that lateness in the
simulated drive.

A balance of forces hardly tells a late current from another inertia, and smears what would tell them apart; the drive
simulated from its commands bends where its reference does, in position and current at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from . import output_error
from .drive import TICK_S
from .misfit import held
from .output_error import FINE, OutputErrorFit
from .residuals import simulate_moves

GLANCE_S = 2e-3  # step of a look at the lateness with all else as it is
SURE = 3.0  # standard deviations of that look, below which all else is not fitted anew
FIRST_S, FARTHEST_S = 6e-3, 0.25  # first step and end of the search
ROUNDS = 2  # of refinement, once the best lateness lies between two others


def channel_delay(found: OutputErrorFit, bounds: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    """Lateness of the current [s], negative where the position is late, and its standard deviation; a tick of the
    controller is not told.

    found: a fit that explains the motion, in which the lateness was held near zero. bounds: parameter -> (low, high),
    as it was fitted with.
    """
    start = -found.values.get("lead", 0.0)
    glance = {x: _misfit(found, start + x) for x in (-GLANCE_S, 0.0, GLANCE_S)}
    toward, sd = _vertex(glance)
    if not np.isfinite(sd) or abs(toward) < SURE * sd:
        return start + float(np.clip(toward, -GLANCE_S, GLANCE_S)) if np.isfinite(sd) else start, float(
            np.hypot(sd, TICK_S)
        )
    names = tuple(n for n in found.names if n != "lead")
    fits = {0.0: found}

    def misfit(delay_s: float) -> float:
        near = fits[min(fits, key=lambda x: abs(x - delay_s))]
        values = {**near.values, "lead": -delay_s}
        fits[delay_s] = output_error.fit(
            found.moves, values, names, found.sigma, bounds, found.controller, (FINE,), near.own, found.memory
        )
        return fits[delay_s].cost - held(fits[delay_s].values, "lead")

    best, sd = _minimum(misfit, start, float(np.sign(toward)) * FIRST_S)
    return best, float(np.hypot(sd, TICK_S))


def _misfit(found: OutputErrorFit, delay_s: float) -> float:
    """Sum of squares of the current's residuals over its noise with a lateness, all else as it is."""
    simulated = simulate_moves(found.moves, {**found.values, "lead": -delay_s}, found.own, found.controller)
    left = np.concatenate([m.current - y[:, 1] for m, y in zip(found.moves, simulated, strict=True)])
    return float(np.sum((left / found.sigma[1]) ** 2))


def _minimum(misfit: Callable[[float], float], start: float, step: float) -> tuple[float, float]:
    """Place of the least misfit, sought from `start` by steps that grow, and its standard deviation."""
    seen = {start: misfit(start)}
    here, ahead = start, start + step
    while abs(ahead) < FARTHEST_S:
        seen[ahead] = misfit(ahead)
        if seen[ahead] > seen[here]:
            break
        here, ahead = ahead, ahead + 2 * (ahead - here)
    for _ in range(ROUNDS):
        around = _around(seen)
        if len(around) < 3:  # the best one lies at the end of what was sought
            further = (
                2 * min(seen) - sorted(seen)[1]
                if min(seen, key=seen.__getitem__) == min(seen)
                else 2 * max(seen) - sorted(seen)[-2]
            )
            seen[further] = misfit(further)
            continue
        best, sd = _vertex(around)
        if min(abs(best - x) for x in seen) < max(0.3 * sd, 1e-4):
            break
        seen[best] = misfit(best)
    around = _around(seen)
    return _vertex(around) if len(around) == 3 else (min(seen, key=seen.__getitem__), np.inf)


def _around(seen: Mapping[float, float]) -> dict[float, float]:
    """The best place and its neighbours."""
    places = sorted(seen)
    at = places.index(min(seen, key=seen.__getitem__))
    return {x: seen[x] for x in places[max(at - 1, 0) : at + 2]}


def _vertex(three: Mapping[float, float]) -> tuple[float, float]:
    """Lowest place of the parabola through three points of a sum of squares, and the standard deviation that its
    curvature stands for;
    infinite where it is not curved upwards."""
    x, y = np.array(sorted(three)), np.array([three[k] for k in sorted(three)])
    curve, slope, _ = np.polyfit(x - x[1], y - y[1], 2)
    if curve <= 0:
        return float(x[np.argmin(y)]), np.inf
    return float(x[1] - slope / (2 * curve)), float(1 / np.sqrt(curve))
