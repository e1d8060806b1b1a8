"""Effects of the drive's electronics and of the log."""

import numpy as np

from .effect import Effect, Law, Settings, either, spread
from .motions import FULL_SPEED, Move, Pace, programme
from .plan import LogTable, Plan
from .stepper import run_drive

Rng = np.random.Generator


def _encoder(harmonic: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        size, period, phase = s * spread(rng, 8, 30), spread(rng, 300, 1500), rng.uniform(0, 2 * np.pi)

        def change(table: LogTable, _: Rng) -> None:
            turn = 2 * np.pi * table.counts / period + phase
            table.counts += size * (np.sin(turn) + harmonic * np.sin(2 * turn))

        plan.log_steps.append(change)
        return {"counts": size, "period": period, "second_harmonic": harmonic}

    return law


def _sag(tau: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        size = s * spread(rng, 0.25, 0.6)
        plan.add("sag", size)
        plan.drive["sag_tau"] = tau
        return {"sag_per_100": size, "tau": tau}

    return law


def _late(plan: Plan, s: float, rng: Rng) -> Settings:
    delay = s * spread(rng, 0.03, 0.12)
    plan.command_delay = lambda _: delay
    return {"delay": delay}


def _late_unevenly(plan: Plan, s: float, rng: Rng) -> Settings:
    low, high = s * 0.02, s * spread(rng, 0.08, 0.15)
    plan.command_delay = lambda r: float(r.uniform(low, high))
    return {"from": low, "to": high}


def _greatest_current(plan: Plan, fraction: float) -> float:
    """The largest current of a full flexion at a fraction of full speed, with what is already hidden."""
    moves = programme([Move(100.0, fraction)], Pace(0.3, 0.2, 900.0, FULL_SPEED))
    run = run_drive(
        plan.finger.motor | plan.drive,
        (moves.position, moves.speed),
        np.zeros(len(moves.position)),
        plan.load_table,
        plan.friction_table,
    )
    return float(run.current.max())


def _reading_clips(plan: Plan, s: float, rng: Rng) -> Settings:
    limit = 100 - s * rng.uniform(34, 46)
    plan.current_clip = limit
    return {"reading_limit": limit}


def _drive_clips(plan: Plan, s: float, rng: Rng) -> Settings:
    fast, slow = (_greatest_current(plan, fraction) for fraction in (1.0, 0.15))
    limit = 1.02 * fast - s * (1.02 * fast - slow - rng.uniform(0.5, 3))
    plan.drive["limit"] = limit
    return {"drive_limit": limit}


def _current_late(plan: Plan, s: float, rng: Rng) -> Settings:
    plan.current_delay = s * either(rng) * spread(rng, 0.012, 0.04)
    return {"delay": plan.current_delay}


def _position_late(plan: Plan, s: float, rng: Rng) -> Settings:
    plan.position_delay = s * spread(rng, 0.012, 0.04)
    return {"position_delay": plan.position_delay}


def _position_is_reference(plan: Plan, s: float, rng: Rng) -> Settings:
    def change(table: LogTable, _: Rng) -> None:
        table.counts[:] = np.round(table.reference)

    plan.replace_log = change
    return {"channel": "position"}


def _current_is_dead(plan: Plan, s: float, rng: Rng) -> Settings:
    value = float(rng.integers(0, 6))

    def change(table: LogTable, _: Rng) -> None:
        table.current[:] = value

    plan.replace_log = change
    return {"channel": "current", "value": value}


def _current_is_command(plan: Plan, s: float, rng: Rng) -> Settings:
    def change(table: LogTable, _: Rng) -> None:
        speed = np.gradient(table.reference, table.time)
        table.current[:] = np.round(128 * np.clip(speed / 6700, -1, 1) / 8) * 8

    plan.replace_log = change
    return {"channel": "current", "of": "speed command"}


def _drift(plan: Plan, s: float, rng: Rng) -> Settings:
    rate = s * either(rng) * spread(rng, 0.0006, 0.0025)
    plan.clock = lambda t: t * (1 + rate)
    return {"skew": 1 + rate}


def _drift_growing(plan: Plan, s: float, rng: Rng) -> Settings:
    rate = s * either(rng) * spread(rng, 0.0008, 0.003)
    plan.clock = lambda t: t * (1 + rate * (0.5 + t / 100))
    return {"skew": 1 + rate, "growing": True}


NOT_MEASURED = (_position_is_reference, _current_is_dead, _current_is_command)
EFFECTS = (
    Effect("encoder_periodic_error", "position", None, (_encoder(0.0), _encoder(0.4))),
    Effect("drive_sag", "current", None, (_sag(0.0), _sag(0.25))),
    Effect("command_delay", "log", None, (_late, _late_unevenly)),
    Effect("current_saturation", "current", None, (_reading_clips, _reading_clips, _drive_clips)),
    Effect("current_channel_delay", "current", None, (_current_late, _position_late)),
    Effect("command_as_measurement", "log", None, NOT_MEASURED, joinable=False),
    Effect("clock_drift", "log", None, (_drift, _drift_growing)),
)
