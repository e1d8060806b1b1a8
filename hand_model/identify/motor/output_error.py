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
from .drive import STEP_S, TICK_S, Moves, Run, run
from .memory import Predictors, autocorrelation, freed, predictors
from .moves import MoveData, speed_levels

Array = NDArray[np.float64]

COARSE_S = 5e-3
# steps [s], rounds, fall of the misfit that is worth another round, width [%] over which a deadband sets in: what sets
# in softly has no kinks; share of the
# usual widths of differences: wide ones see past kinks, narrow ones find the way along narrow valleys
COARSE, FINE = (COARSE_S, 4, 5.0, 0.5, 1.0), (STEP_S, 8, 0.5, 0.05, 0.25)
ALIGN = (COARSE, (STEP_S, 4, 0.5, 0.05, 1.0))  # where only the moves' own unknowns are sought
NEARLY = (STEP_S, 3, 5.0, 0.05, 1.0)  # a fit that will be refined
STAGES, ROUGH = (COARSE, FINE), (COARSE, NEARLY)
OTHER = 0.3  # of the usual widths of differences, tried where a step fails: kinks of another size
# times what is worth another round: the fall of the misfit for which a failed step is tried with other dampings
RETRY = 10.0
# of one step, powers of ten of the last one; the second four where the first three fail on a fresh Jacobian
DAMPINGS = ((-1, 0, 1), (-2, 2, 3, 4))
ABSOLUTE_REACH = {
    "preload": 20.0,
    "viscous": 0.1,
    "stiffness": 0.2,
    "coulomb": 10.0,
    "bristle": 0.01,
    "damping": 2.0,
    "rise": 0.02,
    "fall": 0.02,
    "deadband": 0.2,
    "delay": 0.002,
    "lead": 0.002,
    "lag": 0.002,
}
# what the instant of a jump is known to, half a step at its end and one at its begin: a current that jumps within it
# says little
REACH_S = 1.5 * TICK_S
# differences wide enough that the instants at which a drive sticks or a deadband sets in, held to one step, average out
STEP_SHARE, OWN_STEP = 2e-2, (1e-3, 1e-2, 1e-3, 0.5)
# a loop that holds its value for a step of 0 to 2 ms acts half a step late, and half a step after the value that is
# logged; a generator that
# sums up its reference step by step has the velocity up to half a step behind. Without this the motion alone, which
# tells inertia less damping
# times delay, lets the two run off together
PRIOR = {"lead": (0.5 * TICK_S, 0.5 * TICK_S), "delay": (0.5 * TICK_S, TICK_S), "lag": (0.25 * TICK_S, 0.75 * TICK_S)}
# mean square [noise variances] and correlation from sample to sample above which residuals are weighed anew
UNREST, MEMORY = 1.3, 0.1
OWN_REACH = np.array([0.01, 0.3, 0.01, 10.0])  # of one step


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


def _arrays(data: Sequence[MoveData], own: Array, repeat: int, calm: bool = True) -> Moves:
    def tile(x: Sequence[float]) -> Array:
        return np.repeat(np.asarray(x, float), repeat)

    return Moves(
        own[:, 0], tile([m.origin for m in data]), tile([m.target for m in data]), own[:, 2],
        tile([m.limit for m in data]), own[:, 1], own[:, 3], tile([m.time_s[-1] for m in data]),
        tile([m.velocity for m in data]), *((tile(x) for x in zip(*(m.calm_s for m in data), strict=True)) if calm else ()),
    )  # fmt: skip


def simulate_moves(
    data: Sequence[MoveData],
    q: Mapping[str, float],
    own: Array,
    controller: str,
    step_s: float = STEP_S,
    calm: bool = False,
) -> list[Array]:
    """Simulated position [%] and current [raw], (n, 2) per move; calm: in long steps while the recorded drive cruised
    or rested."""
    return _split(_one(_single(data, q, own, controller, step_s, calm), data, (1.0, 1.0))[0], data)


def simulate_states(
    data: Sequence[MoveData], q: Mapping[str, float], own: Array, controller: str, half_s: float
) -> list[Array]:
    """Simulated position [%], velocity and acceleration [% per second], (n, 3) per move, by differences over half_s [s]
    to either side."""
    longer = [dataclasses.replace(m, time_s=m.time_s + half_s) for m in data]
    found = _single(longer, q, own, controller, STEP_S, calm=False)
    before, at, after = (found.sample([m.time_s + x for m in data])[0][:, 0] for x in (-half_s, 0.0, half_s))
    return _split(np.stack([at, (after - before) / (2 * half_s), (after - 2 * at + before) / half_s**2], axis=1), data)


