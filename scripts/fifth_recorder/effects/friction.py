"""Friction that the declared model lacks. Forms are numbered as in stepper.c."""

import numpy as np

from fifth_recorder.effects.option import Context, Draw, Option, log_uniform, pick, set_dynamics
from fifth_recorder.plan import Plan, Signals, Trial
from fifth_recorder.stepper import Drive

PRELOAD_SPREAD = 0.12  # by which the preloads of one hand's motors differ


def _dynamic(form: str, scaled: dict[str, float], fixed: dict[str, float]) -> Option:
    return Option(form, lambda plan, strength: set_dynamics(plan, strength, scaled, fixed))


def stribeck(rng: np.random.Generator, _: Context) -> Option:
    """Friction that rises towards standstill."""
    form, number = pick(rng, ("exponential", "gaussian", "reciprocal"))
    return _dynamic(form, {"st_amp": rng.uniform(0.4, 1.0)}, {"st_speed": rng.uniform(8, 30), "st_form": number})


def asymmetric_viscous(rng: np.random.Generator, _: Context) -> Option:
    """Viscous friction that differs by direction."""
    form, number = pick(rng, ("both_ways", "flexion_only", "extension_only"))
    sign = rng.choice([-1, 1]) if number == 0 else 1
    return _dynamic(form, {"visc_amp": sign * rng.uniform(0.35, 0.8)}, {"visc_form": number})


def asymmetric(rng: np.random.Generator, ctx: Context) -> Option:
    """Coulomb friction that differs by direction: for the current a preload, unlike the other motor's."""
    form, number = pick(rng, ("both_ways", "flexion_only"))
    share = rng.choice([-1, 1]) * rng.uniform(0.2, 0.45)
    if number == 1:
        share = abs(share)  # more friction in flexion: less would leave none
    option = _dynamic(form, {"asym_friction": share}, {"asym_form": number})
    motor = ctx.finger.motor
    option.beside = lambda strength: 0.5 * (strength * share * motor.Fc / (PRELOAD_SPREAD * motor.tau0)) ** 2
    return option


def load_dependent(rng: np.random.Generator, _: Context) -> Option:
    """Friction that grows with the load."""
    form, number = pick(rng, ("spring_load", "spring_and_inertia", "total_transmitted"))
    return _dynamic(form, {"load_mu": rng.uniform(0.2, 0.5)}, {"load_form": number})


def position_dependent(rng: np.random.Generator, _: Context) -> Option:
    """A tight spot."""
    form, number = pick(rng, ("gaussian", "raised_cosine", "smooth_box"))
    return _dynamic(
        form,
        {"spot_amp": rng.uniform(0.5, 1.2)},
        {"spot_at": rng.uniform(25, 75), "spot_width": rng.uniform(4, 10), "spot_form": number},
    )


def presliding(rng: np.random.Generator, _: Context) -> Option:
    """Give before sliding; the strength is the share of the friction that is soft."""
    form, number = pick(rng, ("lugre", "dahl", "linear_then_saturated"))
    distance = rng.uniform(3.0, 9.0) * (0.6 if number == 0 else 1.0)
    return _dynamic(form, {"soft_share": 1.0}, {"soft_distance": distance, "soft_form": number})


def thermal(rng: np.random.Generator, _: Context) -> Option:
    """Friction that changes as the drive warms up."""
    form, number = pick(rng, ("over_trial", "over_session", "by_power"))
    size, tau = (
        rng.choice([-1, -1, 1]) * rng.uniform(0.2, 0.45),
        rng.uniform(8, 25) if number == 0 else rng.uniform(50, 150),
    )
    column = rng.random() < 0.4

    def warmth(trial: Trial, t: np.ndarray) -> np.ndarray:
        if number == 0:
            return 1.0 - np.exp(-t / tau)
        return 1.0 - np.exp(-(t + trial.at) / tau)

    def apply(plan: Plan, strength: float) -> dict:
        if number == 2:
            plan.dyn.heat_power, plan.dyn.heat_power_rise, plan.dyn.heat_power_fall = size * strength, tau / 6, tau
        else:

            def warm(drive: Drive, trial: Trial, t: np.ndarray) -> None:
                drive.heat += size * strength * warmth(trial, t)

            plan.drive.append(warm)
        if column and strength > 0.3:

            def show(signals: Signals) -> None:
                signals.extra["temperature"] = 24.0 + 14.0 * signals.extra["heat"] / (size * strength)

            plan.signals.append(show)
        return {"share": size * strength, "tau": tau, "temperature_column": column and strength > 0.3}

    return Option(form, apply)


def quadratic_damping(rng: np.random.Generator, _: Context) -> Option:
    """Drag that grows faster than speed."""
    form, number = pick(rng, ("square", "power_2.5", "cube"))
    return _dynamic(form, {"drag_amp": log_uniform(rng, 12, 35)}, {"drag_power": (2.0, 2.5, 3.0)[int(number)]})


FRICTION: dict[str, Draw] = {
    "stribeck_friction": stribeck,
    "asymmetric_viscous_friction": asymmetric_viscous,
    "asymmetric_friction": asymmetric,
    "load_dependent_friction": load_dependent,
    "position_dependent_friction": position_dependent,
    "presliding_friction": presliding,
    "thermal_friction_drift": thermal,
    "quadratic_damping": quadratic_damping,
}
