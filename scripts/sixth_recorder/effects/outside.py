"""What the vocabulary of the diagnosis has no word for."""

from __future__ import annotations

from typing import Any

import numpy as np

from sixth_recorder.effects.law import Context, Law
from sixth_recorder.finger import SEGMENTS
from sixth_recorder.lab import PALM_LABELS, WORLD_CENTRE
from sixth_recorder.machine import H, Machine, Segments, Truth
from sixth_recorder.plant import TRAVEL_GRID, V_GRID, Series


def dwell_ageing(x: Context) -> Law:
    """Friction is higher after rest (junction growth) and wears off over a distance."""
    distance, time = x.uniform(8, 25), x.uniform(0.1, 0.5)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.p.update(DWA=amplitude, DWT=time, DWD=distance)

    return Law({"distance": distance, "time": time}, hide, 0.6, 2.0)


def grain_bursts(x: Context) -> Law:
    """Dirt in the gearbox: short bursts of friction at random moments, tied to neither place nor speed."""
    seed, rate = int(x.rng.integers(1 << 30)), x.uniform(0.25, 0.6)

    def hide(machine: Machine, amplitude: float) -> None:
        def burst(trial: dict[str, Any], t: np.ndarray) -> Series:
            rng = np.random.default_rng(seed + sum(trial["name"].encode()))
            factor = np.ones(len(t))
            for _ in range(rng.poisson(rate * t[-1])):
                height = amplitude * rng.uniform(0.5, 1.5)
                factor += height * np.exp(-0.5 * ((t - rng.uniform(0, t[-1])) / rng.uniform(0.04, 0.18)) ** 2)
            return {"friction_factor": factor}

        machine.plant.per_trial.append(burst)

    return Law({"rate": rate}, hide, 0.8, 3.0)


def sudden_preload_change(x: Context) -> Law:
    """A screw lets go: the constant load jumps at one moment and stays."""
    trial = x.pick(x.trials[0], x.trials[1])
    at, sign = trial["t0"] + x.uniform(0.3, 0.7) * trial["duration"], x.sign()

    def hide(machine: Machine, amplitude: float) -> None:
        step = sign * amplitude * x.coulomb
        machine.plant.per_trial.append(lambda of, t: {"extra": step * (of["t0"] + t > at)})

    return Law({"trial": trial["name"], "sign": sign}, hide, 0.2, 0.5)


def belt_seam(x: Context) -> Law:
    """A load tied to the distance travelled in all (a belt seam going round one way), not to position."""
    period = x.uniform(130, 270)
    seam = np.exp(-0.5 * ((TRAVEL_GRID - 0.5) / 0.05) ** 2)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.load_travel += amplitude * x.coulomb * seam
        machine.plant.p["SEAMP"] = period

    return Law({"period_of_travel": period}, hide, 0.5, 1.5)


def current_gain_drift(x: Context) -> Law:
    """The current sensor's gain wanders with time."""
    period, phase = x.uniform(60, 150), x.uniform(0, 6.28)

    def hide(machine: Machine, amplitude: float) -> None:
        def shown(current: np.ndarray, truth: Truth) -> np.ndarray:
            return current * (1 + amplitude * np.sin(2 * np.pi * (truth["t0"] + truth["t"]) / period + phase))

        machine.current_stages.append(shown)

    return Law({"period": period}, hide, 0.1, 0.4)


def current_zero_wander(x: Context) -> Law:
    """The current sensor's zero wanders irregularly within a trial."""
    phases, periods = x.rng.uniform(0, 6.28, 6), x.rng.uniform(4, 25, 6)

    def hide(machine: Machine, amplitude: float) -> None:
        def shown(current: np.ndarray, truth: Truth) -> np.ndarray:
            turns = 2 * np.pi * (truth["t0"] + truth["t"])
            waves = sum(np.sin(turns / period + phase) for phase, period in zip(phases, periods))
            return current + amplitude * x.coulomb * waves / 6**0.5

        machine.current_stages.append(shown)

    return Law({}, hide, 0.15, 0.6)


