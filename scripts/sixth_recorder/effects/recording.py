"""What the log makes of position, current and time."""

from __future__ import annotations

import numpy as np

from sixth_recorder.effects.law import Context, Law
from sixth_recorder.machine import H, Machine, Truth
from sixth_recorder.plant import Q_GRID, lag


def encoder_periodic_error(x: Context) -> Law:
    """An encoder that is off periodically, in the feedback too; the amplitude in %."""
    period, law = x.uniform(3, 16), x.pick("sine", "two_harmonics", "sawtooth_like")
    z = 2 * np.pi * Q_GRID / period + x.uniform(0, 6.28)
    shape = {
        "sine": np.sin(z),
        "two_harmonics": 0.9 * np.sin(z) + 0.4 * np.sin(2 * z + 0.7),
        "sawtooth_like": np.sin(z) + 0.5 * np.sin(2 * z) + 0.33 * np.sin(3 * z),
    }[law]

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.encoder += amplitude * shape

    return Law({"law": law, "period_counts": period * x.finger.counts / 100}, hide, 0.3, 2.0)


def current_channel_delay(x: Context) -> Law:
    """One column of the log late against the other; the amplitude in s."""
    law = x.pick("late_current", "late_current", "late_position", "low_pass_current")

    def hide(machine: Machine, amplitude: float) -> None:
        def late(y: np.ndarray, truth: Truth) -> np.ndarray:
            return np.interp(truth["t"] - amplitude, truth["t"], y)

        if law == "late_position":
            machine.position_stages.append(late)
        elif law == "low_pass_current":
            machine.current_stages.append(lambda y, truth: lag(y, H, amplitude, amplitude))
        else:
            machine.current_stages.append(late)

    return Law({"law": law}, hide, 0.03, 0.12)


def command_as_measurement(x: Context) -> Law:
    """A column that is not measured at all."""
    law = x.pick("position_is_setpoint", "current_dead", "current_is_speed_command", "position_is_reference")
    dead = x.coulomb * x.uniform(-0.2, 0.6)

    def replace(rows: dict[str, np.ndarray], t: np.ndarray) -> dict[str, np.ndarray]:
        match law:
            case "position_is_setpoint":
                return rows | {"position": rows["setpoint"].copy()}
            case "current_dead":
                return rows | {"current": np.full(len(t), np.round(dead)) + 0.0}
            case "current_is_speed_command":
                way = np.sign(rows["setpoint"] - x.finger.open - 1)
                return rows | {"current": np.round(rows["speed"] * 0.3 * way)}
        return rows | {"position": np.round(_reference(x, rows, t))}

    return Law({"law": law}, lambda machine, amplitude: machine.on_rows.append(replace), 1.0, 1.0)


def _reference(x: Context, rows: dict[str, np.ndarray], t: np.ndarray) -> np.ndarray:
    """Where the finger would be (counts) if it went at the speed that it is told."""
    y, last, out = x.finger.open + 0.0, t[0], np.empty(len(t))
    for i, now in enumerate(t):
        step = rows["speed"][i] / 255 * x.lab.speed_full * x.finger.counts / 100 * (now - last)
        last = now
        y += np.clip(rows["setpoint"][i] - y, -step, step)
        out[i] = y
    return out


def clock_drift(x: Context) -> Law:
    """The clock of all logs runs fast or slow; the amplitude in s per s."""
    law, sign = x.pick("constant", "constant", "warming"), x.sign()
    end, offset = x.lab.t_end, x.lab.clock_offset

    def hide(machine: Machine, amplitude: float) -> None:
        def ahead(at: np.ndarray) -> np.ndarray:
            if law == "constant":
                return sign * amplitude * at
            return sign * amplitude * (at * 0.5 + 0.9 * at**2 / end)

        for each in machine.all_machines:
            each.on_log_time.append(lambda stamps: stamps + ahead(stamps - offset))
        machine.clock = ahead

    return Law({"law": law, "sign": sign}, hide, 1e-3, 4e-3)
