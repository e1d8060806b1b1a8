"""The manifest `session.toml` of a recorded session."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .files import toml_text
from .schedule import Plan, TrialPlan
from .truth import HandTruth


def manifest_text(truth: HandTruth, trials: Sequence[TrialPlan], plan: Plan, mocap_format: str) -> str:
    """The manifest's text. A session with a pivot trial names the probe's markers only: its tip is to be calibrated."""
    probe: Any = list(truth.probe) if plan.pivot else dict(truth.probe)
    roles = dict(zip(("origin", "medial", "lateral"), truth.palm_markers_palm, strict=True))
    lines = ['format = "hand-session/1"']
    lines += _table("[hand]", {"name": truth.name, "side": truth.side})
    lines += _table("[world]", {"gravity": list(truth.gravity_world)})
    lines += _table("[palm]", {"markers": roles})
    lines += _table("[probe]", {"markers": probe})
    for name, motor in truth.motors.items():
        full = int(motor.controller.speed_raw_full)
        lines += _table("[[actuator]]", {"name": name, "speed_full": full, "current_full": 255})
    for finger in truth.fingers:
        lines += _table("[[finger]]", {"name": finger.name, "actuator": finger.actuator})
        lines.append("segments = [")
        lines += [f"  {toml_text({'name': j.name, 'markers': list(j.markers_palm)})}," for j in finger.joints]
        lines.append("]")
    for trial in trials:
        lines += _table("[[trial]]", _trial(trial, mocap_format))
    return "\n".join(lines) + "\n"


def _table(head: str, values: dict[str, Any]) -> list[str]:
    return ["", head, *(f"{key} = {toml_text(value)}" for key, value in values.items())]


def _trial(trial: TrialPlan, mocap_format: str) -> dict[str, Any]:
    out: dict[str, Any] = {"kind": trial.kind}
    named = {
        "finger": trial.finger,
        "name": trial.landmark,
        "joint": trial.joint,
        "side": trial.side,
        "segment": trial.segment,
    }
    out |= {key: value for key, value in named.items() if value is not None}
    if trial.object is not None:
        out["object"] = trial.object
    if trial.program is not None:
        out["log"] = f"log/{trial.name}.csv"
    if trial.mocap:
        out["mocap"] = f"mocap/{trial.name}.{mocap_format}"
    if trial.validate:
        out["purpose"] = "validate"
    return out
