"""Friction and damping of the drive beyond Coulomb plus viscous."""

from __future__ import annotations

import math

from ..influence import Draw, Influence, effect
from ..motor import DriveNow, DriveTerms
from ..schedule import TrialPlan
from .shapes import BUMPS, bump


@effect("stribeck_friction", "drive", "current", ("exponential", "gaussian", "lorentzian", "tanh"))
def stribeck(draw: Draw) -> Influence:
    """Friction falls from a higher static level as speed rises."""
    rise = draw.raw("static_excess_raw", 0.55, 0.85)
    scale = draw.uniform("stribeck_speed", 12.0, 28.0)
    curve = {
        "exponential": lambda s: math.exp(-s),
        "gaussian": lambda s: math.exp(-s * s),
        "lorentzian": lambda s: 1.0 / (1.0 + s * s),
        "tanh": lambda s: 1.0 - math.tanh(s),
    }[draw.form]
    return Influence(terms=DriveTerms(friction=(lambda now: rise * curve(abs(now.velocity) / scale),)))


@effect("asymmetric_viscous_friction", "drive", "current", ("absolute", "one_sided"))
def asymmetric_viscous(draw: Draw) -> Influence:
    """Viscous friction b (1 + d) in one direction, b (1 - d) or b in the other."""
    share = draw.size("share", 0.45, 0.7) * draw.sign()
    slope = share * draw.motor.viscous

    def absolute(now: DriveNow) -> float:
        return slope * abs(now.velocity)

    def one_sided(now: DriveNow) -> float:
        return 1.5 * slope * max(0.0, now.velocity) if share > 0 else -1.5 * slope * min(0.0, now.velocity)

    if draw.form == "one_sided" and share < 0:
        # More drag while extending: the extra force is along +v for v < 0, that is negative in the balance.
        return Influence(terms=DriveTerms(load=(lambda now: -1.5 * slope * min(0.0, now.velocity),)))
    return Influence(terms=DriveTerms(load=(absolute if draw.form == "absolute" else one_sided,)))


@effect("asymmetric_friction", "drive", "current")
def asymmetric_coulomb(draw: Draw) -> Influence:
    """Coulomb friction higher in one direction than in the other."""
    half = draw.raw("half_difference_raw", 0.18, 0.35) * draw.sign()
    return Influence(terms=DriveTerms(friction=(lambda now: half * now.direction,)))


@effect("load_dependent_friction", "drive", "current", ("transmitted", "efficiency"))
def load_dependent(draw: Draw) -> Influence:
    """Friction grows with the load behind the gearbox; a leadscrew's share is smaller while the load drives it back.

    (Friction in proportion to the motor's own current would only rescale current against motion: nobody could see it.)
    """
    share = draw.size("share", 0.27, 0.42)
    back = 1.0 if draw.form == "transmitted" else 0.6
    return Influence(
        terms=DriveTerms(
            friction=(
                lambda now: share * abs(now.transmitted) * (1.0 if now.direction * now.transmitted > 0 else back),
            )
        )
    )


@effect("position_dependent_friction", "drive", "current", BUMPS)
def tight_spot(draw: Draw) -> Influence:
    """A tight spot: more friction both ways in one part of the range."""
    height = draw.raw("height_raw", 0.22, 0.32)
    shape = bump(draw.form, draw.uniform("centre_percent", 22.0, 78.0), draw.uniform("width_percent", 5.0, 9.0))
    return Influence(terms=DriveTerms(friction=(lambda now: height * shape(now.position),)))


@effect("quadratic_damping", "drive", "current", ("square", "cube"))
def quadratic(draw: Draw) -> Influence:
    """Drag that grows faster than speed."""
    at_100 = draw.raw("drag_at_100_raw", 0.6, 0.9)
    power = 2.0 if draw.form == "square" else 2.6
    return Influence(
        terms=DriveTerms(load=(lambda now: math.copysign(at_100 * abs(now.velocity / 100.0) ** power, now.velocity),))
    )


@effect("presliding_friction", "drive", "current", ("dahl", "lugre"))
def presliding(draw: Draw) -> Influence:
    """Friction is carried by a bristle that gives way over a small distance before it slides, at whatever level that is
    by then."""
    give = max(0.05, draw.size("give_percent", 0.4, 0.9))
    if draw.motor.give:  # a drive that gives anyway gives more
        give = draw.note("give_percent", draw.motor.give * (1.0 + 2.0 * give))
    level = draw.motor.coulomb
    damping = 0.0 if draw.form == "dahl" else draw.uniform("bristle_damping_raw", 0.01, 0.04) * level / give
    bristle = [0.0, 0.0]  # deflection [%] and its rate [%/s]

    def start(trial: TrialPlan) -> None:
        # At rest the bristle carries the preload, as Coulomb friction would.
        bristle[:] = [-give * min(0.9, draw.motor.preload / level), 0.0]

    def load(now: DriveNow) -> float:
        v = now.velocity
        bristle[1] = v * (1.0 - math.copysign(bristle[0] / give, bristle[0] * v))
        return now.level * bristle[0] / give + damping * bristle[1]

    def advance(now: DriveNow, step_s: float) -> None:
        bristle[0] = max(-give, min(give, bristle[0] + bristle[1] * step_s))

    return Influence(start=start, terms=DriveTerms(load=(load,), advance=(advance,), replace_coulomb=True))


@effect("thermal_friction_drift", "drive", "current", ("motion", "power"))
def thermal(draw: Draw) -> Influence:
    """Friction changes as the drive warms up in motion and cools at rest, over all trials of the session."""
    change = draw.raw("change_raw", 0.28, 0.42) * draw.sign()
    warm_s, cool_s = draw.uniform("warming_s", 15.0, 35.0), draw.uniform("cooling_s", 60.0, 150.0)
    heat, last = [0.0], [0.0]

    def start(trial: TrialPlan) -> None:
        if trial.start_s > last[0]:
            heat[0] *= math.exp(-(trial.start_s - last[0]) / cool_s)

    def advance(now: DriveNow, step_s: float) -> None:
        source = abs(now.velocity) > 1.0 if draw.form == "motion" else min(2.0, (now.current / 55.0) ** 2)
        heat[0] += step_s * (source * (1.0 - heat[0]) / warm_s - (0.0 if source else heat[0] / cool_s))
        last[0] = now.session_s

    return Influence(start=start, terms=DriveTerms(friction=(lambda now: change * heat[0],), advance=(advance,)))
