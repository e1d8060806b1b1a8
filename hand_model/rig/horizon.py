"""How far a rig's files predict its motion: MuJoCo in open loop, over whole recordings or as far as a simulation
carries.

An unstable or chaotic mechanism leaves its recording however good the model is; there the simulation is started again
from the recorded state after a horizon (multiple shooting, Bock 1981), and the horizon is said.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .mjcf import read_effects
from .model import RigModel, RigTrial
from .overrides import compile_model
from .replay import States, can_simulate, recorded_states, simulate_trial
from .states import fill_gaps
from .stepper import EffectStepper

Array = NDArray[np.float64]
HORIZONS_S = (np.inf, 4.0, 2.0, 1.0, 0.5, 0.25, 0.1)
NO_LAW = "no law in open loop"
CARRIES = 0.5  # an error below this share of the recorded motion's standard deviation still predicts it


def open_loop(
    rig: RigModel,
    before: bytes,
    after: bytes,
    refused: Collection[tuple[str, str]] = (),
    validate: bool = True,
    known: dict[tuple[bytes, float, bool], Array] | None = None,
) -> dict[str, Any]:
    """Position error of both files on the trials held out (on all where none is), at the longest horizon that carries.

    refused: (trial, joint) whose effort cannot be trusted; their trials are left out. validate: False for the training
    trials; known:
    errors of files kept from one call to the next, of one rig and one `refused`. Returns {"not_run": reason} where the
    files cannot be simulated so, else the horizon ("whole" or [s]), the ratio and each joint's figures.
    """
    wrong = {t for t, _ in refused}
    trials = [t for t in (rig.select(validate) or rig.trials) if t.name not in wrong and can_simulate(rig, t)]
    if rig.couplings:
        return {"not_run": "coupled joints: what drives the transmission from behind is not recorded as an effort"}
    if not trials:
        return {"not_run": "no recording held out has all of its efforts or controls"}
    unknown = EffectStepper(compile_model(replace(rig, xml=after)), read_effects(after)).unknown
    if unknown:
        return {"not_run": f"{NO_LAW} for {', '.join(sorted(set(unknown)))}"}
    states, known = [recorded_states(rig, t) for t in trials], {} if known is None else known

    def error(xml: bytes, horizon_s: float) -> Array:
        if (xml, horizon_s, validate) not in known:
            known[xml, horizon_s, validate] = _error(replace(rig, xml=xml), trials, states, horizon_s)
        return known[xml, horizon_s, validate]

    for horizon in HORIZONS_S:
        old = error(before, horizon)
        spread = np.sqrt(np.mean([np.nanvar(np.stack([t.position[j] for j in rig.joints], 1), 0) for t in trials], 0))
        if not (old < CARRIES * spread).all():
            continue
        new = error(after, horizon)
        if np.isfinite(new).all():
            joints = {
                j: {"before": float(a), "after": float(b), "unit": rig.unit(j)}
                for j, a, b in zip(rig.joints, old, new, strict=True)
            }
            return {
                "metric": "position_rmse",
                "horizon_s": "whole" if np.isinf(horizon) else horizon,
                "engine": "mujoco",
                "ratio": float(np.sqrt(np.mean((new / np.maximum(old, 1e-300)) ** 2))),
                "joints": joints,
                "held_out": [t.name for t in trials if t.validate],
            }
    return {"not_run": f"a simulation leaves the recordings within {HORIZONS_S[-1]:g} s"}


def _error(rig: RigModel, trials: Sequence[RigTrial], states: Sequence[States], horizon_s: float) -> Array:
    """Root mean square position error (joints,) over the trials; infinite where a simulation breaks down."""
    squares, count = np.zeros(len(rig.joints)), 0
    for trial, known in zip(trials, states, strict=True):
        recorded = np.stack([fill_gaps(trial.time_s, trial.position[j]) for j in rig.joints], 1)
        error = simulate_trial(rig, trial, horizon_s, known)[1] - recorded
        squares += np.where(np.isfinite(error).all(0), np.sum(np.nan_to_num(error) ** 2, 0), np.inf)
        count += len(error)
    return np.sqrt(squares / count)


__all__ = ["open_loop"]
