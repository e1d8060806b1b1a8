"""Command station: what the drive was told against what it did, from setpoint events and steady strokes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState, figure
from ..findings import UNWRITTEN, Finding, weighed
from .answers import Answers, answers_of, lateness
from .ceiling import Ceiling
from .foretold import ceiling_foretold, delay_foretold, sag_foretold
from .simulated import SimulatedDrive
from .strokes import Loss, Stroke, beneath, ceiling, later, sag, strokes_of

Array = NDArray[np.float64]

ALIKE = 2.0  # times the loss of speed that the session's other drives have (median): one kind's may differ by as much
# of the speed, by which a drive must lose more than those for sure (standard errors): of 891 drives without a sag
# of four recorders one loses as much and goes on to; one that meets a stop loses 0.006
LEAST_BEYOND, SURE = 0.01, 4.0
USUAL_LOSS = 0.0175  # of the speed, that controllers may lose where no other drive says how much
# log likelihood that a limit must bring: for an effect, for the limits that are tried, and for as many names of as many
# channels
BEYOND_CHANCE = 12.0
REACTION_S = 0.15  # a person's quickest: a delay counts beside it
# by which two drives of one kind may answer apart: their loads, frictions and gains differ. Of eleven drives that seemed
# late by less, in sessions of nine sets, nine were not
TUNED_S = 0.025
BLIND = 4.0  # times what is not known of a start: what holds a drive at rest is anything within its friction
PLAINLY_LATE = 3.0  # standard deviations
EARLY = 3.0  # standard deviations by which answers that come before the command say so for sure
UNLIKE = 0.1  # of a delay by which answers may miss it: controllers of other gains rise otherwise


@dataclass(frozen=True)
class CommandFacts:
    """answers: to commands. loss: of speed under load; later: the same in the later half of strokes. ceiling: current
    [raw] at which the drive is at its limit, or nan; cut: the weight of what it takes away; share_cut: of the time at
    steady speed in which more would be needed. strokes: that tell the loss. trials, kept_out: names of the
    recordings, and of those for validation."""

    answers: Answers
    loss: Loss
    later: Loss
    ceiling: float = float("nan")
    cut: float = 0.0
    share_cut: float = 0.0
    strokes: tuple[Stroke, ...] = ()
    trials: tuple[str, ...] = ()
    kept_out: tuple[str, ...] = ()


def command_facts(states: tuple[DriveState, ...], currents: tuple[Array, ...]) -> CommandFacts:
    """Facts of one drive. currents: raw current (n,) of each state (its `effort` is masked at rest)."""
    strokes = strokes_of(states, currents)
    return CommandFacts(
        answers_of(states, currents),
        sag(strokes),
        sag(later(strokes)),
        *ceiling(strokes),
        tuple(strokes),
        tuple(s.trial for s in states),
        tuple(s.trial for s in states if s.validate),
    )


def command_findings(
    facts: dict[str, CommandFacts], fingers: dict[str, str | None], simulated: Mapping[str, SimulatedDrive]
) -> list[tuple[float, Finding]]:
    """Delays, sags and limits of the session's drives; the least delayed, and the least sagging one, show what a
    healthy one does."""
    out = delays(facts, fingers)
    asked = {a: d.ceiling for a, d in simulated.items() if d.ceiling is not None and d.ceiling.likelier > BEYOND_CHANCE}
    for actuator, fact in facts.items():
        if actuator in asked:
            out.append(_limit_finding(actuator, fingers.get(actuator), fact, asked[actuator]))
        elif np.isfinite(fact.ceiling):
            out.append(_ceiling_finding(actuator, fingers.get(actuator), fact))
        elif _sags(fact, [f for a, f in facts.items() if a != actuator]):
            out.append(_sag_finding(actuator, fingers.get(actuator), fact))
    return out


def delays(
    facts: Mapping[str, CommandFacts],
    fingers: Mapping[str, str | None],
    channel_s: Mapping[str, float] = MappingProxyType({}),
    in_time: Collection[str] = (),
) -> list[tuple[float, Finding]]:
    """Findings of drives that act late; by how much is told by their current. channel_s: actuator -> by how much [s]
    that itself is late (negative: early); a drive whose current is late by as much is in time. in_time: drives of which
    it is known that their current is not late."""
    return [
        _delay(a, fingers.get(a), facts[a], x.drive_s - channel_s.get(a, 0.0))
        for a, x in lateness({a: f.answers for a, f in facts.items()}, in_time).items()
        # a delay is what answers have in common, and not by how much they differ
        if len(x.drive_s) and float(np.mean(x.drive_s)) > max(channel_s.get(a, 0.0) + TUNED_S, np.std(x.drive_s))
    ]


def _sags(fact: CommandFacts, others: Sequence[CommandFacts]) -> bool:
    """Whether a drive loses speed surely and plainly more than the session's other drives lose, or seem to gain, and
    surely goes on to: controllers with little feedback lose more under load."""
    both = (
        (fact.loss, [f.loss for f in others], LEAST_BEYOND),
        (fact.later, [f.later for f in others], 0.0),  # of half of each stroke, which tells less
    )
    for loss, theirs, least in both:
        known = [abs(x.share) for x in theirs if np.isfinite(x.share)]
        usual = float(np.median(known)) if known else USUAL_LOSS
        if not (loss.share > ALIKE * usual and loss.share - usual - SURE * loss.share_se > least):
            return False
    return True


def sags_beneath(facts: Mapping[str, CommandFacts], actuator: str, limit: float) -> bool:
    """Whether a drive loses speed in strokes whose current stays below a limit [raw] of its reading: such a reading
    says little of the load of others."""
    strokes = beneath(facts[actuator].strokes, limit)
    fact = CommandFacts(facts[actuator].answers, sag(strokes), sag(later(strokes)))
    return _sags(fact, [f for a, f in facts.items() if a != actuator])


def with_lateness(
    drives: Mapping[str, tuple[DriveState, ...]],
    facts: Mapping[str, CommandFacts],
    simulated: Mapping[str, SimulatedDrive],
) -> dict[str, tuple[DriveState, ...]]:
    """The states with what is known of their current channel: "late" (2,) [s], by how much and its doubt, by the
    simulated drive or by answers to commands, or by both where no other drive was simulated: how the log is read is in
    its lateness then, and may be a sample. A current that plainly answers before its commands is early whatever is
    simulated. A late current shows starts and stops late as well, whatever model it is held against."""
    told = {
        a: (x.channel_s, float(np.hypot(x.doubt_s, UNLIKE * x.channel_s)))
        for a, x in lateness({a: f.answers for a, f in facts.items()}).items()
    }
    by_simulation = {
        a: (d.delay_s, d.doubt_s)
        for a, d in simulated.items()
        if a in drives and np.isfinite(d.doubt_s) and not _earlier(told.get(a, (0.0, 0.0)), d)
    }
    if len(by_simulation) == 1 < len(drives) and by_simulation.keys() <= told.keys():
        ((actuator, (delay_s, doubt_s)),) = by_simulation.items()
        doubt_s = float(np.hypot(doubt_s, facts[actuator].answers.step_s))
        by_simulation[actuator] = _weighted(told[actuator], (delay_s, doubt_s))
    told |= by_simulation
    out = dict(drives)
    for actuator, late in told.items():
        out[actuator] = tuple(
            replace(s, extra={**s.extra, "late": np.array(late), "sigma": _lasting(s, *late)}) for s in drives[actuator]
        )
    return out


def _earlier(told: tuple[float, float], simulated: SimulatedDrive) -> bool:
    """Whether answers to commands say a current early, and earlier than it is in simulation, each by three standard
    deviations."""
    late_s, doubt_s = told
    apart = simulated.delay_s - late_s > PLAINLY_LATE * float(np.hypot(doubt_s, simulated.doubt_s))
    return apart and late_s < -EARLY * doubt_s


def _weighted(*readings: tuple[float, float]) -> tuple[float, float]:
    """Mean of values with their doubts, by precision, and its doubt."""
    value, precision = np.array([v for v, _ in readings]), 1.0 / np.array([max(d, 1e-9) for _, d in readings]) ** 2
    return float(precision @ value / precision.sum()), float(precision.sum() ** -0.5)


def _lasting(state: DriveState, late_s: float, doubt_s: float) -> Array:
    """What is not known of starts and stops (n,), as long as a current that late, or early, may show it; of one that is
    late for sure, next to nothing while it shows what was drawn at rest."""
    sigma = state.extra.get("sigma", np.zeros(len(state.time_s)))
    step = float(np.median(np.diff(state.time_s)))
    shifts = np.sign(late_s) * np.arange(step, abs(late_s) + 0.5 * step, step)
    lasting = np.maximum.reduce([sigma, *(np.interp(state.time_s - shift, state.time_s, sigma) for shift in shifts)])
    if abs(late_s) <= max(step, PLAINLY_LATE * doubt_s):
        return lasting
    moving = state.extra.get("moving", np.ones(len(sigma)))
    return np.where(np.interp(state.time_s - late_s, state.time_s, moving) < 1, BLIND * lasting, lasting)


def _ceiling_finding(actuator: str, finger: str | None, fact: CommandFacts) -> tuple[float, Finding]:
    text = (
        f"The {actuator} motor is at its limit of {fact.ceiling:.0f} raw in its fastest strokes: the current stays, and speed falls "
        "as the load rises."
    )
    parameters = {"limit": {"value": fact.ceiling, "unit": "raw"}, "share_cut": {"value": fact.share_cut, "unit": "1"}}
    return fact.cut, _saturation(actuator, finger, fact, text, parameters, ceiling_foretold(fact.strokes))


def _limit_finding(actuator: str, finger: str | None, fact: CommandFacts, ceiling: Ceiling) -> tuple[float, Finding]:
    text = f"The {actuator} motor's current does not exceed {figure(ceiling.limit)} raw, where its controller asks for more."
    parameters = {
        "limit": {"value": ceiling.limit, "unit": "raw"},
        "share_cut": {"value": ceiling.share, "unit": "1"},
    }
    fit = {**_unfitted("current_rmse", "raw", "controller of the motor"), **ceiling.proof}
    return ceiling.lost, _saturation(actuator, finger, fact, text, parameters, fit)


def _saturation(
    actuator: str,
    finger: str | None,
    fact: CommandFacts,
    text: str,
    parameters: Mapping[str, Mapping[str, Any]],
    fit: Mapping[str, Any],
) -> Finding:
    where = {**_where(actuator, finger), "signal": "current", "trials": list(fact.trials)}
    return Finding(
        "current_saturation", ("current_saturation",), 0.999, (), where, text, parameters, fit, dict(UNWRITTEN)
    )


def _unfitted(metric: str, unit: str, engine: str | None) -> dict[str, Any]:
    """`fit` of a finding that no fit told."""
    figures = dict.fromkeys(("before", "after", "noise_floor", "ci95_reduction"))
    return {"metric": metric, "unit": unit, **figures, "held_out": [], "engine": engine}


def refused(
    actuator: str,
    finger: str | None,
    trials: tuple[str, ...],
    signal: str = "current",
    why: str = "it does not follow the motion",
    fate: str = "nothing is fitted to it",
) -> tuple[float, Finding]:
    """The finding of a current (or position) channel that is no measurement."""
    fit = _unfitted(f"{signal}_rmse", "raw", None)
    where = {**_where(actuator, finger), "signal": signal, "trials": list(trials)}
    text = f"The {signal} of {actuator} is no measurement: {why}; {fate}."
    return 1e9, Finding(
        "command_as_measurement",
        ("command_as_measurement",),
        0.999,
        (),
        where,
        text,
        {},
        fit,
        None,
        "the channel is refused",
    )


def _where(actuator: str, finger: str | None) -> dict[str, object]:
    return {
        "finger": finger,
        "joint": None,
        "actuator": actuator,
        "signal": "command",
        "marker": None,
        "trials": [],
        "region": None,
        "share_of_mismatch": 1.0,
    }


def _delay(actuator: str, finger: str | None, fact: CommandFacts, late_s: Array) -> tuple[float, Finding]:
    """Finding of a drive that answers `late_s` (k,) [s] later than a healthy one."""
    value, step_s = float(np.mean(late_s)), fact.answers.step_s
    error = 1.96 * float(np.std(late_s)) / np.sqrt(len(late_s))
    fit = delay_foretold(late_s, fact.answers.kept_out, fact.kept_out)
    half = 0.5 * step_s  # the event itself is known to a sample only
    parameters = {"delay": {"value": value, "unit": "s", "ci95": [value - error - half, value + error + half]}}
    text = f"The {actuator} motor answers its commands {1e3 * value:.0f} ms late."
    where = {**_where(actuator, finger), "trials": list(fact.trials)}
    return value / REACTION_S, Finding(
        "command_delay", ("command_delay",), 0.999, (), where, text, parameters, fit, dict(UNWRITTEN)
    )


def _sag_finding(actuator: str, finger: str | None, fact: CommandFacts) -> tuple[float, Finding]:
    loss, doubt = fact.loss.share, 1.96 * fact.loss.sag_se
    parameters = {
        "sag": {"value": fact.loss.sag, "unit": "1/raw", "ci95": [fact.loss.sag - doubt, fact.loss.sag + doubt]}
    }
    fit = sag_foretold(fact.strokes)
    text = f"The {actuator} motor loses {100 * loss:.1f} % of its speed over the recorded loads."
    per_stroke = fact.loss.sag / fact.loss.sag_se / np.sqrt(len(fact.strokes))
    where, weight = _where(actuator, finger), weighed(per_stroke, per_stroke / max(loss, 1e-9))
    return weight, Finding("drive_sag", ("drive_sag",), 0.999, (), where, text, parameters, fit, dict(UNWRITTEN))
