"""What the hand reports, or is told, is not what happens: encoder, current channel, command, supply, clock."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..influence import Draw, Influence, effect
from ..motor import DriveNow, DriveTerms, Motion
from ..schedule import TrialPlan

Array = NDArray[np.float64]


@effect("encoder_periodic_error", "channel", "position", ("sine", "sawtooth"))
def encoder_periodic(draw: Draw) -> Influence:
    """An encoder error periodic in its own counts; the controller sees it too."""
    height = draw.size("amplitude_percent", 0.6, 1.0)
    turns = 1.0 / draw.uniform("period_percent", 8.0, 18.0)
    phase = draw.uniform("phase", 0.0, 1.0)

    def sine(p: float) -> float:
        return height * (math.sin(2 * math.pi * (turns * p + phase)) - math.sin(2 * math.pi * phase))

    def sawtooth(p: float) -> float:
        # Rises over most of the period, falls back over a fifth: still a monotonic encoder.
        def tooth(x: float) -> float:
            x -= math.floor(x)
            return 2.0 * x / 0.8 - 1.0 if x < 0.8 else 1.0 - 2.0 * (x - 0.8) / 0.2

        return height * (tooth(turns * p + phase) - tooth(phase))

    error = sine if draw.form == "sine" else sawtooth
    return Influence(
        terms=DriveTerms(sense=(error,)),
        encoder=lambda motion, percent: percent + np.array([error(p) for p in motion.position.tolist()]),
    )


@effect("drive_sag", "channel", "current", ("speed", "supply", "torque"))
def drive_sag(draw: Draw) -> Influence:
    """The drive delivers less speed per command as it is loaded, at once or as its supply droops; or less torque per
    current the more it asks for.

    (The same share of every torque would only rescale friction, damping and spring.)
    """
    share = draw.size("share_per_100_raw", 0.14, 0.24)
    if draw.form == "torque":
        return Influence(
            terms=DriveTerms(load=(lambda now: now.current * min(0.45, share * abs(now.current) / 100.0),))
        )
    droop = [0.0]

    def start(trial: TrialPlan) -> None:
        droop[0] = 0.0

    def advance(now: DriveNow, step_s: float) -> None:
        time_s = 0.25 if draw.form == "supply" else 0.03
        droop[0] += step_s / time_s * (abs(now.current) / 100.0 - droop[0])

    return Influence(
        start=start, terms=DriveTerms(speed_factor=(lambda now: max(0.3, 1.0 - share * droop[0]),), advance=(advance,))
    )


@effect("command_delay", "channel", "position")
def command_delay(draw: Draw) -> Influence:
    """The drive acts later than the log says it was told."""
    return Influence(terms=DriveTerms(command_delay_s=draw.size("delay_s", 0.06, 0.13)))


@effect("current_saturation", "channel", "current", ("reading", "drive", "soft_reading"))
def current_saturation(draw: Draw) -> Influence:
    """The current reading, or the drive itself, clips below the peaks of fast motion."""
    motor = draw.motor
    peak = motor.coulomb + motor.viscous * motor.controller.speed_full + 100.0 * motor.stiffness + motor.preload
    cut = draw.size("share_cut", 0.18, 0.28)
    if draw.form == "drive":
        # Enough is left to close the finger slowly: what is cut away is what speed needs.
        level = draw.note("level_raw", peak - min(0.9, 2.6 * cut) * motor.viscous * motor.controller.speed_full)
        return Influence(terms=DriveTerms(current_limit=level))
    level = draw.note("level_raw", peak * (1.0 - min(0.5, cut)))
    if draw.form == "reading":
        return Influence(current=lambda motion, raw: np.clip(raw, -level, level))
    knee = 0.12 * level
    return Influence(
        current=lambda motion, raw: np.where(
            raw < level - knee, raw, level - knee * np.exp(-(raw - level + knee) / knee)
        )
    )


@effect("current_channel_delay", "channel", "current", ("delay", "lag", "early"))
def current_delay(draw: Draw) -> Influence:
    """The current channel reports the past: a pure delay, or the lag of a first-order filter; or what the position will
    show only later."""
    delay = draw.size("delay_s", 0.035, 0.07)

    def shifted(motion: Motion, raw: Array) -> Array:
        if draw.form != "lag":
            return np.interp(motion.time_s - (delay if draw.form == "delay" else -delay), motion.time_s, raw)
        keep = math.exp(-(motion.time_s[1] - motion.time_s[0]) / max(delay, 1e-6))
        out, at = np.empty_like(raw), raw[0]
        for i, x in enumerate(raw.tolist()):
            at = keep * at + (1.0 - keep) * x
            out[i] = at
        return out

    return Influence(current=shifted)


@effect("command_as_measurement", "channel", "current", ("dead", "constant_noise", "command", "position_echo"))
def command_as_measurement(draw: Draw) -> Influence:
    """A channel that is dead, or that repeats the command instead of measuring."""
    if draw.form == "position_echo":
        draw.where["signal"] = "position"
    root = int(draw.rng.integers(2**31))

    def log(trial: TrialPlan, columns: dict[str, Array]) -> dict[str, Array]:
        out, n = dict(columns), len(columns["time"])
        if draw.form == "position_echo":
            out["position"] = columns["setpoint"].copy()
        elif draw.form == "dead":
            out["current"] = np.zeros(n)
        elif draw.form == "constant_noise":
            out["current"] = np.round(12.0 + np.random.default_rng([root, n]).normal(0, 1.0, n))
        else:
            middle = 0.5 * (draw.motor.counts_open + draw.motor.counts_close)
            out["current"] = np.round(0.35 * columns["speed"] * np.sign(columns["setpoint"] - middle))
        return out

    return Influence(log=log)


@effect("clock_drift", "channel", "time")
def clock_drift(draw: Draw) -> Influence:
    """The log's clock runs at another rate than the mocap's."""
    return Influence(clock_rate=1.0 + draw.size("rate_error", 4e-4, 9e-4) * draw.sign())
