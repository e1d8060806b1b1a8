"""The improved model: the hand with its named effects, compiled, and the proof by the compiled files' own forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import effect
from ..effects.base import DriveState
from ..hand import Effect, Estimate, Hand, load_hand
from .findings import Finding

Array = NDArray[np.float64]

DECLARED = {"inertia": "inertia", "viscous": "viscous", "coulomb": "coulomb", "spring": "stiffness", "preload": "preload"}


def read_model(model: Any) -> Hand:
    """A Hand from itself, a .hand file, or a compiled folder; raises HandFileError for anything else."""
    if isinstance(model, Hand):
        return model
    path = Path(model)
    return load_hand(path / "hand.json" if path.is_dir() else path)


def improved(hand: Hand, findings: Sequence[Finding], declared: Mapping[str, Mapping[str, float]]) -> Hand:
    """The hand with the findings that are physics of its fingers; motors that have one get the jointly fitted coefficients.

    declared: actuator -> coefficients of the declared model fitted beside the effects, [raw, %].
    """
    physics = [f for f in findings if f.correction is None and f.where.get("finger") in {x.name for x in hand.fingers}]
    effects = tuple(Effect(f.effect, dict(f.where), {k: _estimate(v) for k, v in f.parameters.items() if np.isfinite(v["value"])})
                    for f in physics)
    touched = {f.where.get("actuator") for f in physics if f.where.get("signal") == "current"}
    motors = []
    for motor in hand.motors:
        values = declared.get(motor.actuator, {}) if motor.actuator in touched else {}
        fresh = {DECLARED[k]: Estimate(float(v), None, motor.parameters[DECLARED[k]].unit, "diagnosis, beside its effects")
                 for k, v in values.items() if DECLARED.get(k) in motor.parameters}
        kept = {k: v for k, v in motor.parameters.items() if not fresh or k not in ("static_ratio", "stribeck_speed", "presliding")}
        motors.append(replace(motor, parameters={**kept, **fresh}))
    return replace(hand, effects=(*hand.effects, *effects), motors=tuple(motors))


def _estimate(entry: Mapping[str, Any]) -> Estimate:
    ci = entry.get("ci95")
    return Estimate(float(entry["value"]), None if ci is None else (float(ci[0]), float(ci[1])), str(entry["unit"]), "diagnosis")


def written(folder: Path, finding: Finding) -> str | None:
    """Path of the element that holds a finding in the compiled folder's files, None where no file holds it."""
    from lxml import etree

    values = {k: v["value"] for k, v in finding.parameters.items()}
    for file in sorted(folder.glob("*.xml")):
        if file.name.startswith("scene"):
            continue
        root = etree.parse(str(file)).getroot()
        # the element's path is what writing it once more into a copy of the file without it would give
        place = effect(finding.effect).write_mjcf(_without(root, finding), finding.where, values)
        if place is not None:
            return place
    return None


def _without(root: Any, finding: Finding) -> Any:
    """A scratch tree in which the finding's own element is absent, so that its name is free."""
    for kind in ("ripple", "stop", "friction"):
        name = f"{finding.where.get('actuator')}_{kind}"
        for element in [e for e in root.iter() if isinstance(e.tag, str) and e.get("name") == name]:
            if element.tag == "dcmotor" and element.get("lugre"):
                joint = next(j for j in root.find("worldbody").iter("joint") if j.get("name") == element.get("joint"))
                joint.set("frictionloss", element.get("lugre").split()[2])
            element.getparent().remove(element)
    return root


def compiled_current(folder: Path, actuator: str, state: DriveState) -> Array | None:
    """Current (n,) [raw] that a compiled file needs for a recorded motion: inertia, friction, and MuJoCo's own passive and
    actuator forces at the motor joint; None where no file has that motor. A LuGre element counts with its steady sliding
    friction, (Fc + (Fs - Fc) exp(-(v / vs)^2)) times the friction's direction: compare steady samples only."""
    import mujoco
    from lxml import etree

    for file in sorted(f for f in folder.glob("*.xml") if not f.name.startswith("scene")):
        model = mujoco.MjModel.from_xml_path(str(file))
        drive = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator)
        number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, f"{actuator}_effort_per_raw")
        if drive < 0 or number < 0:
            continue
        joint = model.actuator_trnid[drive, 0]
        dof, at = model.jnt_dofadr[joint], model.jnt_qposadr[joint]
        own = [i for i in range(model.nu) if model.actuator_trnid[i, 0] == joint and i != drive]
        friction = np.full(len(state.time_s), float(model.dof_frictionloss[dof]))
        for i in list(own):
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, i)
            element = etree.parse(str(file)).getroot().find(f"actuator/dcmotor[@name='{name}']")
            if element is not None and element.get("lugre"):
                _, _, coulomb, static, speed = (float(x) for x in element.get("lugre").split())
                friction += coulomb + (static - coulomb) * np.exp(-((state.velocity / speed) ** 2))
                own.remove(i)
        model.actuator_gainprm[drive] = model.actuator_biasprm[drive] = 0.0  # the drive itself is what is asked for
        data, out = mujoco.MjData(model), np.empty(len(state.time_s))
        for i, (x, v) in enumerate(zip(state.position, state.velocity, strict=True)):
            data.qpos[at], data.qvel[dof] = x, v
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_fwdActuation(model, data)
            out[i] = -data.qfrc_passive[dof] - data.actuator_force[own].sum()
        out += model.dof_armature[dof] * state.acceleration + friction * state.direction
        return out / model.numeric_data[model.numeric_adr[number]]
    return None


def replayed(before: Path, after: Path, finding: Finding, states: Sequence[DriveState]) -> dict[str, Any] | None:
    """`fit` of a drive finding from the two compiled files on the recordings kept out; None where they cannot tell."""
    kept = [s for s in states if s.validate] or list(states)
    squares: tuple[list[Array], list[Array]] = ([], [])
    for state in kept:
        use = np.isfinite(state.effort) & (state.extra.get("steady", np.ones(len(state.time_s))) > 0)
        for folder, into in zip((before, after), squares, strict=True):
            current = compiled_current(folder, str(finding.where["actuator"]), state)
            if current is None:
                return None
            into.append((state.effort - current)[use] ** 2)
    rmse = [float(np.sqrt(np.concatenate(s).mean())) for s in squares]
    return {**finding.fit, "before": rmse[0], "after": rmse[1], "ci95_reduction": None,
            "held_out": [s.trial for s in kept if s.validate], "engine": "mujoco: forces of the compiled motor joint, motion as recorded"}


def write_improved(model: Any, findings: Sequence[Finding], declared: Mapping[str, Mapping[str, float]],
                   states: Mapping[str, Sequence[DriveState]], output: Path) -> tuple[Finding, ...]:
    """Compile `model` with its effects into `output`/model; the findings, saying where each is written and what the files'
    replay gives. The model as it was goes to `output`/model_before."""
    from ..compile import compile

    hand = read_model(model)
    new = improved(hand, findings, declared)
    if not new.effects:
        return tuple(findings)
    compile(hand, output / "model_before")
    compile(new, output / "model")
    out = []
    for finding in findings:
        if finding.correction is not None:
            out.append(finding)
            continue
        place = written(output / "model", finding)
        finding = replace(finding, model={"native": place is not None, "mjcf": place, "urdf": "not expressible: kept in hand.json"})
        drive = states.get(str(finding.where.get("actuator")))
        if place is not None and drive and finding.where.get("signal") == "current":
            fit = replayed(output / "model_before", output / "model", finding, drive)
            finding = finding if fit is None else replace(finding, fit=fit)
        out.append(finding)
    return tuple(out)
