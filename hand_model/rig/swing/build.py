"""A session with one moving joint as stretches to simulate: even grids, recorded starts, the joint's weight."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from ..declared import DeclaredFit
from ..dynamics import inertial_columns, inertial_parameters
from ..model import RigModel, RigTrial
from ..name.ripple import fine_periods
from ..overrides import compile_model
from ..states import fill_gaps, noise_std, recorded_states
from ..supply import supply_deviation
from .fit import WAVES
from .free import swings_free
from .simulation import STEP_S, Lane, Swing

# A trial is fitted in stretches (multiple shooting, Bock 1981), in periods of the free swing: short ones where a drive
# keeps the motion going, for then the cost is smooth; longer ones where damping is all there is to see.
DRIVEN_PERIODS, FREE_PERIODS = (1.3,), (2.5, 10.0)
DRIVEN_STEP_S, SAMPLES_A_PERIOD, MOST_SAMPLES = 4e-3, 100, 400
RUNGE_KUTTA = 1  # of MuJoCo's integrators; the others are leapfrogs
LEAST_STRETCHES = 4  # some to fit, some to leave out
PERIODS = 2  # of ripples that are tried
ENOUGH_STEPS = 12_500  # simulated at once: with more, effects are chosen on some of the stretches and fitted to all


def free_period_s(rig: RigModel) -> float:
    """Period [s] of small swings of the declared model about its rest; 1 s where nothing pulls it back."""
    model = compile_model(rig)
    sine, cosine, inertia = _rigid(model)
    weight = max(abs(sine), abs(cosine))
    return float(2 * np.pi * np.sqrt((inertia + model.dof_armature[0]) / weight)) if weight > 0 else 1.0


def windows_s(rig: RigModel) -> tuple[float, ...]:
    """Lengths [s] of the stretches, one stage after the other."""
    longest = sum(float(t.time_s[-1]) for t in rig.select(False)) / LEAST_STRETCHES
    periods = DRIVEN_PERIODS if rig.drive(rig.joints[0]) is not None else FREE_PERIODS
    return tuple(min(k * free_period_s(rig), longest) for k in periods)


def encoder_noise(rig: RigModel) -> float:
    """Noise [rad or m] of the joint's encoder, of the usual recording."""
    some = [(t.position[rig.joints[0]], t.time_s) for t in rig.trials if rig.joints[0] in t.position]
    return float(np.median([noise_std(fill_gaps(t, q), t) for q, t in some])) if some else 0.0


def ripple_periods(fit: DeclaredFit) -> tuple[float, ...]:
    """Periods [rad or m] of ripples that show most in the balance of what the drive is reckoned to give: centres of its
    peaks, of `fine_periods` the middle of three each."""
    rows = [r for r in fit.rows if not r.validate]
    longest = max((float(np.ptp(r.position)) for r in rows), default=0.0) / WAVES
    return tuple(fine_periods(fit, rows, longest)[1::3][:PERIODS]) if longest else ()


def search_step_s(rig: RigModel) -> float:
    """Step [s] that is fine enough to choose by: a recorded drive is followed, a free swing has a period to be
    resolved (by samples: its simulation has no step)."""
    return DRIVEN_STEP_S if rig.drive(rig.joints[0]) is not None else free_period_s(rig) / SAMPLES_A_PERIOD


def last_step_s(rig: RigModel) -> float:
    """Step [s] for the last fit: of a free swing every sample counts against the encoder's noise."""
    return STEP_S if rig.drive(rig.joints[0]) is not None else free_period_s(rig) / MOST_SAMPLES


def thinned(swing: Swing) -> Swing:
    """The swing with every second, third, ... training stretch of each trial, where all of them are more than a choice
    needs."""
    steps = sum(len(swing.lanes[i].position) for i in swing.train())
    every, seen, lanes = int(np.ceil(steps / ENOUGH_STEPS)), Counter(), []
    for lane in swing.lanes:
        if lane.validate or seen[lane.trial] % every == 0:
            lanes.append(lane)
        seen[lane.trial] += 1
    few = len(lanes) - sum(lane.validate for lane in lanes) < LEAST_STRETCHES
    return swing if few or every == 1 else replace(swing, lanes=tuple(lanes))


def can_swing(rig: RigModel) -> bool:
    """Whether the rig is one joint whose drive is absent or a voltage, and that recorded: then simulation in open loop
    is the natural test."""
    drive = rig.drive(rig.joints[0])
    if len(rig.joints) != 1 or not (drive is None or drive.kind == "voltage"):
        return False
    usable = [t for t in rig.select(False) if _lane_known(rig, t)]
    return bool(usable) and not any(t.effort for t in rig.trials)


