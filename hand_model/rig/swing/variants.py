"""What may be missing at a simulated joint: the forms of every effect, and what is free beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..laws import PRELOADED, UNDECLARED
from .free import swings_free
from .simulation import DECLARED, INDEX, NEUTRAL, Swing, usual_range, usual_speed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Variant:
    """One way an effect can act: starting values of the parameters it frees (fractions of the declared scale)."""

    effect: str
    name: str
    start: Mapping[str, float]

    @property
    def key(self) -> str:
        """effect, with the variant where there is one."""
        return self.effect + (f"/{self.name}" if self.name else "")

    @property
    def form(self) -> str:
        """Its name where that says how the effect acts, not where the search begins."""
        return "" if self.name.replace(".", "").isdigit() else self.name


REACHES = (1e-3, 1e-2)  # of the range: where the search for the way begins over which friction turns round
# Of a free swing the same as an encoder's zero that is off.
ZERO = Variant("gravity_load", "centre of mass off its axis", {"lateral": 0.0})


def variants(swing: Swing) -> tuple[Variant, ...]:
    """What may be missing at a joint driven by a voltage (or by nothing)."""
    speed = usual_speed(swing)
    out = [
        Variant("stribeck_friction", f"{k:g}", {"static_excess": 0.0, "stribeck_speed": k * speed})
        for k in ((0.2,) if swings_free(swing) else (0.05, 0.2, 0.8))  # these look for it themselves
    ]
    out += [
        Variant("asymmetric_friction", "", {"offset": 0.0}),
        Variant("asymmetric_viscous_friction", "", {"damping_asymmetry": 0.0}),
        Variant("quadratic_damping", "", {"drag": 0.0}),
    ]
    reaches = [max(k * usual_range(swing), 2.0 * swing.resolution) for k in REACHES]
    out += [Variant("presliding_friction", f"{k:g}", {"reach": r}) for k, r in zip(REACHES, reaches, strict=True)]
    if not swing.sine and not swing.cosine:
        out.append(Variant("nonlinear_spring", "", {"stiffness": 0.0}))
    else:  # whose arc tells it from a spring
        out += [
            Variant("nonlinear_spring", UNDECLARED, {"stiffness": 0.0}),
            Variant("nonlinear_spring", PRELOADED, {"stiffness": 0.0, "offset": 0.0}),
            Variant("load_dependent_friction", "external", {"load_external": 0.0}),
            Variant("load_dependent_friction", "low speed", {"load_external_low": 0.0, "stribeck_speed": 0.2 * speed}),
            ZERO,
        ]
        if not swings_free(swing):  # beside a zero that is free an offset goes by its own name
            out.append(Variant("gravity_load", "off its axis, and offset", {"lateral": 0.0, "offset": 0.0}))
    if swing.driven:
        out += [
            Variant("load_dependent_friction", "with speed", {"load_speed": 0.0}),
            Variant("load_dependent_friction", "gear", {"load_gear": 0.0}),
            Variant("load_dependent_friction", "carried", {"load_carried": 0.0}),
            Variant(
                "load_dependent_friction",
                "carried, low speed",
                {"load_carried_low": 0.0, "stribeck_speed": 0.2 * speed},
            ),
            Variant("load_dependent_friction", "motor", {"load_motor": 0.0}),
            Variant("load_dependent_friction", "directional", {"load_motor": 0.0, "load_external": 0.0}),
            Variant(
                "load_dependent_friction", "gear, low speed", {"load_gear_low": 0.0, "stribeck_speed": 0.2 * speed}
            ),
            Variant(
                "load_dependent_friction",
                "driven load squared, low speed",
                {"external_squared": 0.0, "stribeck_speed": speed},
            ),
            Variant(
                "load_dependent_friction",
                "load squared, low speed",
                {"motor_squared": 0.0, "external_squared": 0.0, "stribeck_speed": speed},
            ),
            Variant("drive_sag", "", {"sag": 0.0}),
            Variant("command_delay", "", {"delay": 0.005}),
        ]
        ripple = {"ripple_sine": 0.0, "ripple_cosine": 0.0}
        out += [
            Variant("torque_ripple", f"{k}", {**ripple, "ripple_period": period})
            for k, period in enumerate(swing.periods)
        ]
        if any(np.any(lane.supply) for lane in swing.lanes):
            out.append(Variant("drive_sag", "supply", {"supply": 0.0}))
    return tuple(out)


def free_declared(swing: Swing) -> tuple[str, ...]:
    """The declared parameters of this joint; the scale (the weight) is not among them."""
    return tuple(
        n for n in DECLARED if n in swing.initial and (n != "inertia" or swing.sine or swing.cosine or swing.driven)
    )


def all_free(swing: Swing, taken: Sequence[Variant]) -> tuple[str, ...]:
    """Names of the declared parameters and of those that the variants taken free."""
    names = list(free_declared(swing)) + [name for v in taken for name in v.start]
    return tuple(dict.fromkeys(names))


def begun(theta: Array, variant: Variant) -> Array:
    """Parameters with what the variant frees where it begins."""
    out = theta.copy()
    for name, value in variant.start.items():
        if name != "stribeck_speed" or out[INDEX[name]] == 1.0:
            out[INDEX[name]] = value
    return out


def asked(swing: Swing, taken: Sequence[Variant]) -> tuple[str, ...]:
    """What is free while effects compete: of a free swing the encoder's zero too. It is no law, as little as the start
    is; held where it is wrong, it takes more than friction does, and each law is judged by how it makes up for it."""
    zero = tuple(ZERO.start) if swings_free(swing) else ()
    return tuple(dict.fromkeys((*all_free(swing, taken), *zero)))


def acts(variant: Variant, theta: Array) -> bool:
    """Whether anything is left of a variant."""
    return any(theta[INDEX[n]] != 0.0 for n in variant.start if n not in NEUTRAL)


__all__ = ["ZERO", "Variant", "acts", "all_free", "asked", "begun", "free_declared", "variants"]
