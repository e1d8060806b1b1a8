"""Friction that the declared model lacks."""

from __future__ import annotations

import numpy as np

from sixth_recorder.effects.law import Context, Law, bump
from sixth_recorder.machine import Machine
from sixth_recorder.plant import Q_GRID, V_GRID, Series


def stribeck_friction(x: Context) -> Law:
    """Friction that rises towards standstill."""
    law = x.pick("exp0.5", "exp1", "exp2", "lorentz", "hyperbolic")
    speed = x.log_uniform(5, 24)
    z = abs(V_GRID) / speed
    shape = {
        "exp0.5": np.exp(-(z**0.5)),
        "exp1": np.exp(-z),
        "exp2": np.exp(-z * z),
        "lorentz": 1 / (1 + z * z),
        "hyperbolic": 1 / (1 + z),
    }[law]

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.friction_v += amplitude * x.coulomb * shape

    return Law({"law": law, "stribeck_speed": speed}, hide, 0.5, 1.3)


def asymmetric_viscous_friction(x: Context) -> Law:
    """Viscous friction that differs by direction."""
    sign, law = x.sign(), x.pick("linear", "one_sided", "power0.8")
    shape = {
        "linear": sign * abs(V_GRID),
        "one_sided": np.where(sign * V_GRID > 0, 2 * sign * abs(V_GRID), 0),
        "power0.8": sign * abs(V_GRID / 60) ** 0.8 * 60,
    }[law]

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.load_v += amplitude * x.p["B_"] * shape

    most = 0.9 if law == "linear" else 1.5
    return Law({"law": law, "larger_in": "flexion" if sign > 0 else "extension"}, hide, 0.4, most)


def asymmetric_friction(x: Context) -> Law:
    """Coulomb friction that differs by direction."""
    sign = x.sign()

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.friction_v += amplitude * sign * x.coulomb * np.sign(V_GRID)

    return Law({"larger_in": "flexion" if sign > 0 else "extension"}, hide, 0.25, 0.25)


def load_dependent_friction(x: Context) -> Law:
    """Friction that grows with the load."""
    law = x.pick("proportional", "efficiency", "with_inertia")
    back = x.uniform(0.3, 0.7) if law == "efficiency" else 1.0
    inertia = 1.0 if law == "with_inertia" else 0.0

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.p.update(MU=amplitude, MUBACK=back, MUINER=inertia)

    return Law({"law": law, "backdrive_share": back}, hide, 0.3, 0.9)


def position_dependent_friction(x: Context) -> Law:
    """A tight spot."""
    law = x.pick("gaussian", "raised_cosine", "box", "triangle")
    centre, width = x.uniform(18, 82), x.uniform(3, 9)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.friction_q += amplitude * x.coulomb * bump(law, (Q_GRID - centre) / width)

    return Law({"law": law, "centre": centre, "width": width}, hide, 0.4, 1.5)


def quadratic_damping(x: Context) -> Law:
    """Drag that grows faster than speed."""
    exponent = x.pick(2.0, 2.0, 2.4, 1.75)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.load_v += amplitude * x.coulomb * np.sign(V_GRID) * abs(V_GRID / 80) ** exponent

    return Law({"exponent": exponent}, hide, 0.6, 3.0)


def presliding_friction(x: Context) -> Law:
    """Give before sliding; the amplitude is its distance, %."""
    law = x.pick("dahl", "lugre_like", "stiff_then_soft")
    exponent = {"dahl": 1.0, "lugre_like": 2.0, "stiff_then_soft": 0.6}[law]

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.p.update(ZS=amplitude, ZEXP=exponent)

    return Law({"law": law}, hide, 0.6, 3.0)


def thermal_friction_drift(x: Context) -> Law:
    """Friction that changes as the drive warms up."""
    law = x.pick("heat_of_current", "heat_of_friction", "time")
    tau, sign = x.log_uniform(20, 90), x.pick(-1, -1, -1, 1)

    def hide(machine: Machine, amplitude: float) -> None:
        if law == "time":
            first = x.trials[0]["t0"]
            begins = {trial["name"]: trial["t0"] - first for trial in x.trials}

            def warm(trial: dict, t: np.ndarray) -> Series:
                warmth = 1 - np.exp(-(begins[trial["name"]] + t) / (tau * 1.5))
                return {"friction_factor": 1 + sign * amplitude * warmth}

            machine.plant.per_trial.append(warm)
            return
        of_current = law == "heat_of_current"
        machine.plant.p.update(
            THA=sign * amplitude,
            THTAU=tau,
            THMODE=0.0 if of_current else 1.0,
            THREF=x.coulomb * (1.15 if of_current else 0.9),
        )

    return Law({"law": law, "time_constant": tau, "sign": sign}, hide, 0.3, 0.6)
