"""A rig as the session declares it: the MJCF's joints, drives and couplings, and every trial's log mapped onto them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError, SessionError, did_you_mean
from ..session import Session, Trial

Array = NDArray[np.float64]
QUANTITIES = {"joint": ("position", "velocity"), "actuator": ("force", "ctrl", "setpoint")}


@dataclass(frozen=True)
class Drive:
    """An actuator on one joint. kind: "force" (torque or force is the control), "voltage" (dcmotor), "position"
    (servo).

    gear: control to joint transmission. gain: joint effort per unit of ctrl. offset: declares a constant (affine bias).
    """

    name: str
    joint: str
    kind: str
    gear: float
    gain: float
    offset: bool = False


@dataclass(frozen=True)
class Coupling:
    """An equality between joints: `dependent` = polynomial of `independent`, coefficients ascending (MuJoCo
    polycoef)."""

    name: str
    dependent: str
    independent: str
    polycoef: Array


@dataclass(frozen=True)
class RigTrial:
    """One recording mapped onto the model.

    time_s: (n,) [s] from zero. position, velocity, effort: joint -> (n,), SI, nan where a cell was empty; effort is
    what the drive is recorded to put on the joint (absent where only a voltage or nothing is recorded). voltage,
    setpoint:
    joint -> (n,). extra: columns that no signal names. live: joints whose drive is connected (gear not zero).
    """

    name: str
    validate: bool
    time_s: Array
    position: Mapping[str, Array]
    velocity: Mapping[str, Array]
    effort: Mapping[str, Array]
    voltage: Mapping[str, Array]
    setpoint: Mapping[str, Array]
    extra: Mapping[str, Array]
    set: Mapping[str, Any]
    live: tuple[str, ...]


@dataclass(frozen=True)
class RigModel:
    """The declared model (or a patched one) and the recordings mapped onto it.

    xml: the MJCF as bytes. joints: names in qpos order. couplings, drives: see there. trials: all of the session.
    quantity: column -> (kind, name, attribute).
    """

    name: str
    xml: bytes
    joints: tuple[str, ...]
    slides: frozenset[str]
    drives: tuple[Drive, ...]
    couplings: tuple[Coupling, ...]
    trials: tuple[RigTrial, ...]
    quantity: Mapping[str, tuple[str, str, str]] = field(default_factory=dict)

    def unit(self, joint: str) -> str:
        """[m] for a slide, [rad] for a hinge."""
        return "m" if joint in self.slides else "rad"

    def effort_unit(self, joint: str) -> str:
        """[N] for a slide, [N m] for a hinge."""
        return "N" if joint in self.slides else "N m"

    def select(self, validate: bool) -> tuple[RigTrial, ...]:
        """The trials that take part in fits (False) or that only measure (True)."""
        return tuple(t for t in self.trials if t.validate == validate)

    @property
    def independent(self) -> tuple[str, ...]:
        """Joints that no coupling ties to another."""
        tied = {c.dependent for c in self.couplings}
        # of two joints tied only to each other, the coupling's second is the independent one
        return tuple(j for j in self.joints if j not in tied)

    def drive(self, joint: str) -> Drive | None:
        """The drive of a joint, or None where it is passive."""
        return next((d for d in self.drives if d.joint == joint), None)


def load_rig(session: Session, xml: bytes | None = None) -> RigModel:
    """Read the session's MJCF (or `xml` in its place) and map every `motion` trial onto it.

    Raises SessionError where the session has no rig, a signal names nothing in the model, or a trial's log lacks a
    position; DescriptionError where MuJoCo cannot compile the file.
    """
    import mujoco

    if session.rig is None:
        raise SessionError(f"{session.path}: the session has no [rig]; valid: a table with model and a [signals] table")
    if xml is None:
        if not session.rig.model.is_file():
            raise SessionError(f"{session.rig.model}: no such file; [rig] model must be an MJCF file in the session")
        xml = session.rig.model.read_bytes()
    try:
        model = mujoco.MjModel.from_xml_string(xml.decode())
    except ValueError as error:
        raise DescriptionError(f"{session.rig.model}: MuJoCo cannot read it: {error}") from None
    for j in range(model.njnt):
        if model.jnt_type[j] not in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
            raise DescriptionError(f'{session.rig.model}: joint "{model.joint(j).name}" is neither hinge nor slide')
    joints = tuple(model.joint(j).name for j in range(model.njnt))
    drives = _drives(model, mujoco)
    quantity = {c: _parse(session, c, q, joints, tuple(d.name for d in drives)) for c, q in session.rig.signals.items()}
    if all(attribute != "position" for _, _, attribute in quantity.values()):
        raise SessionError(
            f'{session.path}: [signals] names no position; a log column with "joint:NAME:position" is needed'
        )
    chosen = [t for t in session.trials if t.kind == "motion"]
    if not chosen:
        raise SessionError(f'{session.path}: a rig needs trials of kind "motion"; there is none')
    trials = tuple(_map_trial(t, quantity, drives, model) for t in chosen)
    return RigModel(
        name=session.hand,
        xml=xml,
        joints=joints,
        slides=frozenset(n for j, n in enumerate(joints) if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_SLIDE)),
        drives=drives,
        couplings=_couplings(model, mujoco),
        trials=trials,
        quantity=quantity,
    )


def _drives(model: Any, mujoco: Any) -> tuple[Drive, ...]:
    drives = []
    for a in range(model.nu):
        if model.actuator_trntype[a] != int(mujoco.mjtTrn.mjTRN_JOINT):
            continue
        gear, gain = float(model.actuator_gear[a, 0]), float(model.actuator_gainprm[a, 0])
        bias, kind, offset = model.actuator_biastype[a], "force", False
        if model.actuator_gaintype[a] == int(mujoco.mjtGain.mjGAIN_DCMOTOR):
            resistance, constant = (float(x) for x in model.actuator_gainprm[a, :2])
            kind, gain = "voltage", constant / resistance
        elif bias == int(mujoco.mjtBias.mjBIAS_AFFINE):
            kind = "position" if model.actuator_biasprm[a, 1] != 0 else "force"
            offset = kind == "force"
        joint = model.joint(int(model.actuator_trnid[a, 0])).name
        drives.append(Drive(model.actuator(a).name, joint, kind, gear, gain * gear, offset))
    return tuple(drives)


def _couplings(model: Any, mujoco: Any) -> tuple[Coupling, ...]:
    return tuple(
        Coupling(
            model.equality(e).name,
            model.joint(int(model.eq_obj1id[e])).name,
            model.joint(int(model.eq_obj2id[e])).name,
            np.array(model.eq_data[e, :5], float),
        )
        for e in range(model.neq)
        if model.eq_type[e] == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_obj2id[e] >= 0
    )


def _parse(session: Session, column: str, quantity: str, joints: tuple[str, ...], drives: tuple[str, ...]) -> tuple:
    where = f'{session.path}: signal "{column}" = "{quantity}"'
    parts = quantity.split(":")
    if len(parts) != 3 or parts[0] not in QUANTITIES:
        raise SessionError(f'{where}; valid: "joint:NAME:position|velocity" or "actuator:NAME:force|ctrl|setpoint"')
    kind, name, attribute = parts
    names = joints if kind == "joint" else drives
    if name not in names:
        raise SessionError(f'{where}: no {kind} "{name}" in the model; {did_you_mean(name, names)}')
    if attribute not in QUANTITIES[kind]:
        raise SessionError(f"{where}: {did_you_mean(attribute, QUANTITIES[kind])}")
    return kind, name, attribute


def _map_trial(trial: Trial, quantity: Mapping[str, tuple], drives: tuple[Drive, ...], model: Any) -> RigTrial:
    log = trial.log()
    keep = np.concatenate(([True], np.diff(log.time_s) > 0))  # a repeated time stamp holds no new sample
    time_s = log.time_s[keep] - log.time_s[0]
    maps: dict[str, dict[str, Array]] = {k: {} for k in ("position", "velocity", "force", "ctrl", "setpoint")}
    by_drive = {d.name: d for d in drives}
    for column, (kind, name, attribute) in quantity.items():
        if column not in log.columns:
            if attribute == "position":
                raise SessionError(f'{log.path}: no column "{column}"; {did_you_mean(column, log.columns)}')
            continue
        values = log.columns[column][keep]
        if np.isfinite(values).any():
            maps[attribute][name if kind == "joint" else by_drive[name].joint] = values
    if not maps["position"]:
        named = ", ".join(f'"{c}"' for c, (_, _, attribute) in quantity.items() if attribute == "position")
        raise SessionError(f"{log.path}: no sample of a position in {named}; a log with one is needed")
    gears = {k.split(":")[1]: np.atleast_1d(v)[0] for k, v in trial.set.items() if k.endswith(":gear")}
    live = tuple(d.joint for d in drives if gears.get(d.name, d.gear) != 0)
    effort, voltage = {}, {}
    for drive in drives:
        joint = drive.joint
        if joint in maps["force"]:
            effort[joint] = maps["force"][joint] * drive.gear
        elif joint in maps["ctrl"] and drive.kind == "force":
            effort[joint] = maps["ctrl"][joint] * drive.gain
        elif joint in maps["ctrl"] and drive.kind == "voltage":
            voltage[joint] = maps["ctrl"][joint]
    extra = {c: v[keep] for c, v in log.columns.items() if c not in quantity and np.isfinite(v).any()}
    return RigTrial(
        trial.name,
        trial.validate,
        time_s,
        maps["position"],
        maps["velocity"],
        effort,
        voltage,
        maps["setpoint"],
        extra,
        dict(trial.set),
        live,
    )
