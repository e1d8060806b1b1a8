"""Loads and friction that the current has to bear beside what it did: forces in raw units, places in %, times in s."""

from __future__ import annotations

import numpy as np

from .plant import Array, Draw, Motor, Moving, Plant, turned_over

AT_REST = 0.5  # [%/s] slower, and friction is not known


def _way(m: Moving) -> Array:
    return np.tanh(m.speed / AT_REST)


def stribeck_friction(rng: Draw, size: float, motor: Motor) -> Plant:
    """More friction at rest than in motion."""
    more, speed = size * rng.uniform(0.5, 1.0) * motor.coulomb, rng.uniform(10, 30)
    return Plant(lambda m: more * np.exp(-((m.speed / speed) ** 2)) * _way(m), figures={"more": more, "speed": speed})


def asymmetric_viscous_friction(rng: Draw, size: float, motor: Motor) -> Plant:
    """More viscous friction in extension."""
    more = size * rng.uniform(0.6, 1.5) * motor.viscous
    return Plant(lambda m: more * np.minimum(m.speed, 0.0), figures={"more": more})


def load_dependent_friction(rng: Draw, size: float, motor: Motor) -> Plant:
    """Friction that grows with the load."""
    share = size * rng.uniform(0.25, 0.6)
    return Plant(
        lambda m: share * np.abs(motor.stiffness * m.place + motor.preload) * _way(m), figures={"share": share}
    )


def position_dependent_friction(rng: Draw, size: float, motor: Motor) -> Plant:
    """A tight spot."""
    more, centre, width = size * rng.uniform(0.5, 1.1) * motor.coulomb, rng.uniform(25, 75), rng.uniform(4, 10)
    return Plant(
        lambda m: more * np.exp(-0.5 * ((m.place - centre) / width) ** 2) * _way(m),
        figures={"more": more, "centre": centre, "width": width},
    )


def quadratic_damping(rng: Draw, size: float, motor: Motor) -> Plant:
    """Drag that grows with the speed's square."""
    drag = size * rng.uniform(0.0012, 0.0026)
    return Plant(lambda m: drag * m.speed * np.abs(m.speed), figures={"drag": drag})


def elastoplastic_hysteresis(rng: Draw, size: float, motor: Motor) -> Plant:
    """A load that turns over some way after each reversal."""
    load, reach = size * rng.uniform(10, 20), rng.uniform(5, 15)
    return Plant(lambda m: load * turned_over(m.place, reach), figures={"load": load, "reach": reach})


def thermal_friction_drift(rng: Draw, size: float, motor: Motor) -> Plant:
    """Friction that falls, at times grows, as the motor warms."""
    cold = size * rng.uniform(0.3, 0.6) * (1 if rng.random() < 0.75 else -0.6) * motor.coulomb
    warming_s = rng.uniform(40, 150)
    return Plant(
        lambda m: cold * np.exp(-m.since_s / warming_s) * _way(m), figures={"cold": cold, "warming_s": warming_s}
    )


def detent_load(rng: Draw, size: float, motor: Motor) -> Plant:
    """A bump of the load, or a hill to get over."""
    load, centre, width = (
        size * rng.choice([-1, 1]) * rng.uniform(14, 28),
        rng.uniform(25, 75),
        rng.uniform(4, 9),
    )
    hill = bool(rng.integers(2))

    def bump(m: Moving) -> Array:
        u = (m.place - centre) / width
        return load * np.exp(0.5 * hill - 0.5 * u**2) * (u if hill else 1.0)

    return Plant(bump, figures={"load": load, "centre": centre, "width": width, "hill": hill})


def nonlinear_spring(rng: Draw, size: float, motor: Motor) -> Plant:
    """A cubic or a square part of the spring."""
    power = int(rng.integers(2, 4))
    load = size * rng.choice([-1, 1]) * (rng.uniform(18, 40) if power == 3 else rng.uniform(22, 45))
    return Plant(lambda m: load * (m.place / 100) ** power, figures={"load": load, "power": power})


def gravity_load(rng: Draw, size: float, motor: Motor) -> Plant:
    """The finger's weight, as the hand is held."""
    weight = size * rng.uniform(45, 90)

    def moment(m: Moving) -> Array:
        angle = motor.full_rad * m.place / 100
        return weight * (motor.weight[0] * np.cos(angle) + motor.weight[1] * np.sin(angle))

    return Plant(moment, figures={"weight": weight})


def torque_ripple(rng: Draw, size: float, motor: Motor) -> Plant:
    """A load that is periodic in position."""
    load, period, phase = size * rng.uniform(7, 15), rng.uniform(4, 14), rng.uniform(0, 2 * np.pi)
    return Plant(
        lambda m: load * np.sin(2 * np.pi * m.place / period + phase), figures={"load": load, "period": period}
    )


def viscoelastic_spring(rng: Draw, size: float, motor: Motor) -> Plant:
    """A second spring that relaxes."""
    stiffness, relaxing_s = size * rng.uniform(0.15, 0.4), float(np.exp(rng.uniform(np.log(0.4), np.log(4))))

    def relaxed(m: Moving) -> Array:
        out, decay = np.zeros(len(m.time_s)), np.exp(-np.diff(m.time_s) / relaxing_s)
        for k in range(1, len(out)):
            out[k] = out[k - 1] * decay[k - 1] + stiffness * (m.place[k] - m.place[k - 1]) * np.sqrt(decay[k - 1])
        return out

    return Plant(relaxed, figures={"stiffness": stiffness, "relaxing_s": relaxing_s})


def end_stop_contact(rng: Draw, size: float, motor: Motor) -> Plant:
    """A soft stop before the end of the range."""
    begin, stiffness = rng.uniform(78, 92), size * rng.uniform(2.0, 6.0)
    return Plant(
        lambda m: stiffness * np.maximum(m.place - begin, 0.0), figures={"begin": begin, "stiffness": stiffness}
    )


def external_contact(rng: Draw, size: float, motor: Motor) -> Plant:
    """Something that stands in the finger's way for a while in some trials."""
    begin, stiffness = rng.uniform(45, 75), size * rng.uniform(0.8, 2.0)
    span, held = (rng.uniform(0.0, 0.3), rng.uniform(0.6, 1.0)), rng.random(12) < 0.6
    held[0], held[1] = True, False

    def pressed(m: Moving) -> Array:
        share = m.time_s / m.time_s[-1]
        there = held[m.number] & (share > span[0]) & (share < span[1])
        return stiffness * np.maximum(m.place - begin, 0.0) * there

    return Plant(pressed, figures={"begin": begin, "stiffness": stiffness})


LOADS = (
    stribeck_friction,
    asymmetric_viscous_friction,
    load_dependent_friction,
    position_dependent_friction,
    quadratic_damping,
    elastoplastic_hysteresis,
    thermal_friction_drift,
    detent_load,
    nonlinear_spring,
    gravity_load,
    torque_ripple,
    viscoelastic_spring,
    end_stop_contact,
    external_contact,
)
