"""Faults that no row of the vocabulary describes."""

import numpy as np
from scipy.signal import lfilter

from .effect import Effect, Settings, arrow, either, scaled, spread
from .plan import LogTable, Plan

Rng = np.random.Generator


def _gain_by_trial(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * spread(rng, 0.08, 0.2)
    plan.log_steps.append(lambda table, r: table.current.__imul__(1 + size * either(r)))
    return {"gain_change": size}


def _restamped(plan: Plan, s: float, rng: Rng) -> Settings:
    batch = s * spread(rng, 0.025, 0.09)

    def change(table: LogTable, _: Rng) -> None:
        late = np.ceil(table.time / batch) * batch
        order = np.arange(len(late)) - np.searchsorted(late, late)
        table.time[:] = late + 2e-4 * order

    plan.log_steps.append(change)
    return {"batch": batch}


def _random_load(plan: Plan, s: float, rng: Rng) -> Settings:
    plan.random_load = s * spread(rng, 5, 12)
    return {"raw": plan.random_load}


def _soft_tissue(plan: Plan, s: float, rng: Rng) -> Settings:
    first, vector = 3 * int(rng.integers(2)), arrow(rng, s, 0.8, 2.4)

    def step(points: np.ndarray, _: np.ndarray, speed: np.ndarray) -> np.ndarray:
        moved = points.copy()
        moved[:, first : first + 2] += (lfilter([0.1], [1, -0.9], speed) / 115)[:, None, None] * vector
        return moved

    plan.marker_steps.append(step)
    return {"mm_at_full_speed": vector.tolist()}


def _ringing_support(plan: Plan, s: float, rng: Rng) -> Settings:
    first, hertz, vector = 3 * int(rng.integers(2)), rng.uniform(3, 9), arrow(rng, s, 0.6, 1.6)

    def step(points: np.ndarray, _: np.ndarray, speed: np.ndarray) -> np.ndarray:
        turn, damping = 2 * np.pi * hertz / 100, 0.06
        pole = np.exp(-damping * turn)
        rung = lfilter([1.0], [1, -2 * pole * np.cos(turn), pole**2], np.diff(speed, prepend=0.0)) / 115
        moved = points.copy()
        moved[:, first : first + 3] += rung[:, None, None] * vector
        return moved

    plan.marker_steps.append(step)
    return {"hertz": hertz, "mm": vector.tolist()}


def _lost_counts(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * spread(rng, 40, 150)

    def change(table: LogTable, r: Rng) -> None:
        for part in r.uniform(0.1, 0.9, 3):
            table.counts[int(part * len(table.counts)) :] -= size * either(r)

    plan.log_steps.append(change)
    return {"counts": size}


def _coarse_encoder(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * spread(rng, 24, 70)
    plan.log_steps.append(lambda table, _: np.copyto(table.counts, size * np.round(table.counts / size)))
    return {"counts": size}


def _wandering_zero(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * spread(rng, 5, 12)

    def change(table: LogTable, r: Rng) -> None:
        walk = np.cumsum(r.normal(0, 1, len(table.time)))
        walk -= walk.mean()
        table.current += size * walk / walk.std()

    plan.log_steps.append(change)
    return {"raw": size}


def _hum(plan: Plan, s: float, rng: Rng) -> Settings:
    size, hertz = s * spread(rng, 4, 10), rng.uniform(0.6, 6)

    def change(table: LogTable, r: Rng) -> None:
        table.current += size * np.sin(2 * np.pi * hertz * table.time + r.uniform(0, 6.3))

    plan.log_steps.append(change)
    return {"raw": size, "hertz": hertz}


def _spikes(plan: Plan, s: float, rng: Rng) -> Settings:
    size, share = s * spread(rng, 30, 80), rng.uniform(0.006, 0.02)

    def change(table: LogTable, r: Rng) -> None:
        table.current += size * r.normal(0, 1, len(table.time)) * (r.random(len(table.time)) < share)

    plan.log_steps.append(change)
    return {"raw": size, "share": share}


def _frozen_frames(plan: Plan, s: float, rng: Rng) -> Settings:
    length, every = max(2, int(s * rng.integers(6, 16))), int(rng.integers(60, 160))

    def change(seen: np.ndarray, r: Rng) -> np.ndarray:
        for start in range(int(r.integers(1, every)), len(seen) - length, every):
            seen[start : start + length] = seen[start - 1]
        return seen

    plan.frame_steps.append(change)
    return {"frames": length, "every": every}


def _mocap_scale(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * either(rng) * spread(rng, 0.004, 0.012)

    def change(seen: np.ndarray, _: Rng) -> np.ndarray:
        return seen * (1 + size * np.linspace(0, 1, len(seen)))[:, None, None]

    plan.frame_steps.append(change)
    return {"scale_change": size}


_acceleration_friction = scaled("accel_friction", 0.015, 0.04, "raw_per_acceleration")
_ageing = scaled("ageing", 10, 24, "raw_per_log_dwell")
EFFECTS = (
    Effect("outside_current_gain_by_trial", "current", None, (_gain_by_trial,), False),
    Effect("outside_restamped_log", "log", None, (_restamped,), False),
    Effect("outside_acceleration_friction", "current", None, (_acceleration_friction,), False),
    Effect("outside_friction_ages_at_rest", "current", None, (_ageing,), False),
    Effect("outside_random_load", "current", None, (_random_load,), False),
    Effect("outside_soft_tissue", "markers", None, (_soft_tissue,), False),
    Effect("outside_ringing_support", "markers", None, (_ringing_support,), False),
    Effect("outside_lost_counts", "position", None, (_lost_counts,), False),
    Effect("outside_coarse_encoder", "position", None, (_coarse_encoder,), False),
    Effect("outside_wandering_current_zero", "current", None, (_wandering_zero,), False),
    Effect("outside_hum", "current", None, (_hum,), False),
    Effect("outside_current_spikes", "current", None, (_spikes,), False),
    Effect("outside_frozen_frames", "markers", None, (_frozen_frames,), False),
    Effect("outside_mocap_scale", "markers", None, (_mocap_scale,), False),
)