def whitened(
    data: Sequence[MoveData],
    q: Mapping[str, float],
    own: Array,
    sigma: tuple[float, float],
    controller: str,
    step_s: float = STEP_S,
) -> list[Array]:
    """Recorded less simulated position and current in units of what they are known to, (n, 2) per move."""
    y, weight = _one(_single(data, q, own, controller, step_s, False), data, sigma)
    return _split((_recorded(data) - y) * weight, data)


def _single(
    data: Sequence[MoveData], q: Mapping[str, float], own: Array, controller: str, step_s: float, calm: bool = True
) -> Run:
    """The moves simulated; calm: in long steps while the recorded drive cruised or rested, which is where the simulated
    one does only if it is near."""
    return run(_arrays(data, own, 1, calm), {k: np.full(len(data), v) for k, v in q.items()}, step_s, controller)


def _recorded(data: Sequence[MoveData]) -> Array:
    """Position and current (N, 2) of all moves, one after the other."""
    return np.stack([np.concatenate([m.position for m in data]), np.concatenate([m.current for m in data])], axis=1)


def _split(rows: Array, data: Sequence[MoveData]) -> list[Array]:
    """Rows (N, ...) of all moves by move."""
    return np.split(rows, np.cumsum([len(m.time_s) for m in data])[:-1])


def _one(found: Run, data: Sequence[MoveData], sigma: tuple[float, float], width: int = 1) -> tuple[Array, Array]:
    """Position and current (N, 2) of simulated moves, the first of every `width`, and the inverse standard deviations
    to which they are known, (N, 2).

    The current's holds half its change from REACH_S before to REACH_S after the sample: what the controller's steps
    leave open.
    """
    found = dataclasses.replace(found, column=found.column[::width])
    times = [m.time_s for m in data]
    p, u = (y[:, 0] for y in found.sample(times))
    before, after = (found.sample([t + x for t in times])[1][:, 0] for x in (-REACH_S, REACH_S))
    return np.c_[p, u], np.c_[np.full(len(p), 1 / sigma[0]), 1 / np.hypot(sigma[1], 0.5 * (after - before))]


def _steps(values: Mapping[str, float], names: Sequence[str]) -> Array:
    floor = {
        "preload": 1.0,
        "viscous": 0.02,
        "damping": 0.1,
        "bristle": 0.01,
        "rise": 0.01,
        "fall": 0.01,
        "deadband": 0.1,
        "delay": 0.01,
        "lead": 0.01,
        "lag": 0.05,
        "stiffness": 0.02,
        "coulomb": 1.0,
    }
    return np.array([STEP_SHARE * max(abs(values[n]), floor.get(n, 0.0)) for n in names])


def _linearise(
    data: Sequence[MoveData],
    q: Mapping[str, float],
    names: Sequence[str],
    own: Array,
    sigma: tuple[float, float],
    controller: str,
    step_s: float,
    width_share: float = 1.0,
    memory: tuple[Predictors, ...] = (),
) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
    """Whitened residuals (2n,) at steps of step_s [s], shared (2n, k) and own (2n, 4) Jacobian of every move; weights
    (n, 2).

    The Jacobian of a profile generator is that of the coarse simulation: a derivative that is off by a few percent
    changes the way to the optimum, not where the residuals have no part of it left. Where a deadband sets in needs the
    fine one: with the coarse, cascades end far enough from the optimum to miss their intervals.
    """
    apart = [n for n in names if n != "speed_full"]
    width = len(apart) + 1 + len(OWN_STEP)
    steps = width_share * np.append(_steps(q, apart), OWN_STEP)
    values = {n: np.full(width, v) for n, v in q.items()}
    for i, n in enumerate(apart):
        values[n] = values[n].copy()
        values[n][1 + i] += steps[i]
    values = {n: np.tile(v, len(data)) for n, v in values.items()}
    owns = np.repeat(own, width, axis=0)
    for i in range(own.shape[1]):
        owns[len(apart) + 1 + i :: width, i] += steps[len(apart) + i]
    coarse_s = step_s if controller == "cascade" else COARSE_S
    varied = run(_arrays(data, owns, width), values, coarse_s, controller, width)
    y, weight = (
        _one(_single(data, q, own, controller, step_s), data, sigma)
        if step_s < coarse_s
        else _one(varied, data, sigma, width)
    )
    residual = _split((_recorded(data) - y) * weight, data)
    with np.errstate(over="ignore", invalid="ignore"):  # drives that ran away
        varied_y = varied.sample([m.time_s for m in data], width)
        derivative = (
            np.stack([(x[:, 1:] - x[:, :1]) * w[:, None] for x, w in zip(varied_y, weight.T, strict=True)], axis=1)
            / steps
        )
    derivative = np.nan_to_num(derivative, posinf=0.0, neginf=0.0)  # (N, 2, width - 1)
    both = [freed(d.transpose(1, 0, 2).reshape(-1, width - 1), memory) for d in _split(derivative, data)]
    shared = [_with_speed(d, x, q, names, apart) for d, x in zip(both, own, strict=True)]
    return (
        [freed(e.T.ravel(), memory) for e in residual],
        shared,
        [d[:, len(apart) :] for d in both],
        _split(weight, data),
    )


