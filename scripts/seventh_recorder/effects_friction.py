"""Effects that oppose the motion of the drive."""

import numpy as np

from .effect import Effect, Law, Settings, bump, scaled, spread
from .plan import Plan

Rng = np.random.Generator


def _stribeck(power: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        ratio, speed = 1 + s * spread(rng, 0.5, 1.25), rng.uniform(14, 34)
        plan.add("stribeck", (ratio - 1) * plan.scalar("Fc"))
        plan.drive |= {"vs": speed, "stribeck_power": power}
        return {"Fs_ratio": ratio, "vs": speed}

    return law


def _viscous_back(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * spread(rng, 0.8, 2.2) * plan.scalar("b")
    plan.add("b_back", size)
    return {"b_back": size}


def _tight_bell(plan: Plan, s: float, rng: Rng) -> Settings:
    size, centre, width = s * spread(rng, 0.35, 1.0), rng.uniform(22, 78), rng.uniform(5, 11)
    plan.add_friction(lambda q: size * plan.finger.motor["Fc"] * bump(centre, width)(q))
    return {"pos_amp": size, "pos_c": centre, "pos_w": width}


def _tight_flat(plan: Plan, s: float, rng: Rng) -> Settings:
    size, centre, half = s * spread(rng, 8, 25), rng.uniform(25, 75), rng.uniform(7, 14)
    plan.add_friction(lambda q: size * 0.5 * (1 - np.tanh((np.abs(q - centre) - half) / 1.5)))
    return {"raw": size, "centre": centre, "half_width": half}


def _hysteresis_exponential(plan: Plan, s: float, rng: Rng) -> Settings:
    size, way = s * spread(rng, 9, 24), rng.uniform(5, 16)
    plan.add("hysteresis", size)
    plan.drive["hysteresis_way"] = way
    return {"raw": size, "way": way}


def _hysteresis_blocks(plan: Plan, s: float, rng: Rng) -> Settings:
    size, way = s * spread(rng, 10, 24), rng.uniform(8, 20)
    for j, share in enumerate((0.3, 0.3, 0.4), start=1):
        plan.add(f"jenkins_{j}", size * share)
    plan.drive["jenkins_way"] = way
    return {"raw": size, "way": way, "law_of": "three blocks on springs"}


def _soft_bristles(plan: Plan, s: float, rng: Rng) -> Settings:
    softer = spread(rng, 5, 14)
    plan.drive["sigma0"] = plan.scalar("sigma0") / (1 + s * (softer - 1))
    return {"sigma0": plan.drive["sigma0"]}


def _yielding_block(plan: Plan, s: float, rng: Rng) -> Settings:
    share, way = s * spread(rng, 0.3, 0.6), rng.uniform(3, 7)
    plan.add("jenkins_1", share * plan.scalar("Fc"))
    plan.drive["jenkins_way"] = 2 * way
    plan.drive["Fc"] = plan.scalar("Fc") * (1 - share)
    return {"share": share, "way": way}


def _warms(plan: Plan, s: float, rng: Rng) -> Settings:
    size, tau = s * spread(rng, 0.3, 0.6), rng.uniform(40, 160)
    plan.drive |= {"warm": size, "warm_tau": tau}
    return {"warm": size, "tau": tau}


def _warms_each_time(plan: Plan, s: float, rng: Rng) -> Settings:
    size, tau = s * spread(rng, 0.35, 0.6), rng.uniform(10, 30)
    plan.drive |= {"warm": size, "warm_tau": tau}
    plan.cools_between = True
    return {"warm": size, "tau": tau, "cools_between": True}


_viscous_both = scaled("b_asymmetry", 0.5, 0.95, signed=True)
_coulomb_sides = scaled("Fc_asymmetry", 0.12, 0.35, signed=True)
_by_spring = scaled("mu_load", 0.5, 1.2)
_by_drive = scaled("mu_drive", 0.25, 0.5)
_quadratic = scaled("quadratic", 0.0025, 0.006)
_cubic = scaled("cubic", 1.5e-5, 4e-5)
EFFECTS = (
    Effect("stribeck_friction", "current", None, (_stribeck(2.0), _stribeck(1.0))),
    Effect("asymmetric_viscous_friction", "current", None, (_viscous_both, _viscous_back)),
    Effect("asymmetric_friction", "current", None, (_coulomb_sides,)),
    Effect("load_dependent_friction", "current", None, (_by_spring, _by_drive)),
    Effect("position_dependent_friction", "current", None, (_tight_bell, _tight_flat)),
    Effect("quadratic_damping", "current", None, (_quadratic, _cubic)),
    Effect("elastoplastic_hysteresis", "current", None, (_hysteresis_exponential, _hysteresis_blocks)),
    Effect("presliding_friction", "current", None, (_soft_bristles, _yielding_block)),
    Effect("thermal_friction_drift", "current", None, (_warms, _warms_each_time)),
)
