"""A rig as the session declares it: the MJCF's joints, drives and couplings, and every trial's log mapped onto them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError, SessionError, did_you_mean
from ..session import Session, Trial
from ..session.check import check_interval
from .complete import completed
from .driven import Coupling, couplings_of, driven_first
from .glitches import glitches
from .overrides import apply_overrides
from .states import LEAST_SAMPLES
from .winding import with_windings

Array = NDArray[np.float64]
SLOWEST_S = 0.5  # between rows: a thousand a second, stamped in milliseconds, lie farther apart
QUANTITIES = {"joint": ("position", "velocity"), "actuator": ("force", "ctrl", "setpoint")}


@dataclass(frozen=True)
class Drive:
    """An actuator on one joint. kind: "force" (torque or force is the control), "voltage" (dcmotor, and a servo on
    velocity of which the control is recorded, which is the same), "position" (servo on position), "velocity" (servo on
    velocity).

    gear: control to joint transmission. gain: joint effort per unit of ctrl. offset: declares a constant (affine bias).
    bias: (3,) joint effort that it adds by itself, constant, per joint position and per joint velocity. limits: of the
    joint effort; targets: of what it is told.
    """

    name: str
    joint: str
    kind: str
    gear: float
    gain: float
    offset: bool = False
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    limits: tuple[float, float] = (-np.inf, np.inf)
    targets: tuple[float, float] = (-np.inf, np.inf)

    def answer(self, target: Array, position: Array, velocity: Array) -> Array:
        """Joint effort (n,) that it gives when it is told a target (n,), at a joint's position and velocity (n,)."""
        constant, by_position, by_velocity = self.bias
        effort = self.gain * np.clip(target, *self.targets) + constant + by_position * position + by_velocity * velocity
        return np.clip(effort, *self.limits)

    def along(self, time_s: Array, target: Array, position: Array) -> Array:
        """The same (n,) along a joint's recorded positions, at times [s]."""
        return self.answer(target, position, np.gradient(position, time_s))