def _with_speed(
    derivative: Array, own: Array, q: Mapping[str, float], names: Sequence[str], apart: Sequence[str]
) -> Array:
    """Derivatives (2n, k) by `names`, of a move's (2n, k') by those `apart` from the full speed and by its own unknowns
    (4,).

    A move's top speed is full speed times its own share, its slew full speed over the time to reach it. All moves' own
    shares make up for full speed but for what is known of them: differences of their own for both, wide as they are,
    would hide this way of going wrong.
    """
    if "speed_full" not in names:
        return derivative[:, : len(apart)]
    by = dict(zip(apart, derivative.T, strict=False))
    speed = (own[2] * derivative[:, len(apart) + 2] - sum(q[n] * by[n] for n in ("rise", "fall") if n in by)) / q[
        "speed_full"
    ]
    return np.column_stack([speed if n == "speed_full" else by[n] for n in names])


def _misfit(residual: list[Array], data: Sequence[MoveData], own: Array, q: Mapping[str, float]) -> float:
    """Sum of squares of whitened residuals, of what the moves' own unknowns are off their measured values, and of the
    priors."""
    total = sum(held(q, n) for n in PRIOR)
    total += sum(
        float(e @ e) + float(np.sum(((m.own - x) / m.own_sd) ** 2)) for m, e, x in zip(data, residual, own, strict=True)
    )
    return float(total) if np.isfinite(total) else np.inf


def held(q: Mapping[str, float], name: str) -> float:
    """What the prior of a parameter adds to the misfit."""
    if name not in q or name not in PRIOR:
        return 0.0
    mean, sd = PRIOR[name]
    return ((q[name] - mean) / sd) ** 2


