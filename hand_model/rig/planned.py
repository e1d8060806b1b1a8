"""Is an effort what a planner asks for: the declared machine moved along its targets, and not as it moved?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .declared import DeclaredFit, fit_declared
from .model import RigModel, RigTrial

FOLLOWED = 0.02  # of the rms of an effort: where the motion leaves no more, nobody need ask what the targets leave
APART = 0.1  # of what the motion leaves, at most, the targets leave of an effort that is theirs
MOVED = 0.5  # of the range, and of the time, of the motion, over which a joint's target must move


def planned(rig: RigModel, fit: DeclaredFit) -> dict[tuple[str, str], float]:
    """Share (rms over rms) that the declared model, fitted along the targets of the joints, leaves of each (trial, joint)
    whose measured motion leaves ten times as much. fit: along the measured motion.

    A true torque moves the machine as it goes, whatever was asked for; one that is computed beforehand (feed-forward)
    knows nothing of where the machine lags, what it carries, and who pushes it.
    """
    asked = [t for t in rig.trials if _has_targets(t)]
    mine = [fit.quality[k] for t in asked for k in fit.quality if k[0] == t.name]
    if not asked or not mine or np.median(mine) < FOLLOWED or not any(not t.validate for t in asked):
        return {}
    refused = {(t.name, j) for t in asked for j in rig.joints} - set(fit.quality)
    along = fit_declared(replace(rig, trials=tuple(_along_targets(t) for t in asked)), refused)
    moved, told = ({(r.trial, r.joint): float(np.mean(r.moving)) for r in f.rows} for f in (fit, along))
    return {
        k: share
        for k, share in along.quality.items()
        if share < APART * fit.quality[k] and told.get(k, 0.0) > MOVED * moved[k]
    }


def _has_targets(trial: RigTrial) -> bool:
    """Whether every joint has a target, all samples finite, that moves as far as it, or nearly, and is not what was
    measured over again."""
    return bool(trial.effort) and all(
        j in trial.setpoint
        and np.isfinite(trial.setpoint[j]).all()
        and np.ptp(trial.setpoint[j]) > MOVED * np.ptp(q[np.isfinite(q)])
        and not np.array_equal(trial.setpoint[j], q)
        for j, q in trial.position.items()
    )


def _along_targets(trial: RigTrial) -> RigTrial:
    """A recording as if the machine had gone where it was told to."""
    return replace(trial, position={j: trial.setpoint[j] for j in trial.position}, velocity={})
