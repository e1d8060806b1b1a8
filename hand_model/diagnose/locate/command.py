"""Command station: what the drive was told against what it did, from setpoint events and steady strokes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState
from ..findings import UNWRITTEN, Finding, weighed
from .answers import Answers, answers_of, lateness
from .simulated import SimulatedDrive

Array = NDArray[np.float64]

RUN_IN_S, RUN_OUT_S = 0.3, 0.25  # a stroke's part at steady speed begins and ends this far from rest
RUNNING = 0.7  # of its median speed: slower at either end, a stroke still starts or stops
# of the speed, over the recorded loads: less is within what controllers do (the most of 560 healthy drives 0.029)
SAG_LEAST = 0.035
SAG_T = 10.0
ALIKE = 2.0  # times the loss of speed of the session's least sagging drive: drives of one kind may differ by as much
FULL_SPEED = 0.9  # quantile of the velocity in the fastest strokes
# of the current beyond its limit that a drive takes from its speed: one, but for noise in the limit
CEILING_SHARE = 0.6
CEILING_LEFT, CEILING_T = 0.1, 6.0
REACTION_S = 0.15  # a person's quickest: a delay counts beside it
UNLIKE = 0.1  # of a delay by which answers may miss it: controllers of other gains rise otherwise


@dataclass(frozen=True)
class CommandFacts:
    """answers: to commands. sag, sag_se, load_range: loss of speed per load [1/raw], its standard error [1/raw] and the
    range of loads [raw];
    nan where strokes do not tell. ceiling: current [raw] at which the drive is at its limit, or nan; cut: the weight of
    what it takes away; share_cut: of the time at steady speed in which more would be needed. strokes: how many tell the
    sag. trials: names of the recordings."""

    answers: Answers
    sag: float
    sag_se: float
    load_range: float
    ceiling: float = float("nan")
    cut: float = 0.0
    share_cut: float = 0.0
    strokes: int = 0
    trials: tuple[str, ...] = ()

    @property
    def lost(self) -> float:
        """Share of its speed that the drive loses over the recorded loads; nan where strokes do not tell."""
        return self.sag * self.load_range


@dataclass(frozen=True)
class Stroke:
    """A stroke at one commanded speed, away from its start and stop. way: 1 flexing, -1 extending. position [%],
    velocity [%/s], current [raw]: (n,)."""

    way: float
    commanded: float
    position: Array
    velocity: Array
    current: Array


def command_facts(states: tuple[DriveState, ...], currents: tuple[Array, ...]) -> CommandFacts:
    """Facts of one drive. currents: raw current (n,) of each state (its `effort` is masked at rest)."""
    strokes = _strokes(states, currents)
    return CommandFacts(
        answers_of(states, currents), *_sag(strokes), *_ceiling(strokes), len(strokes), tuple(s.trial for s in states)
    )


def _strokes(states: tuple[DriveState, ...], currents: tuple[Array, ...]) -> list[Stroke]:
    out = []
    for state, current in zip(states, currents, strict=True):
        if "speed" not in state.extra:
            return []
        way = np.where(np.isfinite(state.effort), np.sign(state.velocity), 0)
        edges = np.r_[0, np.flatnonzero(np.diff(way)) + 1, len(way)]
        for a, b in pairwise(edges.tolist()):
            t = state.time_s[a:b]
            keep = np.arange(a, b)[(t > t[0] + RUN_IN_S) & (t < t[-1] - RUN_OUT_S)]
            fast = np.flatnonzero(np.abs(state.velocity[keep]) > RUNNING * np.median(np.abs(state.velocity[a:b])))
            keep = keep[fast[0] : fast[-1] + 1] if len(fast) else keep[:0]
            speeds = state.extra["speed"][keep]
            if way[a] and len(keep) >= 10 and np.ptp(speeds) == 0 and speeds[0] > 0:
                out.append(
                    Stroke(
                        float(way[a]),
                        float(speeds[0]),
                        state.position[keep],
                        state.velocity[keep],
                        current[keep],
                    )
                )
    return out


def _load_rise(strokes: list[Stroke]) -> dict[float, np.poly1d]:
    """Rise of the load over position [raw/%] flexing and extending, as polynomials of position: current = cubic in
    position + viscous velocity, each of its own for the two ways."""
    scale = 100.0 ** -np.arange(4)
    out = {}
    for way in (1.0, -1.0):
        mine = [s for s in strokes if s.way == way]
        beta = np.linalg.lstsq(_load_design(mine), np.concatenate([s.current for s in mine]), rcond=None)[0]
        out[way] = np.poly1d((beta[:4] * scale)[::-1]).deriv()
    return out


def _sag(strokes: list[Stroke]) -> tuple[float, float, float]:
    """Loss of log speed per load, its standard error and the range of loads. Strokes of one commanded speed are
    compared; a reference that a proportional controller follows falls behind by the rise of the load, which is no
    sag."""
    if len(strokes) < 12 or {s.way for s in strokes} != {1.0, -1.0}:
        return np.nan, np.nan, np.nan
    rise = _load_rise(strokes)
    y = np.log([max(s.way * float(np.mean(s.velocity)), 1e-9) for s in strokes])
    load = np.array([s.way * float(np.mean(s.current)) for s in strokes])
    levels = np.array(
        [[float(s.commanded == level) for level in sorted({s.commanded for s in strokes})] for s in strokes]
    )
    rises = np.array([float(np.mean(rise[s.way](s.position))) for s in strokes])
    design = np.concatenate([levels, rises[:, None], load[:, None]], axis=1)
    beta = np.linalg.lstsq(design, y, rcond=None)[0]
    spread = np.median(np.abs(y - design @ beta)) / 0.6745
    covariance = np.linalg.pinv(design.T @ design) * spread**2
    return -float(beta[-1]), float(np.sqrt(covariance[-1, -1])), float(np.ptp(load))


def _ceiling(strokes: list[Stroke]) -> tuple[float, float, float]:
    """Current [raw] at which the drive is at its limit, nan where it is at none, the weight of what that cuts and the
    share of time in which it does: in the fastest flexing strokes speed falls by just what keeps the current from
    exceeding it. What current each place would need at full speed is told by the slower strokes."""
    none = np.nan, 0.0, 0.0
    fast = max((s.commanded for s in strokes), default=0.0)
    mine = [s for s in strokes if s.way > 0 and s.commanded == fast]
    slower = [s for s in strokes if s.way > 0 and s.commanded < fast]
    if len(mine) < 3 or not slower:
        return none
    beta = np.linalg.lstsq(_load_design(slower), np.concatenate([s.current for s in slower]), rcond=None)[0]
    viscous = float(beta[-1])
    if viscous <= 0:
        return none
    velocity, current = (np.concatenate([getattr(s, name) for s in mine]) for name in ("velocity", "current"))
    full = float(np.quantile(velocity, FULL_SPEED))
    lost = full - velocity
    needed = _load_design(mine) @ beta + viscous * lost
    limit = float(np.median(current[needed > np.quantile(needed, 0.75)]))
    over = needed > limit
    if over.sum() < 10:
        return none
    x, y = (needed - limit)[over], viscous * lost[over]
    share = float(x @ y / max(x @ x, 1e-12))
    rest = y - share * x
    told = share > CEILING_T * float(np.std(rest)) / np.sqrt(max(float(x @ x), 1e-12))
    alone = float(rest @ rest) < CEILING_LEFT * float(y @ y)  # speed changes for no other reason
    slight = float(np.quantile(lost[over], FULL_SPEED)) < SAG_LEAST * full  # a healthy controller loses as much
    if slight or not (told and alone and CEILING_SHARE < share < 1 / CEILING_SHARE):
        return none
    noise = max(float(np.std(np.concatenate([s.current for s in slower]) - _load_design(slower) @ beta)), 1e-9)
    every = np.concatenate([s.current for s in strokes])
    weight = weighed(float(np.sqrt(y @ y / len(every))) / noise, float(np.std(every)) / noise)
    return limit, weight, np.count_nonzero(over) / len(every)


def _load_design(strokes: list[Stroke]) -> Array:
    """Columns (n, 5): powers 0 to 3 of position / 100 %, and velocity [%/s]."""
    position, velocity = (np.concatenate([getattr(s, name) for s in strokes]) for name in ("position", "velocity"))
    return np.stack([*((position / 100) ** k for k in range(4)), velocity], axis=-1)


def command_findings(facts: dict[str, CommandFacts], fingers: dict[str, str | None]) -> list[tuple[float, Finding]]:
    """Delays and sags of the session's drives; the least delayed, and the least sagging one, show what a healthy one
    does."""
    out = []
    late = lateness({a: f.answers for a, f in facts.items()})
    for actuator, fact in facts.items():
        if actuator in late and len(late[actuator].drive_s):
            out.append(_delay(actuator, fingers.get(actuator), fact, late[actuator].drive_s))
        if np.isfinite(fact.ceiling):
            out.append(_ceiling_finding(actuator, fingers.get(actuator), fact))
        elif _sags(fact, [f for a, f in facts.items() if a != actuator]):
            out.append(_sag_finding(actuator, fingers.get(actuator), fact))
    return out


def _sags(fact: CommandFacts, others: Sequence[CommandFacts]) -> bool:
    """Whether a drive loses speed for sure, more than controllers do, and plainly more than the session's other
    drives: one without much feedback loses more under load."""
    usual = min((f.lost for f in others if np.isfinite(f.lost)), default=0.0)
    sure = fact.sag > SAG_T * fact.sag_se and fact.lost > SAG_LEAST
    return bool(sure and fact.lost > ALIKE * usual and fact.lost - usual > SAG_LEAST)


def with_lateness(
    drives: Mapping[str, tuple[DriveState, ...]],
    facts: Mapping[str, CommandFacts],
    simulated: Mapping[str, SimulatedDrive],
) -> dict[str, tuple[DriveState, ...]]:
    """The states with what is known of their current channel: "late" (2,) [s], by how much and its doubt, by the
    simulated drive or by answers to commands; a late current shows starts and stops late as well, whatever model it is
    held against."""
    told = {
        a: (x.channel_s, float(np.hypot(x.doubt_s, UNLIKE * x.channel_s)))
        for a, x in lateness({a: f.answers for a, f in facts.items()}).items()
    }
    told |= {a: (d.delay_s, d.doubt_s) for a, d in simulated.items() if a in drives and np.isfinite(d.doubt_s)}
    out = dict(drives)
    for actuator, late in told.items():
        out[actuator] = tuple(
            replace(s, extra={**s.extra, "late": np.array(late), "sigma": _lasting(s, late[0])})
            for s in drives[actuator]
        )
    return out


def _lasting(state: DriveState, late_s: float) -> Array:
    """What is not known of starts and stops (n,), as long as a current that late, or early, may show it."""
    sigma = state.extra.get("sigma", np.zeros(len(state.time_s)))
    step = float(np.median(np.diff(state.time_s)))
    shifts = np.sign(late_s) * np.arange(step, abs(late_s) + 0.5 * step, step)
    return np.maximum.reduce([sigma, *(np.interp(state.time_s - shift, state.time_s, sigma) for shift in shifts)])


def _ceiling_finding(actuator: str, finger: str | None, fact: CommandFacts) -> tuple[float, Finding]:
    fit = {
        "metric": "speed_loss",
        "unit": "1",
        "before": None,
        "after": None,
        "noise_floor": None,
        "ci95_reduction": None,
        "held_out": [],
        "engine": "strokes",
    }
    where = {**_where(actuator, finger), "signal": "current", "trials": list(fact.trials)}
    text = (
        f"The {actuator} motor is at its limit of {fact.ceiling:.0f} raw in its fastest strokes: the current stays, and speed falls "
        "as the load rises."
    )
    return fact.cut, Finding(
        "current_saturation",
        ("current_saturation",),
        0.999,
        (),
        where,
        text,
        {"limit": {"value": fact.ceiling, "unit": "raw"}, "share_cut": {"value": fact.share_cut, "unit": "1"}},
        fit,
        dict(UNWRITTEN),
    )


def refused(
    actuator: str,
    finger: str | None,
    trials: tuple[str, ...],
    signal: str = "current",
    why: str = "it does not follow the motion",
) -> tuple[float, Finding]:
    """The finding of a current (or position) channel that is no measurement."""
    fit = {
        "metric": f"{signal}_rmse",
        "unit": "raw",
        "before": None,
        "after": None,
        "noise_floor": None,
        "ci95_reduction": None,
        "held_out": [],
        "engine": None,
    }
    where = {**_where(actuator, finger), "signal": signal, "trials": list(trials)}
    text = f"The {signal} of {actuator} is no measurement: {why}; nothing is fitted to it."
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
    fit = {
        "metric": "command_latency",
        "unit": "s",
        "before": value,
        "after": float(np.std(late_s)),
        "noise_floor": step_s,
        "ci95_reduction": None,
        "held_out": [],
        "engine": "events",
    }
    half = 0.5 * step_s  # the event itself is known to a sample only
    parameters = {"delay": {"value": value, "unit": "s", "ci95": [value - error - half, value + error + half]}}
    text = f"The {actuator} motor answers its commands {1e3 * value:.0f} ms late."
    where = {**_where(actuator, finger), "trials": list(fact.trials)}
    return value / REACTION_S, Finding(
        "command_delay", ("command_delay",), 0.999, (), where, text, parameters, fit, dict(UNWRITTEN)
    )


def _sag_finding(actuator: str, finger: str | None, fact: CommandFacts) -> tuple[float, Finding]:
    loss = fact.lost
    parameters = {
        "sag": {
            "value": fact.sag,
            "unit": "1/raw",
            "ci95": [fact.sag - 1.96 * fact.sag_se, fact.sag + 1.96 * fact.sag_se],
        }
    }
    fit = {
        "metric": "speed_loss",
        "unit": "1",
        "before": loss,
        "after": 0.0,
        "noise_floor": fact.sag_se * fact.load_range,
        "ci95_reduction": None,
        "held_out": [],
        "engine": "strokes",
    }
    text = f"The {actuator} motor loses {100 * loss:.1f} % of its speed over the recorded loads."
    per_stroke = fact.sag / fact.sag_se / np.sqrt(fact.strokes)
    where, weight = _where(actuator, finger), weighed(per_stroke, per_stroke / max(loss, 1e-9))
    return weight, Finding("drive_sag", ("drive_sag",), 0.999, (), where, text, parameters, fit, dict(UNWRITTEN))
