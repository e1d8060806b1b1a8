"""Output error: the drive simulated from its commands against recorded position and current, by maximum likelihood.

Unknown per move and eliminated (Schur complement): when the command took effect (known to one sample of the log) and
where the drive rested. Shared: plant, friction and controller. Gauss-Newton on whitened residuals (Ljung 1999, ch. 7
and 10).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .covariance import covariance
from .drive import STEP_S
from .jacobian import COARSE_S, linearise
from .levenberg_marquardt import DAMPINGS, step
from .memory import Predictors, autocorrelation, predictors
from .misfit import PRIOR, misfit
from .moves import MoveData, speed_levels
from .normal_equations import expected_fall, limits, normal_equations, unresolved
from .residuals import whitened

Array = NDArray[np.float64]

# steps [s], rounds, fall of the misfit that is worth another round, width [%] over which a deadband sets in: what sets
# in softly has no kinks; share of the usual widths of differences: wide ones see past kinks, narrow ones find the way
# along narrow valleys
COARSE, FINE = (COARSE_S, 4, 5.0, 0.5, 1.0), (STEP_S, 8, 0.5, 0.05, 0.25)
ALIGN = (COARSE, (STEP_S, 4, 0.5, 0.05, 1.0))  # where only the moves' own unknowns are sought
NEARLY = (STEP_S, 3, 5.0, 0.05, 1.0)  # a fit that will be refined
STAGES, ROUGH = (COARSE, FINE), (COARSE, NEARLY)
OTHER = 0.3  # of the usual widths of differences, tried where a step fails: kinks of another size
# times what is worth another round: the fall of the misfit for which a failed step is tried with other dampings
RETRY = 10.0
# mean square [noise variances] and correlation from sample to sample above which residuals are weighed anew
UNREST, MEMORY = 1.3, 0.1


@dataclass(frozen=True)
class OutputErrorFit:
    """values: parameter -> value; names: fitted, in the order of covariance (k, k), see `covariance`. sigma: noise of
    position [%] and current [raw]; residual: per move (n, 2), in these units. own: (moves, 4), see MoveData. chi2: mean
    squared whitened residual per channel.
    controller: kind of the reference, see `drive`. memory: of the noise of both channels, none where empty."""

    values: Mapping[str, float]
    names: tuple[str, ...]
    covariance: Array
    sigma: tuple[float, float]
    residual: tuple[Array, ...]
    moves: tuple[MoveData, ...]
    own: Array
    cost: float
    chi2: tuple[float, float]
    controller: str = "profile"
    memory: tuple[Predictors, ...] = ()

    @property
    def speeds(self) -> dict[float, tuple[float, float]]:
        """Logged speed -> what it stands for [share of full], and its standard deviation."""
        return speed_levels(self.moves, self.own)


@np.errstate(over="ignore", invalid="ignore")  # values that a search tries may let a drive run away
def fit(
    data: Sequence[MoveData],
    start_values: Mapping[str, float],
    names: Sequence[str],
    sigma: tuple[float, float],
    bounds: Mapping[str, tuple[float, float]],
    controller: str = "profile",
    stages: Sequence[tuple[float, int, float, float, float]] = (),
    own: Array | None = None,
    memory: tuple[Predictors, ...] = (),
) -> OutputErrorFit:
    """Fit the named parameters to the moves by damped Gauss-Newton; the others stay at `start_values`.

    sigma: noise of position [%] and current [raw]. bounds: parameter -> (low, high). stages: STAGES unless given. own:
    (moves, 4) to start from.
    memory: of the noise of position and current.
    """
    q, own = dict(start_values), np.array([m.own for m in data]) if own is None else own.copy()
    wanted = tuple(names)
    for step_s, rounds, enough, edge, usual in stages or STAGES:
        damping, share, fresh, q = 1e-3, usual, True, {**q, "edge": edge}
        # what is finer than the step would only make up for the step
        names = tuple(n for n in wanted if step_s < COARSE_S or n not in PRIOR)
        for _ in range(rounds):
            if fresh:
                linear = linearise(data, q, names, own, sigma, controller, step_s, share, memory)
                cost = misfit(linear[0], data, own, q)
            if not np.isfinite(cost):
                break
            system = normal_equations(data, *linear[:3], own, q, names)[:3]
            if (expected := expected_fall(*system)) < enough:
                if fresh:
                    break
                fresh = True
                continue
            moved = step(
                data,
                q,
                names,
                own,
                linear[3],
                bounds,
                system,
                cost,
                damping,
                controller,
                step_s,
                memory,
                DAMPINGS if fresh and expected > RETRY * enough else DAMPINGS[:1],
            )
            if moved is None:
                if not fresh:
                    fresh = True
                elif share != usual or step_s == COARSE_S or expected < RETRY * enough:
                    break
                else:  # caught at a kink: differences over another width see past it
                    share, damping = OTHER * usual, 1e-1
                continue
            fell = cost - moved[2]
            q, own, cost, damping, residual = moved
            linear = (residual, *linear[1:])
            # a Jacobian that foretold the fall is kept for another step
            fresh = fell < 0.5 * expected
            if fell < 0.2 * enough:
                break
    return _finish(data, linear, q, names, sigma, own, cost, controller, bounds, memory, step_s)


def refined(f: OutputErrorFit, bounds: Mapping[str, tuple[float, float]]) -> OutputErrorFit:
    """The fit to its end, its noise as large and with the memory that the residuals show: a drive that is not quite
    alike twice moves by more than its encoder's noise, and for longer."""
    correlation = autocorrelation([e / f.sigma for e in f.residual])
    if max(f.chi2) < UNREST and correlation[:, 1].max() < MEMORY:
        return fit(f.moves, f.values, f.names, f.sigma, bounds, f.controller, (FINE,), f.own, f.memory)
    sigma = (f.sigma[0] * float(np.sqrt(max(f.chi2[0], 1.0))), f.sigma[1] * float(np.sqrt(max(f.chi2[1], 1.0))))
    memory = tuple(predictors(c) for c in correlation)
    # means of what has a memory are known less well
    wider = np.sqrt(np.maximum(1 + 2 * correlation[:, 1:].sum(axis=1), 1.0) * np.maximum(f.chi2, 1.0))
    moves = [dataclasses.replace(m, own_sd=m.own_sd * [1.0, wider[0], 1.0, wider[1]]) for m in f.moves]
    return fit(moves, f.values, f.names, sigma, bounds, f.controller, (FINE,), f.own, memory)


