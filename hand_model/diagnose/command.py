"""Command station: what the drive was told against what it did, from setpoint events and steady strokes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..effects.base import DriveState
from .findings import Finding

Array = NDArray[np.float64]

RUN_IN_S, RUN_OUT_S = 0.3, 0.25  # a stroke's part at steady speed begins and ends this far from rest
SAG_LEAST = 0.015  # of the speed, over the recorded loads: less is within what a controller does
SAG_T = 6.0


@dataclass(frozen=True)
class CommandFacts:
    """latency_s: (e,) from each setpoint change to the current's answer, motion_s: to the motion's. sag: loss of speed per unit of load, its standard
    error, and the range of loads; nan where strokes do not tell."""

    latency_s: Array
    motion_s: Array
    step_s: float
    sag: float
    sag_se: float
    load_range: float


def command_facts(states: tuple[DriveState, ...], currents: tuple[Array, ...]) -> CommandFacts:
    """Facts of one drive. currents: raw current (n,) of each state (its `effort` is masked at rest)."""
    latency = [x for s, c in zip(states, currents, strict=True) for x in _latencies(s, c)]
    motion = [x for s in states for x in _latencies(s, s.position)]
    step = float(np.median(np.concatenate([np.diff(s.time_s) for s in states])))
    sag, error, span = _sag(states, currents)
    return CommandFacts(np.array(latency), np.array(motion), step, sag, error, span)


def _latencies(state: DriveState, channel: Array) -> list[float]:
    """Time from each setpoint change to the first two samples beyond three standard deviations, in its direction."""
    if "setpoint" not in state.extra:
        return []
    setpoint, t = state.extra["setpoint"], state.time_s
    out = []
    for k in np.flatnonzero(np.diff(setpoint)) + 1:
        before = channel[(t > t[k] - 0.2) & (t < t[k])]
        if len(before) < 5:
            continue
        way = np.sign(setpoint[k] - setpoint[k - 1])
        away = way * (channel[k : k + 60] - np.median(before)) > 3 * max(float(np.std(before)), 1e-9)
        hit = np.flatnonzero(away[:-1] & away[1:])
        if len(hit):
            out.append(float(t[k + hit[0]] - t[k]))
    return out


def _sag(states: tuple[DriveState, ...], currents: tuple[Array, ...]) -> tuple[float, float, float]:
    """Slope of log speed over load, common to all commanded speeds, by runs."""
    rows = []
    for state, current in zip(states, currents, strict=True):
        if "speed" not in state.extra:
            return np.nan, np.nan, np.nan
        way = np.where(np.isfinite(state.effort), np.sign(state.velocity), 0)
        edges = np.r_[0, np.flatnonzero(np.diff(way)) + 1, len(way)]
        for a, b in pairwise(edges.tolist()):
            t = state.time_s[a:b]
            keep = np.arange(a, b)[(t > t[0] + RUN_IN_S) & (t < t[-1] - RUN_OUT_S)]
            speeds = state.extra["speed"][keep]
            if way[a] and len(keep) >= 10 and np.ptp(speeds) == 0 and speeds[0] > 0:
                ratio = way[a] * float(np.mean(state.velocity[keep]))
                rows.append((float(speeds[0]), np.log(ratio), way[a] * float(np.mean(current[keep]))))
    table = np.array(rows)
    if len(table) < 12:
        return np.nan, np.nan, np.nan
    speed, y, load = table.T
    levels = (speed[:, None] == np.unique(speed)[None]).astype(float)
    design = np.concatenate([levels, load[:, None]], axis=1)
    beta = np.linalg.lstsq(design, y, rcond=None)[0]
    residual = y - design @ beta
    spread = np.median(np.abs(residual)) / 0.6745
    covariance = np.linalg.pinv(design.T @ design) * spread**2
    return -float(beta[-1]), float(np.sqrt(covariance[-1, -1])), float(np.ptp(load))


def command_findings(facts: dict[str, CommandFacts], fingers: dict[str, str | None]) -> list[tuple[float, Finding]]:
    """Delays and sags of the session's drives; the least delayed drive shows what a healthy one does."""
    out = []
    medians = {a: float(np.median(f.latency_s)) for a, f in facts.items() if len(f.latency_s) >= 5}
    moved = {a: float(np.median(f.motion_s)) for a, f in facts.items() if len(f.motion_s) >= 5}
    for actuator, fact in facts.items():
        if actuator in medians:
            healthy = min(min(medians.values()), fact.step_s)
            late = fact.latency_s - healthy
            # Late current without late motion is a delayed channel, no delayed drive.
            also = len(moved) < 2 or moved.get(actuator, np.inf) - min(moved.values()) > fact.step_s
            if also and medians[actuator] - healthy > 1.5 * fact.step_s and np.mean(late > fact.step_s) > 0.7:
                out.append(_delay(actuator, fingers.get(actuator), fact, healthy))
        if np.isfinite(fact.sag) and fact.sag > SAG_T * fact.sag_se and fact.sag * fact.load_range > SAG_LEAST:
            out.append(_sag_finding(actuator, fingers.get(actuator), fact))
    return out


