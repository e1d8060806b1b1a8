"""What a rig's file keeps beside MuJoCo's own elements, while MuJoCo steps: swings by their parameters, the laws of
balances."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .bristles import Bristles
from .carried import CarriedLoad, bodies_inertia
from .laws import Now, Warming, law
from .model import RigModel, RigTrial
from .warming import still_to_come

Array = NDArray[np.float64]
LEAST_FRICTION = 1e-9  # N m or N: MuJoCo keeps the constraint of a joint whose friction changes


class EffectStepper:
    """Applies the effects that a file keeps in custom/text, between mj_step1 and mj_step2.

    Dry friction enters as the bound of MuJoCo's friction constraint, everything else as passive force: what the
    passive callback (mjcb_passive) can do too, and `passive` is that callback.
    """

    def __init__(self, model: Any, effects: list[dict[str, Any]]) -> None:
        self.model = model
        self.coulomb = np.array(model.dof_frictionloss)
        self.entries = [(model.joint(e["joint"]).id, e["swing"]) for e in effects if "swing" in e]
        self.restart()
        records = [e for e in effects if "effect" in e]
        self.unknown = tuple(r["effect"] for r in records if law(r) is None)
        self.laws = [(model.joint(r["joint"]).id, act) for r in records if (act := law(r)) is not None]
        self.late = {r["joint"]: r["shape"]["delay"] for r in records if "delay" in r.get("shape", {})}

    def follow(self, rig: RigModel, trial: RigTrial) -> None:
        """Be as warm as the joints are in a recording."""
        for joint, act in self.laws:
            if isinstance(act, Warming):
                act.follow(trial.time_s, still_to_come(rig, trial, self.model.joint(joint).name, act.shape))

    def delay_s(self, joint: str) -> float:
        """By how much the drive of a joint acts later than its channel says [s]."""
        named = [e.get("delay", 0.0) for j, e in self.entries if j == self.model.joint(joint).id]
        return max(named, default=0.0) - self.late.get(joint, 0.0)  # a balance's delay is that of the motion

    def control(self, drive: Array, supply: Array) -> Array:
        """The recorded control (n,) less sag and scaled with the supply; drive in the unit of effort per gain."""
        out = drive
        for joint, e in self.entries:
            gain = self._gain(joint)
            out = out * (1.0 + e.get("supply", 0.0) * supply)
            out = out * (1.0 - e.get("sag", 0.0) * np.abs(gain * out))
        return out

    def _gain(self, joint: int) -> float:
        for a in range(self.model.nu):
            if self.model.actuator_trnid[a, 0] == joint:
                resistance, constant = self.model.actuator_gainprm[a, :2]
                return float(constant / resistance)
        return 0.0

    def restart(self) -> None:
        """Forget how the joints moved: they are put elsewhere."""
        inertia = [bodies_inertia(self.model, joint) for joint, _ in self.entries]
        self.carried = [CarriedLoad(i) for i in inertia]
        self.bristles = [Bristles(e["reach"]) if "reach" in e else None for _, e in self.entries]
        step = float(self.model.opt.timestep)
        self.stiffest = [
            (i + float(self.model.dof_armature[j])) / step**2 for i, (j, _) in zip(inertia, self.entries, strict=True)
        ]

    def passive(self, model: Any, data: Any) -> None:
        """Add the effects to qfrc_passive and to the bound of dry friction, at the state in `data`."""
        states = zip(self.entries, self.carried, self.bristles, self.stiffest, strict=True)
        for (joint, e), load, bristles, stiffest in states:
            get = e.get
            q, v = float(data.qpos[joint]), float(data.qvel[joint])
            external = -float(data.qfrc_bias[joint]) + get("offset", 0.0)
            placed = -get("lateral", 0.0) * np.cos(q) - get("stiffness", 0.0) * q - _ripple(e, q)
            data.qfrc_passive[joint] += get("offset", 0.0) + placed
            external += placed - get("offset", 0.0)
            shaft = float(data.qfrc_actuator[joint])
            carried = abs(load(float(data.time), v, external))
            damping = get("load_speed", 0.0) * abs(external) + get("damping_asymmetry", 0.0) * np.sign(v)
            data.qfrc_passive[joint] -= damping * v
            more = (
                get("load_gear", 0.0) * abs(external - shaft)
                + get("asymmetry", 0.0) * np.sign(v)
                + abs(get("load_external", 0.0) * external - get("load_motor", 0.0) * shaft)
                + get("load_carried", 0.0) * carried
                + _low_speed(e, v, external, shaft, carried)
            )
            bound = max(self.coulomb[joint] + more, LEAST_FRICTION)
            if bristles is not None:
                effort = float(data.qfrc_passive[joint]) - float(data.qfrc_bias[joint]) + shaft
                data.qfrc_passive[joint] -= bristles(q, v, effort, bound, stiffest)
            # the bound takes effect in the next step: the constraint of this one stands already
            model.dof_frictionloss[joint] = bound if bristles is None else LEAST_FRICTION
        bounds: dict[int, float] = {}
        for joint, act in self.laws:
            drive = float(data.qfrc_actuator[joint])
            load = drive + float(data.qfrc_passive[joint] + data.qfrc_constraint[joint])
            bias = float(data.qfrc_bias[joint] - data.qfrc_spring[joint])
            place, speed = float(data.qpos[joint]), float(data.qvel[joint])
            effort, friction = act(Now(place, speed, load, drive, bias, float(data.time)))
            data.qfrc_passive[joint] -= effort
            bounds[joint] = bounds.get(joint, self.coulomb[joint]) + friction
        for joint, value in bounds.items():
            model.dof_frictionloss[joint] = max(value, LEAST_FRICTION)


def _ripple(e: dict[str, float], q: float) -> float:
    """Effort that a ripple asks for at position q."""
    if "ripple_period" not in e:
        return 0.0
    turn = 2.0 * np.pi * q / e["ripple_period"]
    return e.get("ripple_sine", 0.0) * np.sin(turn) + e.get("ripple_cosine", 0.0) * np.cos(turn)


def _low_speed(e: dict[str, float], v: float, external: float, shaft: float, carried: float) -> float:
    """Dry friction that standing still adds, by load, at joint velocity v under external and shaft effort; carried: size
    of the load with the inertia that moves."""
    get = e.get
    level = (
        get("static_excess", 0.0)
        + get("load_gear_low", 0.0) * abs(external - shaft)
        + abs(get("load_external_low", 0.0) * external - get("load_motor_low", 0.0) * shaft)
        + get("load_carried_low", 0.0) * carried
    )
    if external * shaft < 0:
        drives = abs(shaft) > abs(external)
        level += get("external_squared", 0.0) * external**2 if drives else get("motor_squared", 0.0) * shaft**2
    return level * np.exp(-(abs(v / get("stribeck_speed", 1.0)) ** get("stribeck_exponent", 2.0)))
