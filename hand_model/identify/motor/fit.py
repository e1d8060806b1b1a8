"""The main call: a session and an actuator in, its identified motor out."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...background import single_threaded
from ...errors import IdentificationError
from ...hand import Estimate, Motor
from ...session import Session
from . import output_error
from .balance import NAMES
from .controller import find_controller
from .creep import begins, creeping
from .drive import STRIBECK
from .moves import MoveData, moves_from_rest
from .noise import reading_noise, rest_noise
from .output_error import FINE, OutputErrorFit
from .parameters import BOUNDS, UNITS
from .published import PublishedFit, fit_published, smear_share
from .recording import MotorTrial, Scale, actuator_trials, motor_trials
from .replicates import lack_of_fit
from .stribeck import with_other_shape, with_other_speed, with_rise
from .weak_form import GIVE, Regression, fit_regressions

Array = NDArray[np.float64]

LACK_OF_FIT = 0.5  # systematic misfit [noise variances] above which output error does not describe the recording
# standard errors, by a jackknife over some forty strokes, above which the regression claims a Stribeck rise
CLAIM = 6.0
ROOM = 3.0  # the same, above which output error tries one
REGRESSION_MISFIT = 4.0  # the same for the regression; noise with a memory of a sample or two reaches 3


@dataclass(frozen=True)
class MotorFit:
    """An identified drive.

    motor: what goes into the hand. scale: encoder range. values: every parameter of plant, friction and controller (see
    UNITS);
    covariance (k, k) of `names`. method: "output error" or "regression" (no setpoints, or none that explain the
    motion).
    sigma_position [%], sigma_current [raw]: noise of one sample. regression: the regression in weak form; published,
    alike: the four models with the current as it is, and with both sides filtered alike; smear: share of the reciprocal
    term's gain that is smear. output_error: its fit, or None. stribeck: whether the recordings show a Stribeck rise;
    evidence: fall of the misfit by it.
    """

    motor: Motor
    scale: Scale
    values: Mapping[str, float]
    names: tuple[str, ...]
    covariance: Array
    method: str
    sigma_position: float
    sigma_current: float
    regression: Regression
    published: tuple[PublishedFit, ...]
    alike: tuple[PublishedFit, ...]
    smear: float
    output_error: OutputErrorFit | None
    stribeck: bool
    evidence: float

    @property
    def predictive(self) -> bool:
        """Whether setpoints predict position and current to the noise: the controller is identified too."""
        return self.method == "output error"

    @property
    def simulated(self) -> Mapping[str, float] | None:
        """Values that the simulated drive takes: those of `values`, or of a controller that explains the motion less
        well; None without."""
        return None if self.output_error is None else self.output_error.values


def identify_motor(session: Session, actuator: str) -> MotorFit:
    """Identify one motor from the session's excitation and flexion logs (validation trials take no part).

    Raises IdentificationError where they hold no excitation, one direction only, or a current that is constant, clipped
    or a command.
    """
    trials, scale = motor_trials(session, actuator)
    return fit_motor(trials, scale, actuator)


@single_threaded()
def identify_motors(session: Session) -> tuple[tuple[Motor, ...], tuple[str, ...]]:
    """Motors of all actuators with usable logs, and notes: one sentence for each that could not be identified.

    Raises IdentificationError only where the session has actuators with logs and none of them can be identified.
    """
    motors, notes = [], []
    for actuator in session.actuators:
        if not actuator_trials(session, actuator.name):
            notes.append(f'motor "{actuator.name}" not identified: no excitation or flexion trial with a log')
            continue
        try:
            motors.append(identify_motor(session, actuator.name).motor)
        except IdentificationError as error:
            notes.append(f'motor "{actuator.name}" not identified: {error}')
    return tuple(motors), tuple(notes)


def fit_motor(trials: Sequence[MotorTrial], scale: Scale, actuator: str = "motor") -> MotorFit:
    """Identify a motor from checked trials: regression first, then output error from the commands where these explain
    the motion."""
    sigma_p = reading_noise([(t.position, t.time_s) for t in trials])
    sigma_u = reading_noise([(t.current, t.time_s) for t in trials])
    sigma_u = max(sigma_u, rest_noise(trials, (sigma_p, sigma_u), scale.speed_full))
    plain, curved = fit_regressions(trials, sigma_p, sigma_u)
    published, alike = fit_published(trials), fit_published(trials, both_sides=True)
    moves = [m for t in trials for m in moves_from_rest(t, (sigma_p, sigma_u), scale.speed_full)]
    best, evidence = None, 0.0
    if len(moves) >= 4:
        best, evidence = _fit_output_error(moves, plain, curved, (sigma_p, sigma_u))
    accepted = best is not None and lack_of_fit(best) < LACK_OF_FIT
    notes: list[str] = []
    if accepted:
        sigma_p, sigma_u = (s * np.sqrt(c) for s, c in zip(best.sigma, best.chi2, strict=True))
        values, names, covariance = dict(best.values), best.names, best.covariance
        stribeck = "static_ratio" in names
    else:
        values, names, covariance, stribeck = _from_regression(plain, curved)
        if min(plain.misfit, curved.misfit) > REGRESSION_MISFIT:
            names, covariance = (), np.empty((0, 0))
        if best is not None:
            values = {**best.values, **values}
        notes += _shortcomings(best, plain, curved)
    if stribeck:
        notes.append(f"friction rises as speed falls (Stribeck): misfit falls by {evidence:.0f} noise variances")
    motor = Motor(
        actuator,
        scale.counts_open,
        scale.counts_close,
        _estimates(values, names, covariance, accepted),
        float(sigma_u),
        tuple(t.name for t in trials),
        tuple(notes),
    )
    return MotorFit(
        motor,
        scale,
        values,
        names,
        covariance,
        "output error" if accepted else "regression",
        float(sigma_p),
        float(sigma_u),
        plain,
        published,
        alike,
        smear_share(published, alike),
        best,
        stribeck,
        evidence,
    )


def _fit_output_error(
    moves: Sequence[MoveData], plain: Regression, curved: Regression, sigma: tuple[float, float]
) -> tuple[OutputErrorFit, float]:
    """Fit of plant and controller, with a Stribeck rise where it is worth its parameters, and the fall of the misfit by
    it."""
    best, evidence = find_controller(moves, _plant(plain), sigma, BOUNDS, LACK_OF_FIT), 0.0
    # a rise is tried where the regression, which knows no controller, leaves room for one
    if curved.excess_z > (ROOM if max(best.chi2) < 4.0 else CLAIM):
        best, evidence = with_rise(
            output_error.fit(best.moves, best.values, best.names, sigma, BOUNDS, best.controller, (FINE,), best.own),
            curved,
        )
    if lack_of_fit(best) < LACK_OF_FIT:
        states = begins(moves, best.values, best.own, best.controller)
        best = output_error.refined(dataclasses.replace(best, moves=creeping(best.moves, states)), BOUNDS)
        best = with_other_shape(with_other_speed(best)) if evidence else best
    return best, evidence


def _claims(curved: Regression) -> bool:
    """Whether the regression alone claims a Stribeck rise."""
    return bool(curved.excess_z > CLAIM and curved.values[2] > 0)


def _plant(r: Regression) -> dict[str, float]:
    """Plant and friction as a regression found them, within what a drive can be; bristles only where friction was seen
    to give."""
    plant = dict(zip(NAMES, map(float, r.values), strict=True))
    plant["inertia"], plant["coulomb"] = max(plant["inertia"], 1e-3), max(plant["coulomb"], 1.0)
    return (
        plant
        | {"static_ratio": 1.0, "stribeck_speed": 20.0, "stribeck_exponent": 1.0}
        | ({"presliding": r.give} if r.give > GIVE[0] else {})
    )


def _shortcomings(best: OutputErrorFit | None, plain: Regression, curved: Regression) -> list[str]:
    """Why a drive is known from the regression alone, a sentence each."""
    notes = []
    if min(plain.misfit, curved.misfit) > REGRESSION_MISFIT:
        notes.append(
            f"the balance of currents does not explain the strokes either (residual variance {plain.misfit:.1f} in "
            "units of the noise): parameters are given without intervals"
        )
    if best is None:
        notes.append(
            "no moves from rest with logged setpoints: controller not identified, setpoints do not predict the motion"
        )
    else:
        notes.append(
            f"setpoints do not explain the motion (residual variance {best.chi2[0]:.1f} of position, "
            f"{best.chi2[1]:.1f} of current, in units of the noise): parameters are those of the regression, "
            "and something is missing from the model"
        )
    return notes


def _from_regression(plain: Regression, curved: Regression) -> tuple[dict[str, float], tuple[str, ...], Array, bool]:
    stribeck = _claims(curved)
    used = curved if stribeck else plain
    values = dict(zip(NAMES, map(float, used.values), strict=True))
    if stribeck:
        values |= {
            "static_ratio": 1 + used.static_excess / used.values[2],
            "stribeck_speed": used.stribeck_speed,
            "stribeck_exponent": used.stribeck_exponent,
        }
    return values, NAMES, used.covariance, stribeck


def _estimates(
    values: Mapping[str, float], names: Sequence[str], covariance: Array, accepted: bool
) -> dict[str, Estimate]:
    origin = "output error of the simulated drive" if accepted else "regression in weak form"
    sd = dict(zip(names, np.sqrt(np.maximum(np.diag(covariance), 0)), strict=True))
    kept = values if accepted else {n: v for n, v in values.items() if n in NAMES or n in STRIBECK}
    if accepted and "static_ratio" not in names:
        kept = {n: v for n, v in kept.items() if n not in STRIBECK}
    ordered = [*NAMES, *(n for n in kept if n not in NAMES)]
    return {
        n: Estimate(
            float(kept[n]),
            (float(kept[n] - 1.96 * sd[n]), float(kept[n] + 1.96 * sd[n])) if n in sd else None,
            UNITS[n],
            origin,
        )
        for n in ordered
    }
