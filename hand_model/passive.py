"""Effects that MJCF has no element for, applied by MuJoCo's passive-force callback: one line turns them on.

    model = mujoco.MjModel.from_xml_path("bebionic_left/bebionic_left.xml")
    hand_model.effects_on(model, "bebionic_left")

Parameters come from `hand.json` beside the MJCF. Loads of a drive are forces on its motor joint; a follower that
departs from its map moves the target of its equality. Python is called in every step: some ten microseconds per effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from .effects import effect
from .effects.chain import behind_inputs, map_ahead, map_to
from .effects.law import Bristle, Law, Moment
from .errors import DescriptionError
from .hand import Effect, Hand, load_hand

LEAST_GIVE = 0.1  # [%]: the bristle of a motor whose file has plain Coulomb friction


@dataclass(frozen=True)
class Place:
    """Where one effect acts in a model. actuator: id of the motor, in the unit [effort per raw]. equality: id of the
    follower's equality, None for a load on the motor joint; map: of the one with its polynomial, ahead of what is lost
    behind it. address, dof: of the joint whose state the law reads, the motor's or the map's driver; scale: its
    coordinate per unit of the law. body: of the palm. give: bristle length [%]. plane: (2, 3) unit vectors in the palm,
    along the open finger and where flexion takes it."""

    effect: Effect
    actuator: int
    unit: float
    equality: int | None
    map: int | None
    address: int
    dof: int
    scale: float
    body: int
    give: float
    plane: Any


class Memory:
    """What the laws remember of one simulation (one MjData)."""

    def __init__(self, places: tuple[Place, ...]) -> None:
        self.time_s = 0.0
        self.laws: tuple[Law, ...] = tuple(_law(p.effect) for p in places)
        self.bristles = tuple(Bristle(p.give) for p in places)


class EffectsOn:
    """Effects that are switched on for one model; `off()`, or leaving a `with` block, switches them off.

    names: of the effects that the callback applies (those that the MJCF holds are on anyway).
    """

    def __init__(self, model: Any, places: tuple[Place, ...]) -> None:
        self.places, self.model = places, model  # held, so that its address is no other model's
        self.names = tuple(p.effect.effect for p in places)
        self.memories: dict[int, Memory] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.off()

    def off(self) -> None:
        """Switch them off; other models keep theirs."""
        _ON.pop(self.model._address, None)
        _install()

    def apply(self, model: Any, data: Any) -> None:
        """Add the effects' forces at the state in `data`; called by MuJoCo within mj_step, mj_forward and
        mj_inverse."""
        memory = self.memories.get(data._address)
        if memory is None or data.time < memory.time_s:  # another simulation, or this one begun again
            memory = self.memories[data._address] = Memory(self.places)
            memory.time_s = data.time
        step = data.time - memory.time_s
        memory.time_s = data.time
        for place, law, bristle in zip(self.places, memory.laws, memory.bristles, strict=True):
            if place.equality is None:
                data.qfrc_passive[place.dof] -= place.unit * law(_moment(model, data, place, step, bristle))
            else:
                _move_target(data, place.equality, law(_follower(model, data, place, step)))


def effects_on(model: Any, folder: str | Path | Hand) -> EffectsOn:
    """Switch on, for a mujoco.MjModel, the effects of its hand that MJCF cannot hold; every mj_step applies them from
    here on.

    folder: the compiled folder that the model was loaded from (its `hand.json` is read), a .hand file, or a Hand.
    Returns an object that switches them off. Raises HandFileError where there is no hand, DescriptionError where the
    model is not a mujoco.MjModel.
    """
    if not hasattr(model, "actuator_trnid"):
        raise DescriptionError(f"effects_on needs a mujoco.MjModel, not a {type(model).__name__}")
    hand = (
        folder
        if isinstance(folder, Hand)
        else load_hand(Path(folder) / "hand.json" if Path(folder).is_dir() else folder)
    )
    places = tuple(p for e in hand.effects if _law(e) is not None for p in [_place(model, hand, e)] if p is not None)
    on = EffectsOn(model, places)
    if places:
        _ON[model._address] = on
        _install()
    return on


_ON: dict[int, EffectsOn] = {}  # by the address of the model


def _install() -> None:
    """MuJoCo has one callback per process: it finds the model's own effects."""
    import mujoco

    mujoco.set_mjcb_passive(_passive if _ON else None)


def _passive(model: Any, data: Any) -> None:
    on = _ON.get(model._address)
    if on is not None:
        on.apply(model, data)


