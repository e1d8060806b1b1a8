"""What the drive does to commands and the current."""

from __future__ import annotations

import numpy as np

from sixth_recorder.effects.law import Context, Law
from sixth_recorder.machine import Machine


def drive_sag(x: Context) -> Law:
    """Slower where the load is high."""
    law, tau = x.pick("linear", "supply_resistance", "power"), x.pick(0.01, 0.08, 0.3)
    number = {"linear": 0.0, "supply_resistance": 1.0, "power": 2.0}[law]

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.p.update(SAG=amplitude, SAGTAU=tau, SAGPOW=number)

    share = x.uniform(0.08, 0.15)
    return Law({"law": law, "time_constant": tau}, hide, share, share)


def command_delay(x: Context) -> Law:
    """Commands that act late."""
    delay = x.uniform(0.06, 0.14)  # s

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.p["DELAY"] = amplitude

    return Law({}, hide, delay, delay)


def current_saturation(x: Context) -> Law:
    """A largest current, of the reading or of the drive itself."""
    readings = ("hard_reading", "soft_reading", "one_sided_reading")
    law = x.pick(*readings, "drive") if x.alone else x.pick(*readings)  # with other loads a limited drive may stall
    return _drive_limit(x) if law == "drive" else _reading_limit(x, law)


def _drive_limit(x: Context) -> Law:
    need = x.coulomb + 100 * x.p["K_"] + x.p["TAU0"]
    most = need + 0.9 * x.p["B_"] * x.lab.speed_full
    share = x.uniform(0.55, 0.8)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.p["ILIM"] = most - amplitude * (most - need)

    parameters = {"law": "drive", "limit_at_full": most - share * (most - need)}
    return Law(parameters, hide, share, share, "fixed")


def _reading_limit(x: Context, law: str) -> Law:
    def hide(machine: Machine, amplitude: float) -> None:
        limit = x.coulomb * 2.6 * np.exp(-amplitude)

        def soft(current: np.ndarray) -> np.ndarray:
            over = 0.85 * limit + 0.15 * limit * np.tanh((abs(current) - 0.85 * limit) / (0.15 * limit))
            return np.where(abs(current) < 0.85 * limit, current, np.sign(current) * over)

        def rounded(reading: np.ndarray, quantum: float) -> np.ndarray:
            most = np.floor(limit / quantum) * quantum
            return np.clip(reading, -1e9 if law == "one_sided_reading" else -most, most)

        shown = {
            "hard_reading": lambda current, truth: np.clip(current, -limit, limit),
            "soft_reading": lambda current, truth: soft(current),
            "one_sided_reading": lambda current, truth: np.minimum(current, limit),
        }
        machine.current_stages.append(shown[law])
        if law != "soft_reading":
            machine.reading_limits.append(rounded)

    return Law({"law": law}, hide, 0.45, 1.15)