def _lane_known(rig: RigModel, trial: RigTrial) -> bool:
    """Whether position and, where the drive is connected, voltage are recorded."""
    joint = rig.joints[0]
    connected = rig.drive(joint) is not None and joint in trial.live
    return joint in trial.position and (not connected or joint in trial.voltage)


def build_swing(rig: RigModel, fit: DeclaredFit, step_s: float = STEP_S, longest_s: float = np.inf) -> Swing:
    """Stretches of all trials, and the declared parameters as a start.

    The scale of effort is the declared weight's where there is gravity, else the declared inertia's: motion alone shows
    ratios only.
    """
    model = compile_model(rig)
    joint = rig.joints[0]
    sine, cosine, inertia = _rigid(model)
    drive = rig.drive(joint)
    initial = {
        "inertia": inertia + float(model.dof_armature[0]),
        "damping": float(model.dof_damping[0]),
        "coulomb": float(model.dof_frictionloss[0]),
    }
    if drive is not None:
        initial["gain"] = drive.gain
        initial["back_emf"] = next((c.value for c in fit.columns if c.kind == "back_emf"), 0.0)
    periods = () if drive is None else ripple_periods(fit)
    leapfrog_s = 0.0 if model.opt.integrator == RUNGE_KUTTA else float(model.opt.timestep)

    def built(step_s: float, sampled: bool) -> Swing:
        lanes = tuple(lane for t in rig.trials for lane in _stretches(rig, t, step_s, longest_s, sampled))
        return Swing(lanes, sine, cosine, initial, drive is not None, step_s, free_period_s(rig), leapfrog_s, inertia,
                     encoder_noise(rig), periods)  # fmt: skip

    if drive is None:
        swing = built(step_s, True)
        return swing if swings_free(swing) else built(0.5 * step_s, False)  # stepped, that takes finer steps
    return built(step_s, False)


def _rigid(model: Any) -> tuple[float, float, float]:
    """Weight (sine, cosine: effort that holds it at a quarter turn, at zero) and the bodies' inertia about the
    joint."""
    zero, right = np.zeros((1, 1)), np.full((1, 1), np.pi / 2)
    theta, gravity = inertial_parameters(model), np.array(model.opt.gravity)
    cosine, sine = (float(np.sum(inertial_columns(model, q, zero, zero, gravity)[0, 0] * theta)) for q in (zero, right))
    return sine, cosine, float(np.sum(inertial_columns(model, zero, zero, zero + 1, 0 * gravity)[0, 0] * theta))


def _stretches(rig: RigModel, trial: RigTrial, step_s: float, longest_s: float, sampled: bool) -> list[Lane]:
    joint = rig.joints[0]
    if not _lane_known(rig, trial):
        return []
    grid, smooth, velocity = recorded_states(trial.time_s, trial.position[joint])
    declared, own = compile_model(rig), compile_model(rig, trial)
    rigid, nominal = _rigid(own), _rigid(declared)
    recorded, used = fill_gaps(trial.time_s, trial.position[joint]), np.isfinite(trial.position[joint])
    if sampled:  # simulated at the instants of its samples: a line between two of them would cut the arc short
        every = max(1, round(step_s / float(np.median(np.diff(trial.time_s)))))
        fine, position, used = trial.time_s[::every], recorded[::every], used[::every].astype(float)
    else:
        fine = np.arange(0.0, grid[-1], step_s)
        position, used = np.interp(fine, trial.time_s, recorded), np.ones(len(fine))
    voltage = trial.voltage.get(joint)
    drive = np.zeros(len(fine)) if voltage is None else np.interp(fine, trial.time_s, fill_gaps(trial.time_s, voltage))
    supply = np.interp(fine, trial.time_s, supply_deviation(rig, trial))
    pieces = max(1, int(np.ceil(fine[-1] / longest_s)))
    size = len(fine) // pieces
    live = 1.0 if joint in trial.live else 0.0
    if live and (drive_ := rig.drive(joint)) is not None and drive_.gear:
        live = float(own.actuator(drive_.name).gear[0]) / drive_.gear
    level = float(own.dof_frictionloss[0] / declared.dof_frictionloss[0]) if declared.dof_frictionloss[0] else 1.0
    out = []
    for k in range(pieces):
        s = slice(k * size, (k + 1) * size if k < pieces - 1 else len(fine))
        start = (float(np.interp(fine[s.start], grid, smooth)), float(np.interp(fine[s.start], grid, velocity)))
        instants = fine[s] - fine[s.start] if sampled else None
        out.append(Lane(trial.name, trial.validate, drive[s], live, position[s], start, supply[s], used[s], level,
                        rigid[2] - nominal[2], rigid[:2], time_s=instants))  # fmt: skip
    return out
