"""How warm a joint is: by the clock that runs on through a session's recordings, or by a temperature that is logged."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from ..effects import DriveState, effect
from .model import RigModel, RigTrial
from .states import fill_gaps

Array = NDArray[np.float64]
WARMS = "thermal_friction_drift"


def warmth(rig: RigModel, trial: str, joint: str, time_s: Array, channels: Mapping[str, Array]) -> dict[str, Array]:
    """What is known of it in a recording at times (n,) [s] from its begin: "elapsed" [s] since the session began, where
    one clock runs on, and "temperature" (n,), where one of the channels, (n,) each, tells it."""
    out, begun, logged = {}, rig.begun_s, _temperature(rig, joint, channels)
    if trial in begun:
        out["elapsed"] = begun[trial] + time_s - time_s[0]
    if logged is not None:
        out["temperature"] = channels[logged]
    return out


def still_to_come(rig: RigModel, trial: RigTrial, joint: str, shape: Mapping[str, float]) -> Array:
    """Share (n,) of the change with warming that is still to come, at the recording's times; all of it where nothing is
    known of a shape that asks for more."""
    time_s, one = trial.time_s, np.ones(len(trial.time_s))
    known = {k: fill_gaps(time_s, v) for k, v in warmth(rig, trial.name, joint, time_s, trial.extra).items()}
    if "coldest" in shape and "temperature" not in known:
        return one
    state = DriveState("", "", time_s, one, one, 0 * one, one, one[:, None], extra=known, declared_names=("coulomb",))
    return effect(WARMS).columns(state, shape)[:, 0]


def _temperature(rig: RigModel, joint: str, channels: Collection[str]) -> str | None:
    """The extra channel that says how warm a joint or its drive is, or the only one that tells a temperature; None where
    there is none."""
    drive = rig.drive(joint)
    told = [c for c in channels if "temp" in c.lower() and ":" not in c]
    own = [c for c in told if joint in c or (drive is not None and drive.name in c)]
    return next(iter(own or (told if len(told) == 1 else ())), None)