def _finish(
    data: Sequence[MoveData],
    linear: tuple[list[Array], ...],
    q: Mapping[str, float],
    names: Sequence[str],
    sigma: tuple[float, float],
    own: Array,
    cost: float,
    controller: str,
    bounds: Mapping[str, tuple[float, float]],
    memory: tuple[Predictors, ...],
    step_s: float,
) -> OutputErrorFit:
    r, g, local, weights = linear
    if not np.isfinite(cost):  # a drive that runs away explains nothing
        nothing = np.full((len(names), len(names)), np.inf)
        return OutputErrorFit(
            dict(q),
            tuple(names),
            nothing,
            sigma,
            tuple(r),
            tuple(data),
            own,
            np.inf,
            (np.inf, np.inf),
            controller,
            memory,
        )
    normal, gradient, _, scores, parts = normal_equations(data, r, g, local, own, q, names)
    k = len(names)
    n = sum(len(m.time_s) for m in data)
    plain = [e.reshape(2, -1).T for e in r] if not memory else whitened(data, q, own, sigma, controller, step_s)
    residual = tuple(e / w for e, w in zip(plain, weights, strict=True))
    squared = np.sum([np.sum(e**2, axis=0) for e in plain], axis=0)
    chi2 = squared / (n - 0.5 * (k + 3 * len(data)))
    left = unresolved(normal, gradient, limits(names, bounds), np.array([q[n] for n in names]))
    found = covariance(parts, normal - parts.sum(axis=0), scores, gradient, float(chi2.max()))
    found = found + np.outer(left, left)
    return OutputErrorFit(
        dict(q),
        tuple(names),
        found,
        sigma,
        residual,
        tuple(data),
        own,
        cost,
        (float(chi2[0]), float(chi2[1])),
        controller,
        memory,
    )
