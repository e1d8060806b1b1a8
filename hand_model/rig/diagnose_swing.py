"""One joint driven by a voltage or by nothing: what is missing, by the motion that MuJoCo simulates in open loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..session import Session
from .declared import DeclaredFit
from .findings import Finding
from .model import RigModel, load_rig
from .replay import replay_rig
from .states import noise_std
from .swing import INDEX, PARAMETERS, STEP_S, Swing, Task, vector
from .swing_build import build_swing, windows_s
from .swing_compete import LEAST_GAIN, Round, Variant, compete_swing, fit_stages, free_declared
from .swing_patch import write_swing
from .words import shares, statement

SEARCH_STEP_S = 4e-3
RESAMPLES = 500


def diagnose_swing(rig: RigModel, session: Session, fit: DeclaredFit, say: Callable[[str], None]) -> tuple:
    """The same for one joint driven by a voltage or by nothing: MuJoCo's motion in open loop is what is compared."""
    windows = windows_s(rig, fit)
    stages = [build_swing(rig, fit, SEARCH_STEP_S, w) for w in windows]
    free = free_declared(stages[0])
    declared = fit_stages(stages, [Task(free, vector(stages[0].initial), ())], 15)[0]
    taken, rounds = compete_swing(stages, declared)
    say(f"{rig.name}: {', '.join(v.key for v in taken) or 'nothing'}")
    # Last, at the step of the replay; a free swing over whole recordings, for its phase is known well enough by now.
    fine = [build_swing(rig, fit, STEP_S, w) for w in (windows if stages[0].driven else (*windows[1:], np.inf))]
    sets = [tuple(dict.fromkeys((*free, *(n for v in taken[:k] for n in v.start)))) for k in range(len(taken) + 1)]
    last = rounds[-1].fit if rounds else declared
    starts = [declared.theta] + [
        np.where(np.isin(PARAMETERS, s), last.theta, vector(stages[0].initial)) for s in sets[1:]
    ]
    fits = fit_stages(fine, [Task(s, t, ()) for s, t in zip(sets, starts, strict=True)], 8)
    rounds = tuple(replace(r, fit=f) for r, f in zip(rounds, fits[1:], strict=True))
    swing = fine[0]
    files = [write_swing(rig, swing, f.theta) for f in fits]
    replays = [replay_rig(session, load_rig(session, x)) for x in files]
    held = bool(rig.select(True))  # without validation recordings the training ones measure, and the report says so
    figures = [r.figure("position_rmse", held) for r in replays]
    enough = 1.0 - LEAST_GAIN  # what is worth a name in training is worth it here
    holds = next((k for k in range(len(taken)) if figures[k + 1] > enough * figures[k]), len(taken))
    rejected = [{"effect": v.key, "reason": "error on validation trials does not fall"} for v in taken[holds:]]
    taken, rounds, figures = taken[:holds], rounds[:holds], figures[: holds + 1]
    means = [r.figure("position_mae", held) for r in replays]
    found = []
    for k, (variant, round_) in enumerate(zip(taken, rounds, strict=True)):
        proof = {"metric": "position_rmse", "unit": rig.unit(rig.joints[0]), "before": figures[k], "after": figures[k + 1],
                 "noise_floor": _resolution(rig), "ci95_reduction": _fall(replays[k], replays[k + 1], held),
                 "held_out": [t.name for t in rig.select(held)], "engine": "mujoco"}  # fmt: skip
        found.append(_swing_finding(rig, variant, round_, swing, proof))
    lack = {"metric": "position_rmse", "unit": rig.unit(rig.joints[0]), "before": figures[0], "after": figures[-1],
            "one_effect": figures[min(1, len(figures) - 1)],
            "two_effects": figures[min(2, len(figures) - 1)], "engine": "mujoco", "mae_before": means[0], "mae_after": means[holds],
            "noise_floor": _resolution(rig),
            "declared": {n: float(fits[0].theta[INDEX[n]]) for n in free}}  # fmt: skip
    return shares(found), rejected, lack, files[holds], files[0]


def _resolution(rig: RigModel) -> float:
    return float(np.median([noise_std(t.position[rig.joints[0]]) for t in rig.trials]))


def _fall(before: Any, after: Any, held: bool) -> list[float]:
    """95 % interval of the fall of the held-out rmse, recordings resampled."""
    a = np.array([r.position_rmse**2 for r in before.joints if r.validate == held])
    b = np.array([r.position_rmse**2 for r in after.joints if r.validate == held])
    draw = np.random.default_rng(0).integers(0, len(a), (RESAMPLES, len(a)))
    fall = np.sqrt(a[draw].mean(1)) - np.sqrt(b[draw].mean(1))
    return [float(x) for x in np.percentile(fall, [2.5, 97.5])]


def _swing_finding(rig: RigModel, variant: Variant, round_: Round, swing: Swing, proof: dict) -> Finding:
    joint = rig.joints[0]
    parameters = {n: {"value": float(round_.fit.theta[INDEX[n]]), "unit": "", "ci95": None} for n in variant.start}
    where = {"finger": None, "joint": joint, "actuator": (rig.drive(joint).name if rig.drive(joint) else None),
             "signal": "position", "marker": None, "trials": proof["held_out"],
             "share_of_mismatch": max(proof["before"] ** 2 - proof["after"] ** 2, 0.0)}  # fmt: skip
    native = set(variant.start) <= {"drag"}
    return Finding(
        variant.effect, (variant.effect, *(e for e in round_.equals if e != variant.effect)), round_.probability,
        tuple((k, p) for k, p in round_.rivals if k != variant.key), where,
        statement(variant.effect, variant.name, joint, {k: v["value"] for k, v in parameters.items()}, proof), parameters, proof,
        {"native": native, "mjcf": f"joint[@name='{joint}']/@damping" if native else 'custom/text[@name="hand_model"]',
         "urdf": "not expressible: kept in rig.xml"},
    )  # fmt: skip
