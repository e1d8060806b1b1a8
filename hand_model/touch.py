"""Touch read from the current: what the free-motion model does not explain, tested sample by sample.

Residual: measured less predicted current of the open-loop simulation, in units of the noise, along the motion. Test:
Page's (1954) cumulative sum. Its threshold is set for a false-alarm rate on free motion: the largest value of the sum
in each free move has an exponential tail (Siegmund 1985, ch. 2), whatever the residuals' correlation and model error. A
tail known from few moves reaches further than the best guess of it: the threshold is that of the predictive
distribution, a Pareto one (exponential excesses of unknown mean; Geisser 1993, ch. 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import IdentificationError
from .hand import Estimate
from .identify.motor import MotorFit, identify_motor, output_error
from .identify.motor.balance import NAMES, balance, friction_state
from .identify.motor.moves import MoveData, shortened
from .identify.motor.predict import known_moves
from .identify.motor.recording import MotorTrial, actuator_trials, motor_trial
from .identify.motor.residuals import whitened
from .session import Log, Session

Array = NDArray[np.float64]

ALIGN_S = 0.25  # of a move, within which its own unknowns are found; nothing is tested there
# of the cumulative sum, in noise deviations: half the rise that is looked for; an object stiffer than the position loop
# gives that in two samples
SLACK = 2.0
AFTER_S = 1.2  # of pressing that the stiffness is read from


@dataclass(frozen=True)
class TouchDetector:
    """Threshold of the cumulative sum [noise deviations]; its false-alarm rate [1/min] on free motion; mean excess of
    the tail of the moves' maxima, the free moves and the motion [min] that it was calibrated on, and the white-noise
    threshold below which it is never set."""

    threshold: float
    false_alarms_per_minute: float
    mean_excess: float
    free_moves: int
    free_minutes: float
    white_threshold: float


@dataclass(frozen=True)
class Contact:
    """A touch. detected_s: time of the alarm on the log's clock [s]; onset_s: when the object was met [s]; position [%]
    there;
    stiffness [raw/%] with interval; kind: "stiff" (the object gives way less than the drive's own position loop),
    "compliant", or "undetermined"."""

    trial: str
    detected_s: float
    onset_s: float
    position: float
    stiffness: Estimate | None
    kind: str


def residuals(fit: MotorFit, log: Log, name: str = "log") -> list[tuple[MoveData, Array, Array]]:
    """Per move into flexion: the move, its sample times on the log's clock (n,) [s], and the residual (n,) [noise
    deviations].

    The residual is zero within ALIGN_S of the command. Where no controller explains the motion, the current is
    predicted from the recorded motion instead, with friction as in flexion: an object adds to that, whatever the
    controller does.
    """
    trial = motor_trial(name, log, fit.scale)
    begin = log.time_s[np.isfinite(log.time_s)][0]
    found = _from_commands(fit, trial) if fit.predictive and trial.setpoint is not None else _from_motion(fit, trial)
    return [(m, begin + trial.time_s[m.index] + m.time_s, np.where(m.time_s > ALIGN_S, z, 0.0)) for m, z in found]


def _from_commands(fit: MotorFit, trial: MotorTrial) -> list[tuple[MoveData, Array]]:
    """Measured less simulated current [noise deviations] of the moves from rest into flexion."""
    noise = (fit.sigma_position, fit.sigma_current)
    data = [m for m in known_moves(fit, trial) if m.target > m.origin and (m.time_s > ALIGN_S).sum() > 3]
    if not data:
        return []
    early = [shortened(m, ALIGN_S) for m in data]
    own = output_error.fit(early, fit.simulated, (), noise, {}, fit.output_error.controller, output_error.ALIGN).own
    found = whitened(data, fit.simulated, own, noise, fit.output_error.controller)
    return [(m, z[:, 1]) for m, z in zip(data, found, strict=True)]


def _from_motion(fit: MotorFit, trial: MotorTrial) -> list[tuple[MoveData, Array]]:
    """Measured current less that of the recorded motion [noise deviations], of every stretch of flexion."""
    expected = balance(trial, np.array([fit.values[n] for n in NAMES]), flexing=True)
    out = []
    for i, j in _flexions(trial):
        k = slice(i + 1, j + 1)
        if trial.time_s[j] - trial.time_s[i] < 2 * ALIGN_S:
            continue
        rest = np.array([0.0, trial.position[i], 1.0, trial.current[i]])
        target = float(trial.position[k].max()) if trial.setpoint is None else float(trial.setpoint[i + 1])
        m = MoveData(
            trial.name,
            i,
            trial.time_s[k] - trial.time_s[i],
            trial.position[k],
            trial.current[k],
            float(trial.position[i]),
            target,
            np.inf,
            rest,
            np.ones(4),
        )
        out.append((m, (trial.current - expected)[k] / fit.sigma_current))
    return out


def _flexions(trial: MotorTrial) -> list[tuple[int, int]]:
    """First and last sample of every stretch in which the drive is commanded, or where nothing is logged moves, into
    flexion."""
    if trial.setpoint is not None:
        change = np.flatnonzero(np.diff(trial.setpoint) != 0)
        ends = np.append(change[1:], len(trial.time_s) - 1)
        return [
            (int(i), int(j)) for i, j in zip(change, ends, strict=True) if trial.setpoint[i + 1] > trial.setpoint[i]
        ]
    path = friction_state(trial.position, 2.0)  # its sign is the direction of the last 2 % of travel
    flexes = path > 0.5
    starts, ends = np.flatnonzero(np.diff(flexes.astype(int)) == 1), np.flatnonzero(np.diff(flexes.astype(int)) == -1)
    return [(int(i), int(ends[ends > i][0]) if (ends > i).any() else len(path) - 1) for i in starts]


def cumulative_sum(z: Array, slack: float = SLACK) -> Array:
    """Page's sum (n,) of residuals (n,): g = max(0, g + z - slack)."""
    out, g = np.empty(len(z)), 0.0
    for i, value in enumerate(z.tolist()):
        g = max(0.0, g + value - slack)
        out[i] = g
    return out


