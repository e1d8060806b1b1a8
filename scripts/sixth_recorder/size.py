"""Turn an effect's amplitude until a perfect observer of the refitted declared model is off by a wanted multiple of the
noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sixth_recorder.effects.law import Context, Law
from sixth_recorder.effects.table import EFFECTS
from sixth_recorder.finger import Finger
from sixth_recorder.lab import Lab
from sixth_recorder.machine import Machine
from sixth_recorder.observer import current_mismatch, marker_mismatch, truths
from sixth_recorder.plant import Q_GRID

# Not proportional to their amplitude: traces are sized, instead of a trace of the size.
NONLINEAR = ("current_saturation", "coupling_deadband", "distal_stop", "spring_decoupling", "presliding_friction")
# Amplitudes (s, %) below which no log of these rates shows it, whatever the mismatch says.
FLOOR = {"current_channel_delay": 0.016, "presliding_friction": 0.25}
TRACE = 0.2  # strength below which an effect is background
NEAR = 0.06  # of the logarithm of the mismatch
WANTED = {"current": (0.5, 1.5), "kin": (0.5, 1.3)}  # mismatch over noise at full strength
WANTED_OF = {
    "marker_slip": (0.7, 1.7),
    "support_slip": (0.7, 1.7),
    "palm_marker_slip": (0.7, 1.7),
    "clock_drift": (1.0, 3.0),
    "external_contact": (0.4, 0.9),
    "sudden_preload_change": (0.4, 0.9),
    "presliding_friction": (1.1, 2.0),
}


def make_safe(machine: Machine) -> None:
    """A drive that lets go at rest needs friction to hold the finger: where a hidden load is stronger, it keeps its
    current."""
    plant, p = machine.plant, machine.plant.p
    if p["HOLD"] != 1:
        return
    load = p["K_"] * Q_GRID + p["TAU0"] + plant.load_q
    in_range = (Q_GRID >= -0.01) & (Q_GRID <= 100.01)
    if plant.per_trial or p["THA"] or p["ZS"] or p["BLS"] or abs(load[in_range]).max() > 0.9 * p["FC"]:
        p["HOLD"] = 0.0


def fit(
    name: str,
    lab: Lab,
    finger: Finger,
    rng: np.random.Generator,
    strength: float = 1.0,
    rounds: int = 5,
    alone: bool = True,
) -> tuple[dict[str, Any], Callable[[Machine], None]]:
    """Draw a law of an effect and size it; returns the entry of the answers, and what hides it in a machine."""
    effect, context = EFFECTS[name], Context(lab, finger, rng, alone)
    law = effect.draw(context)
    channel = law.channel or effect.channel

    def mismatch(amplitude: float) -> float:
        machine = Machine(finger)
        slips = list(lab.palm_slips)
        law.hide(machine, amplitude)
        lab.palm_slips[:] = slips
        make_safe(machine)
        if channel == "current":
            return current_mismatch(machine, truths(machine, context.trials), lab.sigma_current[finger.name])
        return marker_mismatch(machine, truths(machine, context.flexions), lab.sigma_marker, lab)

    ratio = None
    if channel in WANTED:
        sized = name in NONLINEAR or strength > TRACE
        wanted = _wanted(name, rng, channel)
        amplitude, ratio = _turned(law, mismatch, wanted * strength if sized else wanted, rounds)
        if not sized:
            amplitude *= strength
            ratio *= strength
        if amplitude < FLOOR.get(name, 0) * strength:
            amplitude = FLOOR[name] * strength
            ratio = mismatch(amplitude)
    else:
        amplitude = law.start * strength
    seen = None if ratio is None else round(ratio, 3)
    parameters = {**law.parameters, "amplitude": float(amplitude), "mismatch_over_noise": seen}
    entry = {"effect": name, "finger": finger.name, "strength": strength, "parameters": parameters}
    return entry, lambda machine: law.hide(machine, amplitude)


def _wanted(name: str, rng: np.random.Generator, channel: str) -> float:
    low, high = WANTED_OF.get(name, WANTED[channel])
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _turned(law: Law, mismatch: Callable[[float], float], goal: float, rounds: int) -> tuple[float, float]:
    """The amplitude whose mismatch is nearest to the goal, and that mismatch, after some rounds of a secant in
    logarithms."""
    amplitude = min(law.start, law.most)
    seen: list[tuple[float, float, float]] = []
    for _ in range(rounds):
        ratio = mismatch(amplitude)
        seen.append((abs(np.log(max(ratio, 1e-6) / goal)), amplitude, ratio))
        if seen[-1][0] < NEAR:
            break
        exponent = 1.0
        if len(seen) > 1:
            (_, amplitude0, ratio0), (_, amplitude1, ratio1) = seen[-2:]
            change = np.log(amplitude1 / amplitude0)
            if abs(change) > 1e-3:
                exponent = np.clip(np.log(max(ratio1, 1e-6) / max(ratio0, 1e-6)) / change, 0.4, 4)
        factor = float(np.clip((goal / max(ratio, 1e-6)) ** (1 / exponent), 0.12, 6))
        other = min(law.most, amplitude * factor)
        if other == amplitude:
            break
        amplitude = other
    _, amplitude, ratio = min(seen)
    return amplitude, ratio