@dataclass(frozen=True)
class RigTrial:
    """One recording mapped onto the model.

    time_s: (n,) [s] from zero. position, velocity, effort: joint -> (n,), SI, nan where a cell was empty; effort is
    what the drive is recorded to put on the joint (absent where only a voltage or nothing is recorded). voltage,
    setpoint:
    joint -> (n,). extra: columns that no signal names. live: joints whose drive is connected (gear not zero). drives:
    joint -> its drive as this recording has it, the declared one where it is not connected. clipped:
    joint -> (n,) samples at which its effort stood on a limit of its reading; they are nan. dropped: column -> how many
    of its readings no machine gave; they are nan. clock_s: what the recording's own clock [s] says at its begin.
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
    drives: Mapping[str, Drive] = field(default_factory=dict)
    clipped: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    dropped: Mapping[str, int] = field(default_factory=dict)
    clock_s: float = 0.0

    def tells(self, drive: Drive) -> bool:
        """Whether what a drive puts in is recorded, or what it is told, or it is not connected."""
        told = {"voltage": self.voltage, "position": self.setpoint}.get(drive.kind, {})
        return drive.joint not in self.live or drive.joint in self.effort or drive.joint in told


@dataclass(frozen=True)
class RigModel:
    """The declared model (or a patched one) and the recordings mapped onto it.

    xml: the MJCF as bytes. joints: names in qpos order. couplings, drives: see there. trials: all of the session.
    quantity: column -> (kind, name, attribute). notes: what of the session was left out, and why.
    """

    name: str
    xml: bytes
    joints: tuple[str, ...]
    slides: frozenset[str]
    drives: tuple[Drive, ...]
    couplings: tuple[Coupling, ...]
    trials: tuple[RigTrial, ...]
    quantity: Mapping[str, tuple[str, str, str]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

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

    @property
    def begun_s(self) -> Mapping[str, float]:
        """When each trial began [s] since the first of them, where one clock runs on through all; else none."""
        ordered = sorted(self.trials, key=lambda t: t.clock_s)
        runs_on = all(b.clock_s >= a.clock_s + a.time_s[-1] for a, b in pairwise(ordered))
        return {t.name: t.clock_s - ordered[0].clock_s for t in self.trials} if len(ordered) > 1 and runs_on else {}

    def untold(self) -> str:
        """What no training recording tells that a balance needs, "" where one tells all."""
        blind = [{j for j in self.joints if j not in t.position} for t in self.select(validate=False)]
        unseen = set.intersection(*blind) if blind else set()
        if unseen:
            return f'no position of joint "{min(unseen)}" is recorded; that of every joint of the model is needed'
        deaf = [{d.name for d in self.drives if not t.tells(d)} for t in self.select(validate=False)]
        unheard = set.intersection(*deaf) if deaf else set()
        if unheard:
            return f'nothing that "{min(unheard)}" gives is recorded; its force, or what it is told, is needed'
        return ""


def load_rig(session: Session, xml: bytes | None = None) -> RigModel:
    """Read the session's MJCF (or `xml` in its place) and map every `motion` trial onto it.

    Trials of a few samples are left out, with a note. Raises SessionError where the session has no rig, a signal names
    nothing in the model, a trial's log lacks a position or is not in seconds, or none is long enough; DescriptionError
    where MuJoCo cannot compile the file, or two drives act on one joint.
    """
    import mujoco

    if session.rig is None:
        raise SessionError(f"{session.path}: the session has no [rig]; valid: a table with model and a [signals] table")
    if xml is None:
        if not session.rig.model.is_file():
            raise SessionError(f"{session.rig.model}: no such file; [rig] model must be an MJCF file in the session")
        xml = session.rig.model.read_bytes()
    try:
        xml = completed(xml, session.rig.model.parent)
    except DescriptionError as error:
        raise DescriptionError(f"{session.rig.model}: {error}") from None
    model = mujoco.MjModel.from_xml_string(xml.decode())
    for j in range(model.njnt):
        if model.jnt_type[j] not in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
            raise DescriptionError(f'{session.rig.model}: joint "{model.joint(j).name}" is neither hinge nor slide')
    joints = tuple(model.joint(j).name for j in range(model.njnt))
    drives = _drives(model, mujoco)
    if (turned := driven_first(xml, couplings_of(model), {d.joint for d in drives})) is not xml:
        xml, model = turned, mujoco.MjModel.from_xml_string(turned.decode())
    quantity = {c: _parse(session, c, q, joints, tuple(d.name for d in drives)) for c, q in session.rig.signals.items()}
    told, given = ({n for _, n, attribute in quantity.values() if attribute == a} for a in ("ctrl", "force"))
    if slower := [d.name for d in drives if d.kind == "velocity" and d.name in told - given]:
        xml = with_windings(xml, model, slower)
        model = mujoco.MjModel.from_xml_string(xml.decode())
        drives = _drives(model, mujoco)
    if all(attribute != "position" for _, _, attribute in quantity.values()):
        raise SessionError(
            f'{session.path}: [signals] names no position; a log column with "joint:NAME:position" is needed'
        )
    chosen = [t for t in session.trials if t.kind == "motion"]
    if not chosen:
        raise SessionError(f'{session.path}: a rig needs trials of kind "motion"; there is none')
    trials = tuple(_map_trial(t, quantity, drives, model) for t in chosen)
    short = [t for t in trials if len(t.time_s) < LEAST_SAMPLES]
    if len(short) == len(trials):
        raise SessionError(
            f"{session.path}: {short[0].name} holds {len(short[0].time_s)} samples, and no trial more than "
            f"{max(len(t.time_s) for t in short)}; {LEAST_SAMPLES} or more are needed"
        )
    return RigModel(
        name=session.hand,
        xml=xml,
        joints=joints,
        slides=frozenset(n for j, n in enumerate(joints) if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_SLIDE)),
        drives=drives,
        couplings=couplings_of(model),
        trials=tuple(t for t in trials if t not in short),
        quantity=quantity,
        notes=(
            *(
                f"{t.name}: {len(t.time_s)} samples are too few, and are left out; {LEAST_SAMPLES} or more are needed"
                for t in short
            ),
            *_glitches_told([t for t in trials if t not in short]),
        ),
    )


def _glitches_told(trials: Sequence[RigTrial]) -> list[str]:
    """What is to be said of readings that are left out."""
    columns = dict.fromkeys(c for t in trials for c in t.dropped)
    return [
        f'"{c}": {sum(t.dropped.get(c, 0) for t in trials)} single readings stand far outside all others and are left '
        f"out (first in {next(t.name for t in trials if c in t.dropped)})"
        for c in columns
    ]


def _drives(model: Any, mujoco: Any) -> tuple[Drive, ...]:
    drives = []
    for a in range(model.nu):
        if model.actuator_trntype[a] not in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
            continue
        gear, gain = float(model.actuator_gear[a, 0]), float(model.actuator_gainprm[a, 0])
        bias, kind, offset = model.actuator_biastype[a], "force", False
        if model.actuator_gaintype[a] == int(mujoco.mjtGain.mjGAIN_DCMOTOR):
            resistance, constant = (float(x) for x in model.actuator_gainprm[a, :2])
            kind, gain = "voltage", constant / resistance
        elif bias == int(mujoco.mjtBias.mjBIAS_AFFINE):
            by_position, by_velocity = model.actuator_biasprm[a, 1:3]
            kind = "position" if by_position != 0 else "velocity" if by_velocity != 0 else "force"
            offset = kind == "force"
        joint = model.joint(int(model.actuator_trnid[a, 0])).name
        drives.append(
            Drive(
                model.actuator(a).name,
                joint,
                kind,
                gear,
                gain * gear,
                offset,
                tuple(float(x) for x in model.actuator_biasprm[a, :3] * gear ** np.array([1, 2, 2])),
                _within(model.actuator_forcelimited[a], model.actuator_forcerange[a] * gear),
                _within(model.actuator_ctrllimited[a], model.actuator_ctrlrange[a]),
            )
        )
    return tuple(drives)


def _within(limited: int, ends: Array) -> tuple[float, float]:
    """Least and greatest of two ends, none where nothing is limited."""
    return (float(np.min(ends)), float(np.max(ends))) if limited else (-np.inf, np.inf)


def _set_drives(drives: tuple[Drive, ...], model: Any, trial: Trial) -> tuple[Drive, ...]:
    """The drives as a trial's overrides set them."""
    import mujoco

    changes = {k: v for k, v in trial.set.items() if k.startswith("actuator:")}
    if not changes:
        return drives
    own = copy(model)
    apply_overrides(own, changes)
    return _drives(own, mujoco)


