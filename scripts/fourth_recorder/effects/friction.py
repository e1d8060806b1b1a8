"""Effects of friction. Forces in raw units of current, positions in %, speeds in %/s, times in s."""

from __future__ import annotations

from .draw import Drawn, Site, of_motor


def stribeck_friction(site: Site) -> Drawn:
    """More friction at rest than in motion."""
    ratio = 1 + site.size * site.form.between("ratio", 0.5, 1.0)
    speed = site.form.between("speed", 10, 30)
    changes = {"static_friction": site.finger.motor.coulomb * ratio, "stribeck_speed": speed}
    return Drawn(motor=changes, figures={"static_ratio": ratio, "stribeck_speed": speed})


def asymmetric_viscous_friction(site: Site) -> Drawn:
    """More viscous friction in extension."""
    more = site.size * site.form.between("more", 0.6, 1.5)
    return of_motor(viscous_asymmetry=more)


def asymmetric_friction(site: Site) -> Drawn:
    """More or less Coulomb friction in extension."""
    more = site.size * site.form.sign("sign") * site.form.between("more", 0.25, 0.5)
    return of_motor(coulomb_asymmetry=more)


def load_dependent_friction(site: Site) -> Drawn:
    """Friction that grows with the load."""
    return of_motor(load_friction=site.size * site.form.between("share", 0.25, 0.6))


def position_dependent_friction(site: Site) -> Drawn:
    """A tight spot."""
    return of_motor(
        tight_spot=site.size * site.form.between("share", 0.5, 1.1),
        tight_centre=site.form.between("centre", 25, 75),
        tight_width=site.form.between("width", 4, 10),
    )


def quadratic_damping(site: Site) -> Drawn:
    """Drag that grows with the speed's square."""
    return of_motor(drag=site.size * site.form.between("drag", 0.0012, 0.0026))


def elastoplastic_hysteresis(site: Site) -> Drawn:
    """A load that turns over some way after each reversal."""
    return of_motor(
        hysteresis=site.size * site.form.between("load", 10, 20),
        hysteresis_distance=site.form.between("distance", 5, 15),
    )


def presliding_friction(site: Site) -> Drawn:
    """Friction that yields further before it slides."""
    return of_motor(bristle_stiffness=60 / (1 + site.size * site.form.between("softer", 4, 9)))


def thermal_friction_drift(site: Site) -> Drawn:
    """Friction that falls, at times grows, as the motor warms."""
    rng = site.form.rng
    cold = site.form.keep("cold", lambda: float(rng.uniform(0.3, 0.6)) * (1 if rng.random() < 0.75 else -0.6))
    return of_motor(warming=site.size * cold, warming_time=site.form.between("time", 40, 150))
