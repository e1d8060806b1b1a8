"""Effects that no vocabulary of this project holds: the right answer to them is "unexplained"."""

from __future__ import annotations

import math
import zlib

import numpy as np
from numpy.typing import NDArray

from ..influence import Draw, Influence, effect
from ..motor import DriveNow, DriveTerms, Motion
from ..schedule import TrialPlan

Array = NDArray[np.float64]
CLOSE_S = 1e-5  # between rows that were stamped at once


@effect("rhythmic_disturbance", "outside", "current", ("load", "pickup"))
def rhythmic(draw: Draw) -> Influence:
    """Something shakes the hand, or hums into the channel, with a rhythm of its own in time."""
    height = draw.raw("amplitude_raw", 0.10, 0.16)
    rate = 2 * math.pi * draw.uniform("frequency_hz", 0.6, 2.4)
    if draw.form == "load":
        return Influence(terms=DriveTerms(load=(lambda now: height * math.sin(rate * now.session_s),)))
    return Influence(current=lambda motion, raw: raw + height * np.sin(rate * (motion.session_start_s + motion.time_s)))


@effect("current_bias_walk", "outside", "current")
def bias_walk(draw: Draw) -> Influence:
    """The zero of the current channel wanders."""
    spread = draw.raw("spread_raw", 0.07, 0.11)
    memory = draw.uniform("memory_s", 4.0, 9.0)
    root = int(draw.rng.integers(2**31))

    def walk(motion: Motion, raw: Array) -> Array:
        rng = np.random.default_rng([root, zlib.crc32(repr(motion.session_start_s).encode())])
        coarse = np.arange(0.0, motion.time_s[-1] + 0.1, 0.1)
        keep, at = math.exp(-0.1 / memory), rng.normal()
        values = np.empty(len(coarse))
        for i, fresh in enumerate(rng.normal(size=len(coarse))):
            at = keep * at + math.sqrt(1 - keep**2) * fresh
            values[i] = at
        return raw + spread * np.interp(motion.time_s, coarse, values)

    return Influence(current=walk)


@effect("marker_noise_burst", "outside", "markers")
def noise_burst(draw: Draw) -> Influence:
    """For some seconds every marker of the finger is several times as noisy."""
    begin = draw.moment()
    end = draw.note("end_s", begin + draw.uniform("length_s", 4.0, 8.0))
    level = draw.size("noise_m", 8e-4, 1.5e-3)
    root = int(draw.rng.integers(2**31))
    own = {label for joint in draw.finger.joints for label in joint.markers_palm}

    def burst(trial: TrialPlan, time_s: Array, markers: dict[str, Array]) -> dict[str, Array]:
        rng = np.random.default_rng([root, zlib.crc32(trial.name.encode())])
        now = trial.start_s + time_s
        span = ((now >= begin) & (now < end))[:, None]
        return {k: p + span * level * rng.normal(size=p.shape) if k in own else p for k, p in markers.items()}

    return Influence(world=burst)


@effect("encoder_scale_change", "outside", "position")
def scale_change(draw: Draw) -> Influence:
    """The encoder's scale jumps in the middle of a trial and stays."""
    moment, change = draw.moment(), draw.size("change", 0.015, 0.03) * draw.sign()
    return Influence(encoder=lambda motion, p: p * (1.0 + change * (motion.session_start_s + motion.time_s >= moment)))


@effect("cycle_memory", "outside", "current", ("every_third", "alternating"))
def cycle_memory(draw: Draw) -> Influence:
    """Friction depends on how many cycles were made since the start of the trial."""
    height = draw.raw("height_raw", 0.2, 0.3)
    every = 3 if draw.form == "every_third" else 2
    state = [0.0, 0]  # last direction, reversals

    def start(trial: TrialPlan) -> None:
        state[:] = [0.0, 0]

    def advance(now: DriveNow, step_s: float) -> None:
        if abs(now.velocity) <= 1.0:  # at a reversal many steps are as slow as that
            return
        state[1] += now.velocity * state[0] < 0
        state[0] = math.copysign(1.0, now.velocity)

    def friction(now: DriveNow) -> float:
        return height if (state[1] // 2) % every == 0 else 0.0

    return Influence(start=start, terms=DriveTerms(friction=(friction,), advance=(advance,)))


@effect("current_spikes", "outside", "current")
def spikes(draw: Draw) -> Influence:
    """Bursts of interference: now and then the current reads far off for some hundredths of a second."""
    height, rate = draw.raw("height_raw", 0.5, 0.9), draw.uniform("rate_hz", 0.4, 0.9)
    root = int(draw.rng.integers(2**31))

    def burst(motion: Motion, raw: Array) -> Array:
        rng = np.random.default_rng([root, zlib.crc32(repr(motion.session_start_s).encode())])
        out = raw.copy()
        for begin in rng.uniform(0, motion.time_s[-1], rng.poisson(rate * motion.time_s[-1])):
            inside = (motion.time_s >= begin) & (motion.time_s < begin + rng.uniform(0.03, 0.08))
            out[inside] += height * rng.choice([-1.0, 1.0])
        return out

    return Influence(current=burst)


@effect("buffered_log", "outside", "time")
def buffered_log(draw: Draw) -> Influence:
    """Rows are stamped in packets: several samples carry times that were spread evenly after the fact."""
    size = max(2, round(draw.size("packet", 6, 12)))

    def log(trial: TrialPlan, columns: dict[str, Array]) -> dict[str, Array]:
        time_s = columns["time"].copy()
        edges = np.arange(0, len(time_s), size)
        late = np.interp(np.arange(len(time_s)), edges, time_s[edges])
        lag = 0.04 * (np.arange(len(time_s)) // size % 3)
        stamped = late + lag
        for i in range(1, len(stamped)):  # what waited comes at once, row after row
            stamped[i] = max(stamped[i], stamped[i - 1] + CLOSE_S)
        return columns | {"time": stamped}

    return Influence(log=log)
