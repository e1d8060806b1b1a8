"""A finger's motor by this package and by mujoco.sysid: same parameters, same trials, same run; held-out error of both;
writes JSON.

    pip install 'mujoco[sysid]'
    python scripts/benchmark_motor.py SESSION ACTUATOR --output benchmark_motor.json

mujoco.sysid is given favours: the reference (controller profile and instants of the commands) that this package
identified, and the start that this package's own search begins from (its regression). It fits inertia, viscous and
Coulomb friction, stiffness, preload, controller gain and damping, each in units of its start, so that the unknowns are
of one size; wide bounds; residuals in units of their noise. This package fits the same seven from the same start (and
the profile, presliding and instants besides, which sysid is given).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from hand_model.errors import MissingDependencyError
from hand_model.identify.motor import identify_motor
from hand_model.identify.motor.moves import moves_from_rest
from hand_model.identify.motor.predict import predict, reference
from hand_model.identify.motor.recording import MotorTrial, actuator_trials, motor_trial
from hand_model.session import read_session

STEP_S = 1e-3
NAMES = ("inertia", "viscous", "coulomb", "stiffness", "preload", "gain", "damping")
MODEL = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/><worldbody><body name="motor">
<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/><joint name="motor" type="hinge" axis="0 0 1" armature="0.02"
 damping="0.1" frictionloss="20" stiffness="0.1" springref="-50" solreffriction="0.004 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/>
</body></worldbody><actuator><general name="motor" joint="motor" gainprm="20" biastype="affine" biasprm="0 -20 -1"/></actuator>
<sensor><jointpos name="position" joint="motor"/><actuatorfrc name="current" actuator="motor"/></sensor></mujoco>"""


def load_sysid():
    """mujoco.sysid, or MissingDependencyError saying how to get it."""
    try:
        from mujoco import sysid
    except ImportError as error:
        raise MissingDependencyError(
            f"mujoco.sysid is not here ({error}); install it with: pip install 'mujoco[sysid]'"
        ) from None
    return sysid


def set_parameters(spec, values: dict[str, float]) -> None:
    """Write motor parameters (NAMES -> value) into an MjSpec of MODEL."""
    joint, actuator = spec.joint("motor"), spec.actuator("motor")
    joint.armature, joint.frictionloss = values["inertia"], values["coulomb"]
    joint.damping = (
        np.array([values["viscous"], *np.atleast_1d(joint.damping)[1:]])
        if np.ndim(joint.damping)
        else values["viscous"]
    )
    joint.stiffness = (
        np.array([values["stiffness"], *np.atleast_1d(joint.stiffness)[1:]])
        if np.ndim(joint.stiffness)
        else values["stiffness"]
    )
    joint.springref = -values["preload"] / values["stiffness"]
    gain, bias = np.array(actuator.gainprm), np.array(actuator.biasprm)
    gain[0], bias[1], bias[2] = values["gain"], -values["gain"], -values["damping"]
    actuator.gainprm, actuator.biasprm = gain, bias


def sequences(sysid, spec, fit, trials: list[MotorTrial], lead: float):
    """ModelSequences of recorded trials: control r + lead r', measured position and current in units of their noise."""
    import mujoco

    model = spec.compile()
    controls, sensors, starts = [], [], []
    for t in trials:
        grid = np.arange(0, t.time_s[-1], STEP_S)
        controls.append(sysid.TimeSeries.from_control_names(grid, reference(fit, t, grid)[:, None], model, ["motor"]))
        sensors.append(sysid.TimeSeries.from_names(t.time_s, np.c_[t.position, t.current], model))
        data = mujoco.MjData(model)
        data.qpos[0] = t.position[:20].mean()
        starts.append(sysid.create_initial_state(model, data.qpos.copy()))
    return sysid.ModelSequences("motor", spec, [t.name for t in trials], starts, controls, sensors)


def begin_values(fit, trials: list[MotorTrial]) -> dict[str, float]:
    """Where both searches begin: the plant by regression, gain from how far off its setpoint the drive rests, critical
    damping."""
    plant = dict(zip(NAMES, map(float, fit.regression.values), strict=False))
    m = [x for t in trials for x in moves_from_rest(t, (fit.sigma_position, fit.sigma_current), fit.scale.speed_full)]
    off, hold = np.array([[np.mean(x.target - x.position[-6:]), np.mean(x.current[-6:])] for x in m]).T
    gain = float(np.median(hold / np.where(np.abs(off) > 1e-3, off, np.nan)[()])) if len(m) else 20.0
    gain = gain if np.isfinite(gain) and gain > 0.5 else 20.0
    return {**plant, "gain": gain, "damping": 2 * float(np.sqrt(gain * plant["inertia"]))}


