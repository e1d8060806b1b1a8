"""How each effect is hidden in a law: its strength drawn against what the joint does without it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .law import LOAD_SIDES, Law

# As the findings name them -> names that say the same of one joint's balance.
SAME = {
    "off_axis": {"gravity_load", "asymmetric_friction"},
    "asymmetric_friction": {"asymmetric_friction", "gravity_load"},
    "late_channel": {"current_channel_delay"},
    "late_drive": {"command_delay", "current_channel_delay"},
    "presliding": {"presliding_friction", "elastoplastic_hysteresis"},
}


@dataclass(frozen=True)
class Scale:
    """What is usual at a joint: effort, speed and range (of position), all SI."""

    effort: float
    speed: float
    range: float
    centre: float = 0.0


def names(effect: str) -> set[str]:
    """Names of findings that name this effect."""
    return SAME.get(effect, {effect})


def hidden(law: Law, effect: str, scale: Scale, random: np.random.Generator) -> Law:
    """The law with an effect in it; delays are no business of a law."""
    strong = random.uniform(0.6, 1.4)
    friction = max(law.coulomb, 0.04 * scale.effort)
    place = (scale.centre + scale.range * random.uniform(-0.25, 0.25), scale.range * random.uniform(0.05, 0.12))
    if effect == "load_dependent_friction":
        if random.uniform() < 0.3:
            return replace(
                law,
                slow_load=0.25 * strong,
                by_load=0.05,
                stribeck_speed=0.25 * scale.speed,
                load_side=str(random.choice(LOAD_SIDES)),
            )
        return replace(law, by_load=0.2 * strong, load_side=str(random.choice(LOAD_SIDES)))
    if effect == "stribeck_friction":
        return replace(law, stribeck=1.2 * strong * friction, stribeck_speed=random.uniform(0.12, 0.35) * scale.speed)
    if effect == "asymmetric_viscous_friction":
        viscous = max(law.viscous, 0.12 * scale.effort / scale.speed)
        return replace(law, viscous=viscous, asymmetry=0.35 * strong * random.choice([-1, 1]))
    if effect == "quadratic_damping":
        return replace(law, drag=0.12 * strong * scale.effort / scale.speed**2)
    if effect == "position_dependent_friction":
        return replace(law, tight=(*place, 1.5 * strong * friction))
    if effect == "detent_load":
        return replace(law, spot=(*place, 0.25 * strong * scale.effort))
    if effect == "elastoplastic_hysteresis":
        return replace(
            law,
            coulomb=0.3 * law.coulomb,
            stop=(1.2 * strong * friction + 0.7 * law.coulomb, random.uniform(0.03, 0.1) * scale.range),
        )
    if effect == "asymmetric_friction":
        return replace(law, offset=1.2 * strong * friction * random.choice([-1, 1]))
    if effect == "off_axis":
        return replace(law, tilt=0.15 * strong * random.choice([-1, 1]))
    if effect == "outside_grit":
        return replace(law, grit=(0.7 * friction, 0.3))
    if effect == "outside_slosh":
        inertia = 0.15 * law.inertia
        return replace(law, slosh=(inertia * (2 * np.pi * 2.5) ** 2, inertia, 0.1 * inertia * 2 * np.pi * 2.5))
    return law


def imperfect(law: Law, scale: Scale, random: np.random.Generator) -> Law:
    """The law with what every machine has besides: a ripple, a zero that is not quite zero."""
    ripple = (
        scale.effort * random.uniform(0.002, 0.008),
        scale.range * random.uniform(0.03, 0.3),
        random.uniform(0, 6),
    )
    return replace(
        law,
        ripple=ripple,
        tilt=law.tilt + random.normal(0, 0.004),
        offset=law.offset + 0.004 * scale.effort * random.normal(),
    )