def calibrate(fit: MotorFit, free: Sequence[tuple[str, Log]], false_alarms_per_minute: float = 0.1) -> TouchDetector:
    """Threshold for a false-alarm rate [1/min] from logs of free motion (name, log).

    Raises IdentificationError with fewer than 12 free moves into flexion: too little to calibrate on.
    """
    maxima, samples, minutes = [], 0, 0.0
    for name, log in free:
        for m, _, z in residuals(fit, log, name):
            tested = z[m.time_s > ALIGN_S]
            maxima.append(float(cumulative_sum(tested).max()))
            samples += len(tested)
            minutes += float(m.time_s[-1] - ALIGN_S) / 60
    if len(maxima) < 12:
        raise IdentificationError(f"{len(maxima)} free moves into flexion; at least 12 are needed to calibrate touch")
    wanted = false_alarms_per_minute * minutes / len(maxima)  # alarms per move
    threshold, mean_excess = tail_threshold(np.array(maxima), wanted)
    white = np.log(2 * SLACK**2 * samples / minutes / false_alarms_per_minute + 1) / (2 * SLACK) - 1.166
    return TouchDetector(
        float(max(threshold, white)), false_alarms_per_minute, mean_excess, len(maxima), minutes, float(white)
    )


def tail_threshold(maxima: Array, probability: float) -> tuple[float, float]:
    """Value that one more of maxima (n,) passes with this probability, by the predictive distribution of an exponential
    tail; its mean excess."""
    middle = float(np.median(maxima))
    excess = maxima[maxima > middle] - middle
    if len(excess) == 0:
        return middle, 0.0
    share = len(excess) / len(maxima)
    reach = excess.sum() * (max(share / probability, 1.0) ** (1 / len(excess)) - 1)
    return float(middle + reach), float(excess.mean())


def detect(
    fit: MotorFit, detector: TouchDetector, log: Log, name: str = "log", measure: bool = True
) -> tuple[Contact, ...]:
    """Contacts in one log: at most one per closing move, at the first sample whose sum passes the threshold.

    measure: estimate the stiffness and refine the onset too (half a second each).
    """
    found = []
    for m, time_s, z in residuals(fit, log, name):
        over = np.flatnonzero(cumulative_sum(z) > detector.threshold)
        if len(over):
            found.append(_contact(fit, m, time_s, z, int(over[0]), name, measure))
    return tuple(found)


