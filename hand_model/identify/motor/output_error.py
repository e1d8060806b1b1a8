"""Output error: the drive simulated from its commands against recorded position and current, by maximum likelihood.

Unknown per move and eliminated (Schur complement): when the command took effect (known to one sample of the log) and where the
drive rested. Shared: plant, friction and controller. Gauss-Newton on whitened residuals (Ljung 1999, ch. 7 and 10).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .drive import STEP_S, Moves, simulate
from .recording import MotorTrial

Array = NDArray[np.float64]

COARSE_S = 5e-3
ABSOLUTE_REACH = {"preload": 20.0, "viscous": 0.1, "stiffness": 0.2, "coulomb": 10.0, "bristle": 0.01, "damping": 2.0, "rise": 0.02, "fall": 0.02, "deadband": 0.2, "delay": 0.002}
OWN_STEP = (5e-4, 2e-3, 2e-4, 0.1)
OWN_REACH = np.array([0.01, 0.3, 0.01, 10.0])  # of one step
SETTLED = 0.6  # [%]: movement allowed over the samples before a move that starts from rest
BEFORE = 12  # samples at rest that a move looks back to


@dataclass(frozen=True)
class MoveData:
    """One move from rest: its samples, and what the command says.

    Known only so well, and estimated with the fit: own = when the command took effect (within one sample of the log) [s], where
    the drive rested [%], the speed [share of full] (logged in whole raw units), and the current that held it at rest [raw].
    own_sd: (4,) standard deviations.
    """

    trial: str
    index: int
    time_s: Array
    position: Array
    current: Array
    origin: float
    target: float
    limit: float
    own: Array
    own_sd: Array


@dataclass(frozen=True)
class OutputErrorFit:
    """values: parameter -> value; names: fitted, in the order of covariance (k, k), a sandwich over moves. sigma: noise of
    position [%] and current [raw]; residual: per move (n, 2), in these units. own: (moves, 4), see MoveData. chi2: mean squared whitened residual per channel.
    controller: kind of the reference, see `drive`."""

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


def moves_from_rest(trial: MotorTrial, sigma: tuple[float, float], speed_full: float) -> tuple[MoveData, ...]:
    """The commanded moves of a log that start with the drive at rest; empty where no setpoint is logged.

    sigma: noise of position [%] and current [raw]. speed_full: raw full scale of the speed column.
    """
    if trial.setpoint is None:
        return ()
    t, p, sigma_position = trial.time_s, trial.position, sigma[0]
    whole = trial.speed is not None and speed_full > 1 and np.allclose(trial.speed * speed_full, np.round(trial.speed * speed_full))
    speed_sd = 1 / (np.sqrt(12) * speed_full) if whole else 1e-4
    change = np.flatnonzero(np.diff(trial.setpoint) != 0)
    ends = np.append(change[1:], len(t) - 1)
    found = []
    for i, j in zip(change, ends, strict=True):
        before = p[max(0, i - BEFORE + 1) : i + 1]
        settled = len(before) >= 4 and np.ptp(before) < SETTLED + 5 * sigma_position
        drift = abs(before[len(before) // 2 :].mean() - before[: len(before) // 2].mean()) if len(before) >= 4 else np.inf
        if not settled or drift > 3 * sigma_position or j - i < 8 or trial.setpoint[i + 1] == trial.setpoint[i]:
            continue
        held = trial.current[max(0, i - BEFORE + 1) : i + 1]
        speed = 1.0 if trial.speed is None else float(trial.speed[i + 1])
        limit = np.inf if trial.limit is None else float(trial.limit[i + 1])
        gap = float(t[i + 1] - t[i])
        k = slice(i + 1, j + 1)
        found.append(
            MoveData(
                trial.name, int(i), t[k] - t[i], p[k], trial.current[k], float(trial.setpoint[i]), float(trial.setpoint[i + 1]),
                limit, np.array([0.5 * gap, before.mean(), speed, held.mean()]),
                np.array([max(gap / np.sqrt(12), 5e-3), sigma_position / np.sqrt(len(before)), speed_sd, sigma[1] / np.sqrt(len(held))]),
            )
        )  # fmt: skip
    return tuple(found)


def _arrays(data: Sequence[MoveData], own: Array, repeat: int) -> Moves:
    def tile(x: Sequence[float]) -> Array:
        return np.repeat(np.asarray(x, float), repeat)

    return Moves(
        own[:, 0], tile([m.origin for m in data]), tile([m.target for m in data]), own[:, 2],
        tile([m.limit for m in data]), own[:, 1], own[:, 3], tile([m.time_s[-1] for m in data]),
    )  # fmt: skip


def simulate_moves(data: Sequence[MoveData], q: Mapping[str, float], own: Array, controller: str, step_s: float = STEP_S) -> list[Array]:
    """Simulated position [%] and current [raw], (n, 2) per move."""
    order = np.argsort([-m.time_s[-1] for m in data], kind="stable")
    sorted_data = [data[i] for i in order]
    full = {k: np.full(len(data), v) for k, v in q.items()}
    t, p, u = simulate(_arrays(sorted_data, own[order], 1), full, step_s, controller)
    out: list[Array] = [np.empty(0)] * len(data)
    for column, i in enumerate(order):
        out[i] = _sample(t, p[:, column], u[:, column], data[i].time_s)
    return out


def _sample(t: Array, p: Array, u: Array, at: Array) -> Array:
    step = t[1] - t[0]
    i = np.minimum((at / step).astype(int), len(t) - 2)
    w = at / step - i
    if p.ndim == 1:
        return np.c_[p[i] * (1 - w) + p[i + 1] * w, u[i] * (1 - w) + u[i + 1] * w]
    w = w[:, None]
    return np.stack([p[i] * (1 - w) + p[i + 1] * w, u[i] * (1 - w) + u[i + 1] * w], axis=1)


def _steps(values: Mapping[str, float], names: Sequence[str]) -> Array:
    floor = {"preload": 1.0, "viscous": 0.02, "damping": 0.1, "bristle": 0.01, "rise": 0.01, "fall": 0.01, "deadband": 0.1, "delay": 0.01, "stiffness": 0.02, "coulomb": 1.0}
    return np.array([1e-3 * max(abs(values[n]), floor.get(n, 0.0)) for n in names])


def _linearise(
    data: Sequence[MoveData], q: Mapping[str, float], names: Sequence[str], own: Array, sigma: tuple[float, float], controller: str, step_s: float
) -> tuple[list[Array], list[Array], list[Array]]:
    """Whitened residuals (2n,), shared (2n, k) and own (2n, 4) Jacobian of every move, one batch of simulations."""
    k = len(names)
    width = k + 1 + len(OWN_STEP)
    steps = _steps(q, names)
    order = np.argsort([-m.time_s[-1] for m in data], kind="stable")
    ordered = [data[i] for i in order]
    values = {n: np.full(width, v) for n, v in q.items()}
    for i, n in enumerate(names):
        values[n] = values[n].copy()
        values[n][1 + i] += steps[i]
    values = {n: np.tile(v, len(data)) for n, v in values.items()}
    owns = np.repeat(own[order], width, axis=0)
    for i, small in enumerate(OWN_STEP):
        owns[k + 1 + i :: width, i] += small
    t, p, u = simulate(_arrays(ordered, owns, width), values, step_s, controller)
    out_r: list = [None] * len(data)
    out_g: list = [None] * len(data)
    out_l: list = [None] * len(data)
    for column, i in enumerate(order):
        m, c = data[i], slice(column * width, (column + 1) * width)
        y = _sample(t, p[:, c], u[:, c], m.time_s) / np.asarray(sigma)[None, :, None]  # (n, 2, width)
        target = np.stack([m.position, m.current], axis=1) / np.asarray(sigma)
        out_r[i] = (target - y[:, :, 0]).T.ravel()
        derivative = (y[:, :, 1:] - y[:, :, :1]) / np.append(steps, OWN_STEP)
        derivative = derivative.transpose(1, 0, 2).reshape(-1, width - 1)
        out_g[i], out_l[i] = derivative[:, :k], derivative[:, k:]
    return out_r, out_g, out_l


def _cost(data: Sequence[MoveData], q: Mapping[str, float], own: Array, sigma: tuple[float, float], controller: str, step_s: float) -> float:
    total = 0.0
    for m, y, x in zip(data, simulate_moves(data, q, own, controller, step_s), own, strict=True):
        e = (np.stack([m.position, m.current], axis=1) - y) / np.asarray(sigma)
        total += float(np.sum(e * e) + np.sum(((m.own - x) / m.own_sd) ** 2))
    return total if np.isfinite(total) else np.inf


def fit(
    data: Sequence[MoveData],
    start_values: Mapping[str, float],
    names: Sequence[str],
    sigma: tuple[float, float],
    bounds: Mapping[str, tuple[float, float]],
    controller: str = "profile",
    iterations: int = 12,
    own: Array | None = None,
) -> OutputErrorFit:
    """Fit the named parameters to the moves by damped Gauss-Newton; the others stay at `start_values`.

    sigma: noise of position [%] and current [raw]. bounds: parameter -> (low, high). own: (moves, 4) to start from.
    A few iterations at a coarse step come first; a fit that stays far from the noise is given up early.
    """
    q, own = dict(start_values), np.array([m.own for m in data]) if own is None else own.copy()
    samples = 2 * sum(len(m.time_s) for m in data)
    for step_s, rounds, enough in ((COARSE_S, 5, 2.0), (STEP_S, iterations, 0.1)):
        damping, cost = 1e-3, _cost(data, q, own, sigma, controller, step_s)
        for i in range(rounds):
            linear = _linearise(data, q, names, own, sigma, controller, step_s)
            normal, gradient, blocks, _ = _normal(data, *linear, own)
            if (expected := _expected(normal, gradient, blocks)) < enough or (i > 3 and cost > 20 * samples and expected > 0.5 * cost):
                break
            moved = _step(data, q, names, own, sigma, bounds, (normal, gradient, blocks), cost, damping, controller, step_s)
            if moved is None:
                break
            q, own, cost, damping = moved
    return _finish(data, linear, q, names, sigma, own, cost, controller)


def first_cost(
    data: Sequence[MoveData],
    values: Mapping[str, float],
    names: Sequence[str],
    sigma: tuple[float, float],
    bounds: Mapping[str, tuple[float, float]],
    controller: str,
    share: int = 4,
) -> float:
    """Misfit that two coarse steps reach on every `share`-th move: to choose where a fit starts."""
    some = tuple(sorted(data, key=lambda m: m.time_s[-1])[: max(6, len(data) // 2) : max(1, len(data) // (2 * share))])
    q, own = dict(values), np.array([m.own for m in some])
    damping, cost = 1e-3, _cost(some, q, own, sigma, controller, COARSE_S)
    for _ in range(3):
        linear = _linearise(some, q, names, own, sigma, controller, COARSE_S)
        normal, gradient, blocks, _ = _normal(some, *linear, own)
        moved = _step(some, q, names, own, sigma, bounds, (normal, gradient, blocks), cost, damping, controller, COARSE_S)
        if moved is None:
            break
        q, own, cost, damping = moved
    return cost


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
    sigma: tuple[float, float],
    bounds: Mapping[str, tuple[float, float]],
    system: tuple[Array, Array, list[tuple[Array, Array, Array]]],
    cost: float,
    damping: float,
    controller: str,
    step_s: float,
) -> tuple[dict[str, float], Array, float, float] | None:
    """One Levenberg-Marquardt step: new values, own unknowns, cost and damping; None where nothing improves."""
    normal, gradient, blocks = system
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    for _ in range(5):
        move = np.linalg.lstsq(normal / np.outer(scale, scale) + damping * np.eye(len(names)), gradient / scale, rcond=1e-12)[0] / scale
        new_q = dict(q)
        for n, d in zip(names, move, strict=True):
            low, high = bounds.get(n, (-np.inf, np.inf))
            reach = 0.5 * abs(q[n]) + ABSOLUTE_REACH.get(n, 0.0)
            new_q[n] = float(np.clip(q[n] + np.clip(d, -reach, reach), low, high))
        actual = np.array([new_q[n] - q[n] for n in names])
        local = np.array([inverse @ (b - c @ actual) for inverse, b, c in blocks])
        new_own = own + np.clip(local, -OWN_REACH, OWN_REACH)
        new = _cost(data, new_q, new_own, sigma, controller, step_s)
        if new < cost:
            return new_q, new_own, new, max(damping / 10, 1e-9)
        damping = max(damping, 1e-4) * 10
    return None


def _normal(
    data: Sequence[MoveData], r: list[Array], g: list[Array], local: list[Array], own: Array
) -> tuple[Array, Array, list[tuple[Array, Array, Array]], Array]:
    """Shared normal matrix and gradient with every move's own unknowns eliminated, what restores these, and the score per move."""
    k = g[0].shape[1]
    normal, scores, blocks = np.zeros((k, k)), [], []
    for m, e, a, b, x in zip(data, r, g, local, own, strict=True):
        w = 1 / m.own_sd**2
        inverse = np.linalg.inv(b.T @ b + np.diag(w))
        rhs, cross = b.T @ e + w * (m.own - x), b.T @ a
        normal += a.T @ a - cross.T @ inverse @ cross
        scores.append(a.T @ e - cross.T @ inverse @ rhs)
        blocks.append((inverse, rhs, cross))
    return normal, np.sum(scores, axis=0), blocks, np.array(scores)


