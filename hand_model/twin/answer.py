"""The truth of a session as a plain table, for answer.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from .schedule import TrialPlan
from .truth import HandTruth


def answer_table(
    truth: HandTruth,
    trials: Sequence[TrialPlan],
    effects: Sequence[Mapping[str, Any]],
    seed: int,
    contacts: Mapping[str, Mapping[str, Any]],
) -> dict[str, Any]:
    """Effects (a single "none" where nothing is hidden), kinematics, motors, clock, noise, contacts and surfaces."""
    return _plain(
        {
            "format": "hand-twin-answer/1",
            "seed": seed,
            "side": truth.side,
            "effects": list(effects) or [{"effect": "none", "finger": None, "joint": None, "signal": None}],
            "kinematics": {
                finger.name: {
                    "axes": [joint.axis_palm for joint in finger.joints],
                    "centres": [joint.centre_palm for joint in finger.joints],
                    "markers": {label: p for joint in finger.joints for label, p in joint.markers_palm.items()},
                    "proximal_rad": finger.proximal_rad,
                    "distal_rad": finger.distal_rad,
                }
                for finger in truth.fingers
            },
            "landmarks": truth.landmarks_palm,
            "palm_markers": truth.palm_markers_palm,
            "motor": {name: asdict(motor) for name, motor in truth.motors.items()},
            "clock": {"offset_s": truth.log.clock_offset_s, "rate": truth.log.clock_rate},
            "trials": {t.name: {"start_s": t.start_s, "duration_s": t.duration_s} for t in trials},
            "grasps": contacts,
            "surfaces": {s.segment: asdict(s) for s in truth.surfaces},
            "noise": {"mocap": asdict(truth.mocap), "log": asdict(truth.log)},
        }
    )


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value