def score(fit: MotorFit, log: Log, name: str = "log") -> Array:
    """Largest value of the cumulative sum in each closing move: the statistic of the receiver operating
    characteristic."""
    return np.array([cumulative_sum(z).max() for _, _, z in residuals(fit, log, name)])


def touch_session(session: Session, actuator: str, false_alarms_per_minute: float = 0.1) -> tuple[Contact, ...]:
    """Contacts in all grasp trials of an actuator, the detector calibrated on its excitation and flexion trials."""
    fit = identify_motor(session, actuator)
    detector = calibrate(
        fit, [(t.name, t.log()) for t in actuator_trials(session, actuator, validate=None)], false_alarms_per_minute
    )
    grasps = actuator_trials(session, actuator, ("grasp",), validate=None)
    return tuple(c for t in grasps for c in detect(fit, detector, t.log(), t.name))


def _contact(fit: MotorFit, m: MoveData, time_s: Array, z: Array, alarm: int, name: str, measure: bool) -> Contact:
    """Onset and stiffness by output error: the free drive against a one-sided spring, from the move's start to AFTER_S
    of pressing."""
    g = cumulative_sum(z)
    began = alarm
    while began > 0 and g[began - 1] > 0:
        began -= 1
    onset, at = float(time_s[max(began - 1, 0)]), float(m.position[max(began - 1, 0)])
    if not measure or not fit.predictive:
        estimate = None if not measure else _stiffness(fit, m, z, began, at)
        return Contact(name, float(time_s[alarm]), onset, at, estimate, "undetermined")
    best, noise = None, (fit.sigma_position, fit.sigma_current)
    data = [shortened(m, float(m.time_s[alarm] + AFTER_S))]
    names = ("contact_stiffness", "contact_at", "contact_damping")
    bounds = {"contact_stiffness": (1e-3, 1e4), "contact_at": (m.origin, m.target), "contact_damping": (0.0, 0.1)}
    seen = _stiffness(fit, m, z, began, at)
    for stiffness in (40.0 if seen is None else float(np.clip(seen.value, 0.5, 60.0)), 6.0, 1.0):
        start = {**fit.simulated, "contact_stiffness": stiffness, "contact_at": at, "contact_damping": 0.01}
        one = output_error.fit(data, start, names, noise, bounds, fit.output_error.controller)
        if best is None or one.cost < best.cost:
            best = one
        if max(best.chi2) < 1.5:
            break
    # the free-motion parameters are known only so well too; the misfit of a spring that is not quite linear widens the
    # interval
    value, sd = best.values["contact_stiffness"], float(np.sqrt(best.covariance[0, 0]))
    low, high = max(0.0, value - 1.96 * sd), value + 1.96 * sd
    estimate = Estimate(float(value), (float(low), float(high)), "raw/%", "output error of the drive against an object")
    passed = np.flatnonzero(data[0].position > best.values["contact_at"])
    if len(passed) and max(best.chi2) < 3.0:
        at = float(best.values["contact_at"])
        onset = float(time_s[max(int(passed[0]) - 1, 0)])
    gain = fit.values["gain"]
    kind = "stiff" if low > gain else "compliant" if high < gain else "undetermined"
    return Contact(name, float(time_s[alarm]), onset, at, estimate, kind)


def _stiffness(fit: MotorFit, m: MoveData, z: Array, began: int, at: float) -> Estimate | None:
    """Slope [raw/%] of the unexplained current over the travel since contact, while the drive presses; None where it
    does not move on."""
    k = np.arange(len(z)) >= began
    k &= m.time_s <= m.time_s[began] + AFTER_S
    x, y = m.position[k] - at, z[k] * fit.sigma_current
    if k.sum() < 5 or np.ptp(x) < 5 * fit.sigma_position:
        return None
    a = np.c_[x, np.ones(len(x))]
    beta, inverse = np.linalg.lstsq(a, y, rcond=None)[0], np.linalg.inv(a.T @ a)
    # the filter leaves about one independent sample in three
    sd = float(np.sqrt(3 * inverse[0, 0] * np.var(y - a @ beta)))
    value = float(max(beta[0], 0.0))
    return Estimate(value, (max(0.0, value - 1.96 * sd), value + 1.96 * sd), "raw/%", "unexplained current over travel")
