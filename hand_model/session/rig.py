"""Rigs: `[rig]` and `[signals]`, a recorded mechanism that is no hand."""

from __future__ import annotations

from pathlib import Path

from ..errors import SessionError, did_you_mean
from .node import Node
from .paths import inside
from .session import Rig

QUANTITIES = {"joint": ("position", "velocity"), "actuator": ("force", "ctrl", "setpoint")}


def read_rig(node: Node, signals: Node | None, root: Path) -> Rig:
    """The rig's model file and signals (log column -> `joint:NAME:position` and the like).

    Raises SessionError where the model is missing or no XML, or a signal names no quantity, joint or actuator of it.
    """
    model = inside(node, "model", root)
    if not model.is_file():
        node.refuse(f'model "{node.table["model"]}" is missing; an MJCF file in the session is needed')
    if signals is None or not signals.table:
        node.refuse("there is no [signals] table; it says which log column is which quantity of the model")
    names = _model_names(model)
    columns = {column: signals.text(column) for column in signals.table}
    for column, target in columns.items():
        kind, _, rest = target.partition(":")
        name, _, quantity = rest.rpartition(":")
        if kind not in QUANTITIES or not name:
            valid = [f"{k}:NAME:{q}" for k, quantities in QUANTITIES.items() for q in quantities]
            signals.refuse(f'{column} is "{target}"; {did_you_mean(target, valid)}')
        if quantity not in QUANTITIES[kind]:
            signals.refuse(
                f'{column}: "{quantity}" is no quantity of a {kind}; {did_you_mean(quantity, QUANTITIES[kind])}'
            )
        if names is not None and name not in names[kind]:
            signals.refuse(f'{column}: {model.name} has no {kind} "{name}"; {did_you_mean(name, names[kind])}')
    twice = [target for target in columns.values() if list(columns.values()).count(target) > 1]
    if twice:
        signals.refuse(f'"{twice[0]}" is named by two columns; each quantity once is needed')
    return Rig(model, columns)


def _model_names(model: Path) -> dict[str, set[str]] | None:
    """Names of joints and actuators, None where the model takes parts from elsewhere and one file does not tell."""
    from lxml import etree

    try:
        tree = etree.parse(str(model))
    except (etree.XMLSyntaxError, OSError) as error:
        raise SessionError(f"{model}: not readable as XML ({error}); an MJCF file is needed") from None
    if tree.getroot().tag != "mujoco":
        raise SessionError(f"{model}: the root element is <{tree.getroot().tag}>; an MJCF file starts with <mujoco>")
    if any(True for _ in tree.iter("include", "attach", "replicate", "model")):
        return None
    bodies = [body for world in tree.iter("worldbody") for body in world.iter("joint", "freejoint")]
    joints = {element.get("name", "") for element in bodies}
    actuators = {element.get("name", "") for block in tree.iter("actuator") for element in block}
    return {"joint": joints - {""}, "actuator": actuators - {""}}
