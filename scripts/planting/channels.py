"""Faults of log, drive and encoder. Counts as logged, currents in raw units, times in s."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_smoothing_spline

from .plant import Array, Columns, Draw, Motor, Moving, Plant


def encoder_periodic_error(rng: Draw, size: float, motor: Motor) -> Plant:
    """An encoder whose error is periodic in position."""
    period, amplitude, phase = rng.uniform(300, 1500), size * rng.uniform(14, 40), rng.uniform(0, 2 * np.pi)

    def read(columns: Columns, m: Moving) -> Columns:
        counts = m.place * (motor.high - motor.low) / 100
        error = amplitude * np.sin(2 * np.pi * counts / period + phase)
        return {**columns, "position": np.round(columns["position"] + error)}

    return Plant(columns=read, figures={"period": period, "amplitude": amplitude})


def command_delay(rng: Draw, size: float, motor: Motor) -> Plant:
    """A drive that obeys late: what it is told is told earlier."""
    delay = size * rng.uniform(0.06, 0.2)

    def told(columns: Columns, m: Moving) -> Columns:
        row = np.clip(np.searchsorted(m.time_s, m.time_s + delay, side="right") - 1, 0, len(m.time_s) - 1)
        return {n: v[row] if n in ("setpoint", "speed", "current_limit") else v for n, v in columns.items()}

    return Plant(columns=told, figures={"delay": delay})


def current_channel_delay(rng: Draw, size: float, motor: Motor) -> Plant:
    """A current that is logged late or early against the position."""
    delay = size * rng.choice([-1, 1]) * rng.uniform(0.02, 0.06)

    def late(columns: Columns, m: Moving) -> Columns:
        known = np.isfinite(columns["current"])
        course = make_smoothing_spline(m.time_s[known], columns["current"][known], lam=1e-7)
        at = np.clip(m.time_s - delay, m.time_s[known][0], m.time_s[known][-1])
        return {**columns, "current": np.round(columns["current"] + course(at) - course(m.time_s))}

    return Plant(columns=late, figures={"delay": delay})


def current_saturation(rng: Draw, size: float, motor: Motor) -> Plant:
    """A reading that clips."""
    running = motor.coulomb + 97 * motor.stiffness + motor.preload + 115 * motor.viscous
    limit = np.round(running * (1 - size * rng.uniform(0.12, 0.25)))

    def read(columns: Columns, m: Moving) -> Columns:
        return {**columns, "current": np.clip(columns["current"], -limit, limit)}

    return Plant(columns=read, figures={"limit": limit})


def clock_drift(rng: Draw, size: float, motor: Motor) -> Plant:
    """A log whose clock runs fast or slow."""
    rate = 1 + size * rng.choice([-1, 1]) * rng.uniform(0.0007, 0.002)

    def stamped(columns: Columns, m: Moving) -> Columns:
        t = columns["time"]
        return {**columns, "time": t[0] + rate * (t - t[0])}

    return Plant(columns=stamped, figures={"rate": rate})


def command_as_measurement(rng: Draw, size: float, motor: Motor) -> Plant:
    """A column that was never measured."""
    form = str(rng.choice(["position", "zero", "limit"]))

    def dead(columns: Columns, m: Moving) -> Columns:
        if form == "position":
            return {**columns, "position": columns["setpoint"]}
        way = np.where(columns["setpoint"] > 0.5 * (motor.low + motor.high), 1.0, -1.0)
        current: Array = 0.0 * way if form == "zero" else np.round(way * columns["current_limit"])
        return {**columns, "current": current}

    return Plant(columns=dead, figures={"form": form})


CHANNELS = (
    encoder_periodic_error,
    command_delay,
    current_channel_delay,
    current_saturation,
    clock_drift,
    command_as_measurement,
)