def run_sysid(sysid, fit, trials: list[MotorTrial]) -> tuple[dict[str, float], float, list[str]]:
    """Fitted parameters, processor time [s] and parameters at a bound of mujoco.sysid."""
    import mujoco

    spec = mujoco.MjSpec.from_string(MODEL)
    start = begin_values(fit, trials)
    bounds = {n: (-5.0, 5.0) if n == "preload" else (0.1, 5.0) for n in NAMES}  # in units of the start
    current = dict(start)

    def modifier(name: str):
        def write(spec, parameter) -> None:
            current[name] = start[name] * float(np.ravel(parameter.value)[0])
            set_parameters(spec, current)

        return write

    parameters = sysid.ParameterDict({n: sysid.Parameter(n, 1.0, *bounds[n], modifier=modifier(n)) for n in NAMES})
    lead = fit.values["damping"] / fit.values["gain"]
    data = sequences(sysid, spec, fit, trials, lead)
    weights = {"position": 1 / fit.sigma_position, "current": 1 / fit.sigma_current}
    transform = sysid.SignalTransform(normalize=False)
    residual = sysid.build_residual_fn(
        models_sequences=[data], modify_residual=transform.apply, sensor_weights=weights, n_threads=1
    )
    begin = time.process_time()
    found, _ = sysid.optimize(parameters, residual, verbose=False, max_iters=30)
    seconds = time.process_time() - begin
    vector = np.ravel(found.as_vector())
    at_bound = [
        n for n, x in zip(NAMES, vector, strict=True) if min(abs(x - bounds[n][0]), abs(x - bounds[n][1])) < 1e-3
    ]
    return {n: start[n] * float(x) for n, x in zip(NAMES, vector, strict=True)}, seconds, at_bound


def held_out_current(fit, values: dict[str, float], trials: list[MotorTrial]) -> float:
    """RMSE of the current [raw] of MODEL with these values in open loop over trials."""
    import mujoco

    spec = mujoco.MjSpec.from_string(MODEL)
    set_parameters(spec, values)
    model = spec.compile()
    squares, count = 0.0, 0
    for t in trials:
        grid = np.arange(0, t.time_s[-1] + STEP_S, STEP_S)
        control, data, current = reference(fit, t, grid), mujoco.MjData(model), np.empty(len(grid))
        data.qpos[0] = t.position[:20].mean()
        for i, c in enumerate(control):
            data.ctrl[0] = c
            mujoco.mj_step(model, data)
            current[i] = data.actuator_force[0]
        error = np.interp(t.time_s, grid, current) - t.current
        squares, count = squares + float(error @ error), count + len(error)
    return float(np.sqrt(squares / count))


def main() -> None:
    """Run both, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("session")
    parser.add_argument("actuator")
    parser.add_argument("--output", default="benchmark_motor.json")
    args = parser.parse_args()
    sysid = load_sysid()
    session = read_session(args.session)
    found = {v: actuator_trials(session, args.actuator, validate=v) for v in (False, True)}
    identify_motor(session, args.actuator)  # warm caches of both readers
    begin = time.process_time()
    fit = identify_motor(session, args.actuator)
    ours = time.process_time() - begin
    training, held = ([motor_trial(t.name, t.log(), fit.scale) for t in found[v]] for v in (False, True))
    predicted = [predict(fit, t.log(), t.name) for t in found[True]]
    error = np.concatenate([p.current - p.recorded_current for p in predicted])
    values, theirs, at_bound = run_sysid(sysid, fit, training)
    same = {n: fit.values[n] for n in NAMES}
    result = {
        "trials": [t.name for t in training],
        "held_out": [t.name for t in held],
        "noise_raw": fit.sigma_current,
        "start": begin_values(fit, training),
        "hand_model": {
            "cpu_s": ours,
            "held_out_current_rmse": float(np.sqrt(np.nanmean(error**2))),
            "held_out_current_rmse_in_sysids_model": held_out_current(fit, same, held),
            "parameters": same,
        },
        "mujoco.sysid": {
            "cpu_s": theirs,
            "held_out_current_rmse": held_out_current(fit, values, held),
            "parameters": values,
            "at_bound": at_bound,
        },
        "speed_ratio": theirs / ours,
    }
    Path(args.output).write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
