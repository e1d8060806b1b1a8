"""The identification as published: position filtered, current not, four models by least squares on samples above a
speed.

Modelling of Robotic Hands: Kinematic and Dynamic Parameter Identification, section 4.3; tables 4.12, 4.13,
whose figures are `hand_model.published.current_rmse_raw`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .recording import MotorTrial

Array = NDArray[np.float64]

CUTOFF_HZ = 6.0
SPEED_THRESHOLD = 5.0  # [%/s]
MODELS = ("D", "SMD", "SMD+Fc", "SMD+Frec+Fc")
TERMS = {
    "D": ("viscous",),
    "SMD": ("inertia", "viscous", "stiffness"),
    "SMD+Fc": ("inertia", "viscous", "stiffness", "coulomb"),
    "SMD+Frec+Fc": ("inertia", "viscous", "stiffness", "coulomb", "reciprocal"),
}


@dataclass(frozen=True)
class PublishedFit:
    """model: one of MODELS; rmse_raw of the current; parameters: term -> value in raw units per percent."""

    model: str
    rmse_raw: float
    parameters: Mapping[str, float]


def zero_phase(x: Array, rate_hz: float, cutoff_hz: float = CUTOFF_HZ) -> Array:
    """Second-order Butterworth low-pass, forwards and backwards, of samples (n,) at rate_hz [Hz]."""
    from scipy.signal import butter, filtfilt

    b, a = butter(2, min(cutoff_hz / (0.5 * rate_hz), 0.95))
    return filtfilt(b, a, x)


def derivatives(x: Array, rate_hz: float) -> tuple[Array, Array]:
    """First and second derivative of uniform samples (n,) by a quintic spline: central differences lose 15 % of a at 6
    Hz and 55 Hz."""
    from scipy.interpolate import make_interp_spline

    t = np.arange(len(x)) / rate_hz
    spline = make_interp_spline(t, x, k=5)
    return spline(t, 1), spline(t, 2)


def columns(trial: MotorTrial, both_sides: bool = False) -> tuple[dict[str, Array], Array, Array]:
    """Regressors by term (n,), current (n,) and the mask of samples above the speed threshold of one trial.

    Velocity and acceleration by differences of the filtered position; `both_sides` filters current and friction terms
    alike.
    """
    rate_hz = 1 / float(np.median(np.diff(trial.time_s)))
    t = np.arange(trial.time_s[0], trial.time_s[-1], 1 / rate_hz)
    position, current = np.interp(t, trial.time_s, trial.position), np.interp(t, trial.time_s, trial.current)
    p = zero_phase(position, rate_hz)
    v = np.gradient(p, t)
    a = np.gradient(v, t)
    moving = np.abs(v) > SPEED_THRESHOLD
    safe = np.where(moving, v, np.sign(v + 1e-300) * SPEED_THRESHOLD)
    terms = {"inertia": a, "viscous": v, "stiffness": p, "coulomb": np.sign(v), "reciprocal": 1 / safe}
    if both_sides:
        terms["viscous"], terms["inertia"] = derivatives(p, rate_hz)
        # the friction changes sign with the drive, not with its filtered copy: lightly filtered velocity, then the same
        # filter
        light = np.gradient(zero_phase(position, rate_hz, 3 * CUTOFF_HZ), t)
        strong = np.abs(light) > SPEED_THRESHOLD
        sign = _held_sign(light, strong)
        recip = sign / np.maximum(np.abs(light), SPEED_THRESHOLD)
        terms = {**terms, "coulomb": zero_phase(sign, rate_hz), "reciprocal": zero_phase(recip, rate_hz)}
        current = zero_phase(current, rate_hz)
        # near a change of direction the filter mixes friction of both signs: known there only within its bounds
        moving = moving & (np.abs(terms["coulomb"]) > 0.98)
    return terms, current, moving


def _held_sign(v: Array, strong: Array) -> Array:
    """Sign of the velocity, held through rest: the friction keeps its direction until the drive is pushed the other
    way."""
    index = np.maximum.accumulate(np.where(strong, np.arange(len(v)), -1))
    sign = np.where(index >= 0, np.sign(v[np.maximum(index, 0)]), 0.0)
    return sign


def fit_published(trials: Sequence[MotorTrial], both_sides: bool = False) -> tuple[PublishedFit, ...]:
    """The four models of tables 4.12 and 4.13 on all trials together; `both_sides` for the comparison with a like
    filter."""
    parts = [columns(t, both_sides) for t in trials]
    current = np.concatenate([u[m] for _, u, m in parts])
    found = []
    for model in MODELS:
        names = TERMS[model]
        if both_sides:
            names = (*names, "preload")
        x = np.concatenate([np.column_stack([c.get(n, np.ones(len(m)))[m] for n in names]) for c, _, m in parts])
        beta = np.linalg.lstsq(x, current, rcond=None)[0]
        rmse = float(np.sqrt(np.mean((current - x @ beta) ** 2)))
        found.append(PublishedFit(model, rmse, dict(zip(names, map(float, beta), strict=True))))
    return tuple(found)


def smear_share(published: Sequence[PublishedFit], alike: Sequence[PublishedFit]) -> float:
    """Share (0..1) of the reciprocal term's gain in explained variance that is smear: gone, or no rise towards
    zero speed, once both sides are filtered alike. Both as `fit_published` finds them."""
    gain = []
    for found in (published, alike):
        fits = {f.model: f for f in found}
        gained = fits["SMD+Fc"].rmse_raw ** 2 - fits["SMD+Frec+Fc"].rmse_raw ** 2
        # a friction that falls towards zero speed is no Stribeck friction but what is left of the stops
        gain.append(gained if found is published or fits["SMD+Frec+Fc"].parameters["reciprocal"] > 0 else 0.0)
    return float(np.clip(1 - gain[1] / gain[0], 0.0, 1.0)) if gain[0] > 0 else 0.0