def _parse(session: Session, column: str, quantity: str, joints: tuple[str, ...], drives: tuple[str, ...]) -> tuple:
    where = f'{session.path}: signal "{column}" = "{quantity}"'
    parts = quantity.split(":")
    if len(parts) != 3 or parts[0] not in QUANTITIES:
        raise SessionError(f'{where}; valid: "joint:NAME:position|velocity" or "actuator:NAME:force|ctrl|setpoint"')
    kind, name, attribute = parts
    names = joints if kind == "joint" else drives
    if name not in names:
        what = "joint" if kind == "joint" else "actuator that drives a joint"
        raise SessionError(f'{where}: no {what} "{name}" in the model; {did_you_mean(name, names)}')
    if attribute not in QUANTITIES[kind]:
        raise SessionError(f"{where}: {did_you_mean(attribute, QUANTITIES[kind])}")
    return kind, name, attribute


def _map_trial(trial: Trial, quantity: Mapping[str, tuple], drives: tuple[Drive, ...], model: Any) -> RigTrial:
    log = trial.log()
    check_interval(log, SLOWEST_S)
    keep = np.concatenate(([True], np.diff(log.time_s) > 0))  # a repeated time stamp holds no new sample
    time_s = log.time_s[keep] - log.time_s[0]
    maps: dict[str, dict[str, Array]] = {k: {} for k in ("position", "velocity", "force", "ctrl", "setpoint")}
    by_drive = {d.name: d for d in drives}
    columns = {c: v[keep] for c, v in log.columns.items()}
    moved = {c for c, (_, _, attribute) in quantity.items() if attribute == "position"}
    wild = {c: at for c, v in columns.items() if (at := glitches(v, c in moved)).any()}
    columns |= {c: np.where(at, np.nan, columns[c]) for c, at in wild.items()}
    for column, (kind, name, attribute) in quantity.items():
        if column not in log.columns:
            if attribute == "position":
                raise SessionError(f'{log.path}: no column "{column}"; {did_you_mean(column, log.columns)}')
            continue
        values = columns[column]
        if np.isfinite(values).any():
            maps[attribute][name if kind == "joint" else by_drive[name].joint] = values
    if not maps["position"]:
        named = ", ".join(f'"{c}"' for c, (_, _, attribute) in quantity.items() if attribute == "position")
        raise SessionError(f"{log.path}: no sample of a position in {named}; a log with one is needed")
    own = _set_drives(drives, model, trial)
    live = tuple(d.joint for d in own if d.gear != 0)
    for joint in {j for j in live if live.count(j) > 1}:
        raise DescriptionError(
            f'{log.path}: {live.count(joint)} actuators drive the joint "{joint}"; one is needed (of those that pull '
            "together, their sum)"
        )
    effort, voltage = {}, {}
    acting = {d.joint: d if d.gear else declared for d, declared in zip(own, drives, strict=True)}
    for joint, drive in acting.items():
        if joint in maps["force"]:
            effort[joint] = maps["force"][joint] * drive.gear
        elif joint in maps["ctrl"] and drive.kind == "force":
            effort[joint] = maps["ctrl"][joint] * drive.gain
        elif joint in maps["ctrl"] and drive.kind == "voltage":
            voltage[joint] = maps["ctrl"][joint]
        elif joint in maps["ctrl"] and drive.kind == "position":
            maps["setpoint"].setdefault(joint, maps["ctrl"][joint])
    extra = {c: v for c, v in columns.items() if c not in quantity and np.isfinite(v).any()}
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
        acting,
        dropped={c: int(at.sum()) for c, at in wild.items()},
        clock_s=float(log.time_s[0]),
    )