def _law(found: Effect) -> Law | None:
    return effect(found.effect).law({name: e.value for name, e in found.parameters.items()})


def _place(model: Any, hand: Hand, found: Effect) -> Place | None:
    """Where an effect acts in this model; None where the model has no such motor (the other position of a thumb)."""
    import mujoco

    def identity(kind: Any, name: str) -> int:
        return int(mujoco.mj_name2id(model, kind, name))

    kinds = mujoco.mjtObj
    name = found.where.get("actuator")
    actuator = identity(kinds.mjOBJ_ACTUATOR, str(name))
    number = identity(kinds.mjOBJ_NUMERIC, f"{name}_effort_per_raw")
    if actuator < 0 or number < 0:
        return None
    joint = int(model.actuator_trnid[actuator, 0])
    station = effect(found.effect).station
    equality = None
    if station != "drive":
        if station == "encoder":
            equality = identity(kinds.mjOBJ_EQUALITY, f"{name}_map")
        else:
            follower = identity(kinds.mjOBJ_JOINT, f"{found.where.get('finger')}_{found.where.get('joint')}")
            equality = map_to(model, follower) if follower >= 0 else None
        if equality is None or equality < 0:
            return None
    motor = next((m for m in hand.motors if m.actuator == name), None)
    give = 0.0 if motor is None or "presliding" not in motor.parameters else motor.parameters["presliding"].value
    unit = float(model.numeric_data[model.numeric_adr[number]])
    mapped = None if equality is None else map_ahead(model, behind_inputs(model, int(model.eq_obj2id[equality])))
    mapped = equality if mapped is None else mapped
    driver = joint if mapped is None else int(model.eq_obj2id[mapped])
    scale = math.pi / 180 if station not in ("drive", "encoder") else 1.0  # radians for degrees, or percent
    return Place(
        found,
        actuator,
        unit,
        equality,
        mapped,
        int(model.jnt_qposadr[driver]),
        int(model.jnt_dofadr[driver]),
        scale,
        int(model.body_parentid[model.jnt_bodyid[joint]]),
        max(give, LEAST_GIVE),
        _plane(model, str(name)),
    )


def _plane(model: Any, actuator: str) -> Any:
    """Unit vectors (2, 3) in the palm, in the plane of the finger's first joint; the palm's x and y where the model has
    a motor alone."""
    import mujoco

    push = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, f"{actuator}_push")
    if push < 0:
        return np.eye(3)[:2]
    joint = int(model.wrap_objid[model.tendon_adr[push]])
    body = int(model.jnt_bodyid[joint])
    axis, tips = model.jnt_axis[joint], [model.site_pos[s] for s in range(model.nsite) if model.site_bodyid[s] == body]
    arms = (
        [model.body_pos[b] for b in range(model.nbody) if model.body_parentid[b] == body]
        + tips
        + [model.body_ipos[body]]
    )
    along = arms[0] - axis * (axis @ arms[0])
    along = along / max(float(np.linalg.norm(along)), 1e-9)
    return np.stack([along, np.cross(axis, along)])


def _moment(model: Any, data: Any, place: Place, step: float, bristle: Callable[[float], float]) -> Moment:
    position = float(data.qpos[place.address])
    along, across = (place.plane @ (data.xmat[place.body].reshape(3, 3).T @ model.opt.gravity)).tolist()
    return Moment(
        data.time,
        step,
        position,
        float(data.qvel[place.dof]),
        bristle(position),
        place.give,
        float(data.actuator_force[place.actuator]) / place.unit,
        along,
        across,
    )


def _follower(model: Any, data: Any, place: Place, step: float) -> Moment:
    position, scale = float(data.qpos[place.address]), place.scale
    _, c1, c2, c3, c4 = model.eq_data[place.map, :5].tolist()
    slope = c1 + position * (2 * c2 + position * (3 * c3 + position * 4 * c4))
    return Moment(
        data.time,
        step,
        position / scale,
        float(data.qvel[place.dof]) / scale,
        0.0,
        place.give,
        float(data.actuator_force[place.actuator]) / place.unit,
        0.0,
        0.0,
        slope * scale,
    )


def _move_target(data: Any, equality: int, shift_rad: float) -> None:
    """Move the target of a joint equality: its violation counts from there. The reference acceleration is computed
    after this callback, within the same step."""
    equalities = slice(data.ne)  # which come first
    data.efc_pos[equalities] -= shift_rad * (data.efc_id[equalities] == equality)


__all__ = ["EffectsOn", "effects_on"]
