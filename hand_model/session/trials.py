"""`[[trial]]`: what each kind of recording needs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import did_you_mean
from .node import Node, is_number
from .paths import existing
from .session import Finger, Trial


@dataclass(frozen=True)
class _Kind:
    """What a trial of a kind needs: "needed", "optional" or "" (not read)."""

    finger: str = ""
    mocap: str = ""
    log: str = ""


_KINDS = {
    "flexion": _Kind("needed", "needed", "optional"),
    "excitation": _Kind("needed", "optional", "needed"),
    "grasp": _Kind("needed", "optional", "needed"),
    "landmark": _Kind(mocap="needed"),
    "joint_probe": _Kind("needed", mocap="needed"),
    "surface": _Kind(mocap="needed"),
    "motion": _Kind("optional", "optional", "needed"),
    "pivot": _Kind(mocap="needed"),
}
TRIAL_KINDS = tuple(_KINDS)


def read_trial(node: Node, root: Path, fingers: tuple[Finger, ...], is_rig: bool) -> Trial:
    """One trial of a manifest, checked against what its kind needs.

    Raises SessionError naming the trial and the key that is missing, wrong, or names nothing in this session.
    """
    kind = node.choice("kind", TRIAL_KINDS)
    if is_rig and kind != "motion":
        node.refuse(f'a trial of kind "{kind}" needs a hand; a session with a [rig] has trials of kind "motion"')
    needs = _KINDS[kind]
    finger = _finger(node, kind, needs.finger, fingers)
    log = _file(node, "log", needs.log, root)
    mocap = _file(node, "mocap", needs.mocap, root)
    if finger and log and finger.actuator is None:
        node.refuse(f'finger "{finger.name}" has no actuator and the trial has a log; name the finger\'s actuator')
    joints = [segment.name for segment in finger.segments] if finger else []
    segments = ["palm", *(f"{f.name}/{segment.name}" for f in fingers for segment in f.segments)]
    return Trial(
        kind=kind,
        name=node.table["log"] if log else node.table["mocap"],
        finger=finger.name if finger else None,
        mocap_path=mocap,
        log_path=log,
        landmark=node.choice("name", ("origin", "medial", "lateral")) if kind == "landmark" else None,
        joint=node.choice("joint", joints) if kind == "joint_probe" else None,
        side=node.choice("side", ("medial", "lateral")) if kind == "joint_probe" else None,
        segment=node.choice("segment", segments) if kind == "surface" else None,
        object=node.text("object", None) if kind == "grasp" else None,
        stiffness=node.get("stiffness", (int, float, str), "a number or a text", None) if kind == "grasp" else None,
        validate=node.choice("purpose", ("validate",), None) == "validate",
        set=_settings(node) if kind == "motion" else {},
        actuator=finger.actuator if finger else None,
    )


def _finger(node: Node, kind: str, need: str, fingers: tuple[Finger, ...]) -> Finger | None:
    if not need or (need == "optional" and not node.has("finger")):
        return None
    name = node.text("finger")
    found = [finger for finger in fingers if finger.name == name]
    if not found:
        node.refuse(f'({kind}): no finger "{name}"; {did_you_mean(name, [finger.name for finger in fingers])}')
    return found[0]


def _file(node: Node, key: str, need: str, root: Path) -> Path | None:
    if not need or (need == "optional" and not node.has(key)):
        return None
    path = existing(node, key, root)
    valid = (".csv", ".mcap") if key == "log" else (".c3d", ".tsv", ".trc", ".csv")
    is_folder = path.is_dir()
    if is_folder and (key == "mocap" or not (path / "metadata.yaml").is_file()):
        needed = "a rosbag2 folder with its metadata.yaml or a file" if key == "log" else "a file"
        node.refuse(f'{key} "{node.table[key]}" is a folder; {needed} is needed')
    if not is_folder and path.suffix.lower() not in valid:
        node.refuse(f'{key} "{node.table[key]}" cannot be read; {did_you_mean(path.suffix, valid)}')
    return path


def _settings(node: Node) -> dict[str, Any]:
    """`set = { "kind:name:attribute" = number or list of numbers }`: what the laboratory changed."""
    settings = node.get("set", dict, "a table of model parameters", {})
    for key, value in settings.items():
        parts = key.split(":")
        if not all(parts) or (len(parts) != 2 if parts[0] == "option" else len(parts) < 3):
            node.refuse(f'set names "{key}"; "kind:name:attribute" or "option:attribute" is needed')
        if not (is_number(value) or (isinstance(value, list) and value and all(is_number(x) for x in value))):
            node.refuse(f'set "{key}" is {value!r}; a number or a list of numbers is needed')
    return dict(settings)