def _costs(
    data: Sequence[MoveData],
    qs: Sequence[Mapping[str, float]],
    owns: Sequence[Array],
    weights: list[Array],
    controller: str,
    step_s: float,
    memory: tuple[Predictors, ...] = (),
) -> tuple[Array, int, list[Array]]:
    """Misfit of several candidates (their shared values and own unknowns) at fixed weights, in one batch of
    simulations; the best, its residuals."""
    width = len(qs)
    values = {n: np.tile([q[n] for q in qs], len(data)) for n in qs[0]}
    found = run(
        _arrays(data, np.stack(owns, axis=1).reshape(len(data) * width, -1), width), values, step_s, controller, width
    )
    y = found.sample([m.time_s for m in data], width)
    error = np.stack(
        [
            (r[:, None] - x) * w[:, None]
            for r, x, w in zip(_recorded(data).T, y, np.concatenate(weights).T, strict=True)
        ],
        axis=1,
    )
    residual = [freed(e.transpose(1, 0, 2).reshape(-1, width), memory) for e in _split(error, data)]
    costs = np.array([_misfit([e[:, j] for e in residual], data, owns[j], qs[j]) for j in range(width)])
    best = int(np.argmin(costs))
    return costs, best, [e[:, best] for e in residual]


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
                linear = _linearise(data, q, names, own, sigma, controller, step_s, share, memory)
                cost = _misfit(linear[0], data, own, q)
            if not np.isfinite(cost):
                break
            system = _normal(data, *linear[:3], own, q, names)[:3]
            if (expected := _expected(*system)) < enough:
                if fresh:
                    break
                fresh = True
                continue
            moved = _step(
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


def _expected(normal: Array, gradient: Array, blocks: list[tuple[Array, Array, Array]]) -> float:
    """Fall of the cost that the linear model promises."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    shared = (gradient / scale) @ np.linalg.lstsq(normal / np.outer(scale, scale), gradient / scale, rcond=1e-10)[0]
    return float(shared + sum(b @ inverse @ b for inverse, b, _ in blocks))


def _step(
    data: Sequence[MoveData],
    q: dict[str, float],
    names: Sequence[str],
    own: Array,
    weights: list[Array],
    bounds: Mapping[str, tuple[float, float]],
    system: tuple[Array, Array, list[tuple[Array, Array, Array]]],
    cost: float,
    damping: float,
    controller: str,
    step_s: float,
    memory: tuple[Predictors, ...],
    dampings: Sequence[tuple[int, ...]],
) -> tuple[dict[str, float], Array, float, float, list[Array]] | None:
    """One Levenberg-Marquardt step, the best of the first dampings (powers of ten) that improve: new values, own
    unknowns, cost, damping and residuals;
    None where nothing improves."""
    normal, gradient, blocks = system
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    free = _free(gradient, np.array([q[n] for n in names]), _limits(names, bounds))
    system = (normal / np.outer(scale, scale))[np.ix_(free, free)]
    for powers in dampings:
        candidates = []
        for strength in (tried := damping * 10.0 ** np.array(powers, float)):
            move = np.zeros(len(names))
            move[free] = (
                np.linalg.lstsq(system + strength * np.eye(free.sum()), (gradient / scale)[free], rcond=1e-12)[0]
                / scale[free]
            )
            new_q = dict(q)
            for n, d in zip(names, move, strict=True):
                low, high = bounds.get(n, (-np.inf, np.inf))
                reach = 0.5 * abs(q[n]) + ABSOLUTE_REACH.get(n, 0.0)
                new_q[n] = float(np.clip(q[n] + np.clip(d, -reach, reach), low, high))
            actual = np.array([new_q[n] - q[n] for n in names])
            local = np.array([inverse @ (b - c @ actual) for inverse, b, c in blocks])
            candidates.append((new_q, own + np.clip(local, -OWN_REACH, OWN_REACH)))
        costs, best, residual = _costs(
            data, [c[0] for c in candidates], [c[1] for c in candidates], weights, controller, step_s, memory
        )
        if costs[best] < cost:
            return (*candidates[best], float(costs[best]), float(np.clip(tried[best], 1e-8, 1e3)), residual)
    return None


def _normal(
    data: Sequence[MoveData],
    r: list[Array],
    g: list[Array],
    local: list[Array],
    own: Array,
    q: Mapping[str, float],
    names: Sequence[str],
) -> tuple[Array, Array, list[tuple[Array, Array, Array]], Array, Array]:
    """Shared normal matrix and gradient with every move's own unknowns eliminated, what restores these, and by move the
    score and the normal matrix."""
    parts, scores, blocks = [], [], []
    for m, e, a, b, x in zip(data, r, g, local, own, strict=True):
        w = 1 / m.own_sd**2
        inverse = np.linalg.inv(b.T @ b + np.diag(w))
        rhs, cross = b.T @ e + w * (m.own - x), b.T @ a
        parts.append(a.T @ a - cross.T @ inverse @ cross)
        scores.append(a.T @ e - cross.T @ inverse @ rhs)
        blocks.append((inverse, rhs, cross))
    gradient, normal = np.sum(scores, axis=0), np.sum(parts, axis=0)
    for i, n in enumerate(names):
        if n in PRIOR:
            mean, sd = PRIOR[n]
            normal[i, i] += 1 / sd**2
            gradient[i] -= (q[n] - mean) / sd**2
    return normal, gradient, blocks, np.array(scores), np.array(parts)


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
    normal, gradient, _, scores, parts = _normal(data, r, g, local, own, q, names)
    k = len(names)
    n = sum(len(m.time_s) for m in data)
    plain = [e.reshape(2, -1).T for e in r] if not memory else whitened(data, q, own, sigma, controller, step_s)
    residual = tuple(e / w for e, w in zip(plain, weights, strict=True))
    squared = np.sum([np.sum(e**2, axis=0) for e in plain], axis=0)
    chi2 = squared / (n - 0.5 * (k + 3 * len(data)))
    left = _unresolved(normal, gradient, _limits(names, bounds), np.array([q[n] for n in names]))
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


def _unresolved(normal: Array, gradient: Array, bounds: Array, values: Array) -> Array:
    """The step (k,) that the linear model still asks for where the search ended: what a misfit with kinks (sticking)
    leaves open.

    Parameters that are held by their bounds (k, 2) stay.
    """
    free = _free(gradient, values, bounds)
    step = np.zeros(len(values))
    if free.any():
        scale = np.sqrt(np.maximum(np.diag(normal)[free], 1e-30))
        step[free] = (
            np.linalg.lstsq(normal[np.ix_(free, free)] / np.outer(scale, scale), gradient[free] / scale, rcond=1e-8)[0]
            / scale
        )
    return step


def _limits(names: Sequence[str], bounds: Mapping[str, tuple[float, float]]) -> Array:
    return np.array([bounds.get(n, (-np.inf, np.inf)) for n in names]).reshape(-1, 2)


def _free(gradient: Array, values: Array, bounds: Array) -> NDArray[np.bool_]:
    """Which of the values (k,) are not pressed against their bounds (k, 2) by the descent."""
    low, high = bounds.T
    margin = 1e-9 + 0.01 * np.abs(np.where(np.isfinite(low), low, 0.0))
    return ~(
        ((values <= low + margin) & (gradient < 0))
        | ((values >= high - 1e-9 - 0.01 * np.abs(np.where(np.isfinite(high), high, 0.0))) & (gradient > 0))
    )