def refused(actuator: str, finger: str | None, trials: tuple[str, ...]) -> tuple[float, Finding]:
    """The finding of a current channel that is no measurement."""
    fit = {"metric": "current_rmse", "unit": "raw", "before": None, "after": None, "noise_floor": None, "ci95_reduction": None,
           "held_out": [], "engine": None}
    where = {**_where(actuator, finger), "signal": "current", "trials": list(trials)}
    text = f"The current of {actuator} is no measurement: it has no noise and does not follow the motion; nothing is fitted to it."
    return 1e9, Finding("command_as_measurement", ("command_as_measurement",), 0.999, (), where, text, {}, fit, None,
                        "the channel is refused")


def _where(actuator: str, finger: str | None) -> dict[str, object]:
    return {"finger": finger, "joint": None, "actuator": actuator, "signal": "command", "marker": None, "trials": [],
            "region": None, "share_of_mismatch": 1.0}


def _delay(actuator: str, finger: str | None, fact: CommandFacts, healthy: float) -> tuple[float, Finding]:
    value = float(np.median(fact.latency_s)) - healthy
    resample = np.random.default_rng(0).integers(0, len(fact.latency_s), (500, len(fact.latency_s)))
    low, high = np.percentile(np.median(fact.latency_s[resample], axis=1) - healthy, [2.5, 97.5])
    fit = {"metric": "command_latency", "unit": "s", "before": value, "after": float(np.std(fact.latency_s)),
           "noise_floor": fact.step_s, "ci95_reduction": None, "held_out": [], "engine": "events"}
    half = 0.5 * fact.step_s  # the event itself is known to a sample only
    parameters = {"delay": {"value": value, "unit": "s", "ci95": [float(low) - half, float(high) + half]}}
    text = f"The {actuator} motor answers its commands {1e3 * value:.0f} ms late."
    model = {"native": True, "mjcf": f"actuator[@name='{actuator}'] delay", "urdf": "not expressible: kept in hand.json"}
    weight = float(len(fact.latency_s)) * (value / fact.step_s) ** 2
    return weight, Finding("command_delay", ("command_delay",), 0.999, (), _where(actuator, finger), text, parameters, fit, model)


def _sag_finding(actuator: str, finger: str | None, fact: CommandFacts) -> tuple[float, Finding]:
    loss = fact.sag * fact.load_range
    parameters = {"sag": {"value": fact.sag, "unit": "1/raw", "ci95": [fact.sag - 1.96 * fact.sag_se, fact.sag + 1.96 * fact.sag_se]}}
    fit = {"metric": "speed_loss", "unit": "1", "before": loss, "after": 0.0, "noise_floor": fact.sag_se * fact.load_range,
           "ci95_reduction": None, "held_out": [], "engine": "strokes"}
    text = f"The {actuator} motor loses {100 * loss:.1f} % of its speed over the recorded loads."
    model = {"native": False, "mjcf": None, "urdf": "not expressible: kept in hand.json"}
    return 0.5 * (fact.sag / fact.sag_se) ** 2, Finding("drive_sag", ("drive_sag",), 0.999, (), _where(actuator, finger), text,
                                                       parameters, fit, model)