def _finish(
    data: Sequence[MoveData], linear: tuple[list[Array], ...], q: Mapping[str, float], names: Sequence[str], sigma: tuple[float, float], own: Array, cost: float,
    controller: str,
) -> OutputErrorFit:
    r, g, local = linear
    normal, _, _, score = _normal(data, r, g, local, own)
    k = len(names)
    meat = score.T @ score * len(score) / max(1, len(score) - 1)
    bread = np.linalg.pinv(normal, hermitian=True)
    n = sum(len(m.time_s) for m in data)
    residual = tuple((e.reshape(2, -1) * np.asarray(sigma)[:, None]).T for e in r)
    squared = np.sum([np.sum(e.reshape(2, -1) ** 2, axis=1) for e in r], axis=0)
    chi2 = squared / (n - 0.5 * (k + 3 * len(data)))
    covariance = _conservative(bread * max(1.0, float(chi2.max())), bread @ meat @ bread)
    return OutputErrorFit(
        dict(q), tuple(names), covariance, sigma, residual, tuple(data), own, cost, (float(chi2[0]), float(chi2[1])), controller
    )


def _conservative(model: Array, sandwich: Array) -> Array:
    """The model's covariance, each deviation scaled up where the sandwich says that correlated residuals made it too small.

    The sandwich itself scatters by 1/sqrt(2 moves); a quarter more than the model's is within that scatter.
    """
    ratio = np.sqrt(np.maximum(np.diag(sandwich), 0) / np.maximum(np.diag(model), 1e-300))
    scale = np.where(ratio > 1.25, ratio, 1.0)
    return model * np.outer(scale, scale)
