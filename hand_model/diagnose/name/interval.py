"""Intervals of an effect's parameters, and what modelling it brings on recordings that took no part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .balance import Balance, Fit
from .evidence import gain, oddity, scale_of
from .naming import Naming
from .noise import loudness
from .shapes import likeliest, polish, refit
from .term import DISCRETE, Term, reshaped

Array = NDArray[np.float64]

REFUTED = 1.1  # held-out variance over that of the fit as named, from which a reading is none
EXACT = 1e-9  # of a parameter's value: a smaller standard deviation is rounding
MISFIT_LIMIT = 1.5  # residual variance over pure error above which no interval is given


@dataclass(frozen=True)
class Reading:
    """The balance from which sizes are read, and its fits without and with the named effects (terms as in the
    naming)."""

    balance: Balance
    declared: Fit
    fit: Fit


def parameter_intervals(reading: Reading, which: int) -> dict[str, dict[str, Any]]:
    """Parameters of the fit's term `which` with 95 % intervals (Gauss-Newton, delta method), by name.

    What another form would say of them counts by how likely it is (Hoeting et al. 1999, "Bayesian model averaging", eq.
    4). Where the model does not fit (residual variance more than 1.5 times the pure error) the interval is left out.
    """
    balance, fit = reading.balance, reading.fit
    scale = scale_of(balance, fit)
    values, units = _figures(balance, fit, which)
    out: dict[str, dict[str, Any]] = {k: {"value": v, "unit": units.get(k, "1")} for k, v in values.items()}
    if scale >= MISFIT_LIMIT:
        return out
    variance = _variances(balance, fit, which, scale)
    said = [
        (p, *_figures(balance, f, which), _variances(balance, f, which, scale))
        for p, f in _forms(balance, fit, which, scale)
    ]
    # what is chosen has none
    for name in (k for k in out if k not in DISCRETE and np.sqrt(variance[k]) > EXACT * abs(values[k])):
        parts = [(p, v[name], s2[name]) for p, v, unit, s2 in said if name in v and unit.get(name) == units.get(name)]
        # a form that hardly tells the parameter at all says nothing of it
        parts = [(p, v, s2) for p, v, s2 in parts if np.isfinite(v + s2) and s2 <= max(v**2, variance[name])]
        parts.append((1 - sum(p for p, _, _ in parts), values[name], variance[name]))
        if np.isfinite(values[name] + variance[name]):
            out[name]["ci95"] = [_quantile(parts, at) for at in (0.025, 0.975)]
    return out


def _quantile(parts: list[tuple[float, float, float]], at: float) -> float:
    """Quantile of a mixture of normal distributions, each (share, mean, variance)."""
    from scipy.optimize import brentq
    from scipy.stats import norm

    share, mean, variance = np.array(parts).T
    sd = np.maximum(np.sqrt(variance), EXACT * np.abs(mean).max() + np.finfo(float).tiny)
    low, high = float(np.min(mean - 9 * sd)), float(np.max(mean + 9 * sd))
    return float(brentq(lambda x: float(share @ norm.cdf((x - mean) / sd)) - at, low, high, xtol=1e-9 * (high - low)))


def _figures(balance: Balance, fit: Fit, which: int) -> tuple[dict[str, float], dict[str, str]]:
    """Parameters of a term as fitted, with what follows from them, and their units."""
    term = fit.terms[which]
    return _all(balance, term, term.shape, fit.amplitudes[which], fit.declared), _units(term, balance)


def declared_sd(balance: Balance, fit: Fit) -> dict[str, float]:
    """Standard deviation of each declared coefficient of a fit, beside its terms; units of the coefficients."""
    covariance = _covariance(balance, fit, *_vector(fit)) * scale_of(balance, fit) * balance.inflation
    return dict(zip(fit.declared, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=False))


def _variances(balance: Balance, fit: Fit, which: int, scale: float) -> dict[str, float]:
    """Variance of each parameter of a term: the covariance of all that is fitted, through the gradient of the
    parameter."""
    theta, build = _vector(fit)
    covariance = _covariance(balance, fit, theta, build) * scale * balance.inflation
    term = fit.terms[which]
    columns = []
    for i in range(len(theta)):
        step = 1e-4 * (abs(theta[i]) + 1e-6)
        up, down = theta.copy(), theta.copy()
        up[i], down[i] = theta[i] + step, theta[i] - step
        above, below = (
            _all(balance, term, shape[which], amplitude[which], declared)
            for shape, amplitude, declared in (build(up), build(down))
        )
        columns.append({k: (above[k] - below[k]) / (2 * step) for k in above})
    gradients = {k: np.array([c[k] for c in columns]) for k in columns[0]}
    return {k: max(float(g @ covariance @ g), 0.0) for k, g in gradients.items()}


def _forms(balance: Balance, fit: Fit, which: int, scale: float) -> list[tuple[float, Fit]]:
    """Probability and fit of the other forms of a term, each with its shape optimised."""
    term = fit.terms[which]
    forms = next((s.starts for s in term.effect.shapes(balance.states) if s.name == "form"), ())
    out = []
    for form in (f for f in forms if f != term.shape.get("form")):
        other = reshaped(fit.terms, which, {**term.shape, "form": form})
        out.append(polish(balance, balance.fit(other), which))
    ahead = np.array([gain(balance, f, fit, scale) + oddity(balance, fit) - oddity(balance, f) for f in out])
    chance = np.exp(np.minimum(ahead, 0.0))
    return list(zip((chance / (1 + chance.sum())).tolist(), out, strict=True))


def as_named(naming: Naming) -> Reading:
    """Sizes read where the effects were named."""
    return Reading(naming.balance, naming.declared, naming.fit)


def undisturbed(naming: Naming) -> Reading:
    """Where sizes are read: from steady samples alone, for starts and stops are smeared and bend what happens at low
    speed; as named where an effect acts at starts, and where too few samples are steady; of lost motion without levels
    by chance. Among the forms of each effect, the one that steady motion likes best."""
    balance, fit = naming.balance, naming.fit
    count = (balance.train & balance.steady).sum()
    lively = any(t.effect.warps or t.effect.replaces for t in fit.terms)
    if balance.wander is not None and any(t.effect.family for t in fit.terms):
        # lost motion is a level of each stroke, which levels by chance would share with it
        even = balance.wandering(None)
        return Reading(balance, naming.declared, balance.fit(refit(even, even.fit(fit.terms)).terms))
    if not fit.terms or lively or balance.steady.all() or count < 20 * (len(balance.names) + fit.size):
        return as_named(naming)
    calm = balance.settled()
    best = refit(calm, calm.fit(fit.terms))
    for which, term in enumerate(fit.terms):
        fits = [best]
        forms = next((s.starts for s in term.effect.shapes(balance.states) if s.name == "form"), ())
        for form in forms:
            if form != term.shape["form"]:
                other = Term(term.effect, {**best.terms[which].shape, "form": form})
                fits.append(refit(calm, calm.fit((*best.terms[:which], other, *best.terms[which + 1 :]))))
        best = likeliest(calm, fits, which, lambda found: 0.5 * found.rss / calm.inflation + oddity(calm, found))
    held = balance.steady & ~balance.train
    errors = (
        [float(np.mean((balance.effort - f.prediction)[held] ** 2)) for f in (fit, best)] if held.any() else [1.0, 1.0]
    )
    if errors[1] > REFUTED * errors[0]:  # slow moves that the training recordings did not have
        return as_named(naming)
    return Reading(calm, calm.fit(), best)


def _all(
    balance: Balance,
    term: Term,
    shape: Mapping[str, float],
    amplitude: Mapping[str, float],
    declared: Mapping[str, float],
) -> dict[str, float]:
    values = term.effect.parameters(shape, amplitude, declared)
    return {k: float(v) for k, v in {**values, **term.effect.derived(balance.states, values)}.items()}


def _units(term: Term, balance: Balance) -> dict[str, str]:
    state = balance.states[0]
    derived = {name: unit for name, unit, _, _ in term.effect.amplitudes()} | dict(term.effect.units(term.shape))
    return {s.name: s.unit for s in term.effect.shapes(balance.states)} | {
        name: unit.replace("effort", state.effort_unit).replace("position", state.position_unit)
        for name, unit in derived.items()
    }


def _vector(fit: Fit) -> tuple[Array, Any]:
    """All parameters as one vector, and the way back to (shapes, amplitudes, declared)."""
    names = list(fit.declared)
    shapes = [[k for k in t.shape if k not in DISCRETE] for t in fit.terms]
    values = list(fit.declared.values())
    for amplitude in fit.amplitudes:
        values += list(amplitude.values())
    for term, keys in zip(fit.terms, shapes, strict=True):
        values += [term.shape[k] for k in keys]

    def build(theta: Array) -> tuple[list[dict[str, float]], list[dict[str, float]], dict[str, float]]:
        values = iter(theta.tolist())
        declared = {k: next(values) for k in names}
        amplitudes = [{k: next(values) for k in a} for a in fit.amplitudes]
        shape = [{**t.shape, **{k: next(values) for k in keys}} for t, keys in zip(fit.terms, shapes, strict=True)]
        return shape, amplitudes, declared

    return np.array(values, float), build


def predict(balance: Balance, fit: Fit, theta: Array, build: Any) -> Array:
    """Prediction (n,) of the model at a parameter vector."""
    shape, amplitude, declared = build(theta)
    terms = tuple(Term(t.effect, s) for t, s in zip(fit.terms, shape, strict=True))
    matrix, _, _ = balance.design(terms)
    linear = list(declared.values()) + [v for a in amplitude for v in a.values()]
    out = matrix @ np.array(linear)
    for term in terms:
        if term.effect.clips:
            out = term.effect.clip(out, term.shape)
    return out


def _covariance(balance: Balance, fit: Fit, theta: Array, build: Any) -> Array:
    w = balance.weights(fit.terms) * balance.train
    columns = []
    for i in range(len(theta)):
        step = 1e-4 * (abs(theta[i]) + 1e-3)
        up, down = theta.copy(), theta.copy()
        up[i], down[i] = theta[i] + step, theta[i] - step
        change = (predict(balance, fit, up, build) - predict(balance, fit, down, build)) / (2 * step)
        columns.append(balance.whiten(change * w, w))
    jacobian = np.stack(columns, axis=1)
    size = np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0, size, 1.0)
    inverse = np.linalg.pinv((jacobian / size).T @ (jacobian / size), rcond=1e-12)
    return inverse / np.outer(size, size)


def held_out(reading: Reading, which: int, seed: int = 0) -> dict[str, Any]:
    """Root-mean-square error on recordings that took no part, without and with the term `which` and others of the same
    effect (one finding may have several), the noise floor, and a bootstrap interval over strokes of the reduction.

    Steady samples; all sliding ones for a delay or a give, which act at starts and stops, where the floor is what
    timing grants. `held_out` is empty where there are no validation recordings, where the naming had to look at them,
    and for an event: figures are then in-sample.
    """
    balance, fit = reading.balance, reading.fit
    effect = fit.terms[which].effect
    without = balance.fit(tuple(t for t in fit.terms if t.effect.name != effect.name))
    slides = balance.gather(lambda s: s.extra.get("slides", np.ones(len(s.time_s)))) > 0
    seen = slides if effect.warps or effect.replaces else balance.steady
    of_one = "trial" in fit.terms[which].shape  # what happened in one recording tells nothing of another
    use = ~balance.train & seen & balance.telling(effect) & (not of_one)
    untouched = bool(use.any())
    if not untouched:
        use = seen & balance.train
    r0, r1 = ((balance.effort - f.prediction)[use] ** 2 for f in (without, fit))
    _, block = np.unique(balance.stroke[use], return_inverse=True)
    n, s0, s1 = (np.bincount(block, v) for v in (np.ones(use.sum()), r0, r1))
    pick = np.random.default_rng(seed).integers(0, len(n), (1000, len(n)))
    count = n[pick].sum(1)
    reduction = np.sqrt(s0[pick].sum(1) / count) - np.sqrt(s1[pick].sum(1) / count)
    return {
        "before": float(np.sqrt(r0.mean())),
        "after": float(np.sqrt(r1.mean())),
        "noise_floor": float(np.sqrt(np.mean(1 / balance.weights(fit.terms)[use] ** 2))),
        "ci95_reduction": np.percentile(reduction, [2.5, 97.5]).tolist(),
        "held_out": [s.trial for s in balance.states if s.validate and effect.told_by(s)] if untouched else [],
    }


def brought_held_out(naming: Naming, which: int) -> float | None:
    """Log likelihood that the term `which`, as fitted to the training recordings, brings to those that took no part,
    not more than it would without claiming to know less: what they add to its log evidence. None where nothing can be
    asked: no untouched recording, or an event that belongs to one recording only."""
    balance, fit = naming.balance, naming.fit
    held = ~balance.train & balance.telling(fit.terms[which].effect)
    if "trial" in fit.terms[which].shape or not held.any():
        return None
    without = balance.fit(tuple(t for i, t in enumerate(fit.terms) if i != which))
    brought = []
    for weights in ([balance.weights(f.terms) for f in (without, fit)], [balance.weight] * 2):
        before, after = (
            balance.inflation * float(np.sum(np.log(w[held])))
            - 0.5 * float(np.sum(balance.whiten((balance.effort - f.prediction) * w * held, w * held) ** 2))
            for f, w in zip((without, fit), weights, strict=True)
        )
        brought.append((after - before) / balance.inflation)
    return min(brought)


def sized(reading: Reading, which: int) -> bool:
    """Whether the size of the term `which` is told from zero where sizes are read: a likelihood ratio of all its
    amplitudes together (Wilks 1938), for some go together; True of a term without any, and where the model does not
    fit."""
    balance, fit = reading.balance, reading.fit
    count = len(fit.amplitudes[which])
    scale = scale_of(balance, fit)
    if not count or scale >= MISFIT_LIMIT:
        return True
    from scipy.stats import chi2

    without = balance.fit(tuple(t for i, t in enumerate(fit.terms) if i != which))
    return 2 * gain(balance, fit, without, scale) > float(chi2.ppf(0.95, count))


def variance_ratio(naming: Naming, fit: Fit) -> float:
    """Residual variance over the pure-error variance on validation recordings (all, where there are none): of one that
    is louder than the others, over its own."""
    balance = naming.balance
    use = ~balance.train & balance.steady
    if not use.any():
        use = balance.steady
    noise = balance.sigma * loudness(balance, balance.effort - naming.fit.prediction)
    return float(np.mean(((balance.effort - fit.prediction) / noise)[use] ** 2))