def mains_hum(x: Context) -> Law:
    """50 Hz (not quite) pickup on the current channel."""
    frequency = x.uniform(49.9, 50.1)
    share = x.uniform(0.9, 1.6) * x.lab.sigma_current[x.finger.name] / x.coulomb

    def hide(machine: Machine, amplitude: float) -> None:
        def shown(current: np.ndarray, truth: Truth) -> np.ndarray:
            hum = np.sin(2 * np.pi * frequency * (truth["t0"] + truth["t"]))
            return current + amplitude * x.coulomb * hum

        machine.current_stages.append(shown)

    return Law({"frequency": frequency}, hide, share, share)


def speed_resonance(x: Context) -> Law:
    """Extra drag in a narrow band of speeds (a resonating gearbox)."""
    second_fastest = float(sorted(set(x.trials[0]["speed_raw"]))[-2])
    speed = second_fastest / 255 * x.lab.speed_full * x.uniform(0.9, 1.1)
    width = speed * x.uniform(0.1, 0.2)
    band = np.exp(-0.5 * ((abs(V_GRID) - speed) / width) ** 2)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.load_v += amplitude * x.coulomb * np.sign(V_GRID) * band

    return Law({"speed": speed, "width": width}, hide, 0.4, 1.5)


def structural_ringing(x: Context) -> Law:
    """A mass on a soft mount rings after each start and stop."""
    omega, damping = 2 * np.pi * x.uniform(3, 8), x.uniform(0.01, 0.04)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.p.update(RGA=amplitude, RGW=omega, RGZ=damping)

    return Law({"frequency": omega / 2 / np.pi, "damping": damping}, hide, 0.6, 4.0)


def volume_scale_drift(x: Context) -> Law:
    """The camera calibration drifts: all distances grow slowly."""
    begin, tau = x.trials[0]["t0"], x.uniform(40, 120)

    def hide(machine: Machine, amplitude: float) -> None:
        def growth(at: np.ndarray) -> np.ndarray:
            return amplitude * np.tanh((at - begin) / tau)

        def grown(world: np.ndarray, at: np.ndarray) -> np.ndarray:
            return WORLD_CENTRE + (world - WORLD_CENTRE) * (1 + growth(at))[:, None, None]

        for each in machine.all_machines:
            each.on_world.append(grown)
        machine.scale = growth

    return Law({"time": tau}, hide, 4e-3, 3e-2)


def soft_marker_mount(x: Context) -> Law:
    """Markers on a soft mount lag by acceleration and speed."""
    s, share = x.pick(0, 1), x.uniform(0.2, 1)

    def hide(machine: Machine, amplitude: float) -> None:
        way = np.cross(x.finger.axes[s], np.array([1, 0, 0.0]))
        way /= np.linalg.norm(way)

        def bend(segments: Segments, at: np.ndarray, truth: Truth) -> None:
            lean = truth["v"] / 60 + share * truth["a_slow"] / 600
            segments[s] = segments[s] + amplitude * lean[:, None, None] * way

        machine.on_segment.append(bend)

    return Law({"segment": SEGMENTS[s]}, hide, 4e-4, 4e-3)


def palm_plate_bending(x: Context) -> Law:
    """The palm plate bends under the motor's pull: one palm marker moves with the current."""
    i = int(x.rng.integers(3))
    way = np.array([0.3, 0, 1.0]) / np.linalg.norm([0.3, 0, 1])

    def hide(machine: Machine, amplitude: float) -> None:
        machine.palm_load = (i, amplitude * way / x.coulomb)

    return Law({"marker": PALM_LABELS[i]}, hide, 8e-4, 5e-3)


def encoder_count_loss(x: Context) -> Law:
    """The counter drops counts when turning fast, and never gets them back."""
    speed = x.uniform(0.55, 0.8) * x.lab.speed_full

    def hide(machine: Machine, amplitude: float) -> None:
        def shown(q: np.ndarray, truth: Truth) -> np.ndarray:
            return q - amplitude * np.cumsum(abs(truth["v"]) > speed) * H

        machine.position_stages.append(shown)

    return Law({"above_speed": speed}, hide, 0.3, 4.0)
