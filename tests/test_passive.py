"""Effects of the drive in a simulation: written file and passive-force callback apply what the effect predicts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from passive_motion import DECLARED, DRIVE, GIVE, UNIT, every, state

from hand_model.effects import effect
from hand_model.effects.base import DriveState
from hand_model.effects.path import travelled
from hand_model.hand import Effect, Estimate, Hand, Motor

mujoco = pytest.importorskip("mujoco")
etree = pytest.importorskip("lxml.etree")
MOTOR = f"""<mujoco><compiler angle="radian"/><option gravity="3 -9 0" integrator="implicitfast" timestep="0.002"/><worldbody><body name="palm">
 <body><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/><joint name="index_motor" axis="0 0 1" limited="false" damping="{UNIT * 0.15}"
 stiffness="{UNIT * 0.22}" springref="{-9 / 0.22}" armature="{UNIT * 0.012}"/></body></body></worldbody>
 <custom><numeric name="index_effort_per_raw" data="{UNIT}"/></custom>
 <actuator><general name="index" joint="index_motor" gainprm="0" biastype="none"/><dcmotor name="index_friction" joint="index_motor"
 input="none" motorconst="0 0" resistance="1" lugre="{UNIT * 35 / GIVE} 0 {UNIT * 35} {UNIT * 35} 20"/></actuator></mujoco>"""


def predicted(name: str, shape: dict[str, float], amplitude: dict[str, float], now: DriveState) -> np.ndarray:
    """Current (n,) [raw] of the declared model with the effect, by the effect's own columns."""
    found = effect(name)
    columns = np.concatenate([found.declared(now, shape), found.columns(now, shape)], axis=1)
    current = found.warp(now, columns, shape) @ np.array([*DECLARED.values(), *every(found, amplitude).values()])
    return found.clip(current, shape) if found.clips else current


def motor_with(name: str, shape: dict[str, float], amplitude: dict[str, float]):
    """The compiled motor with the effect written into it, and its hand."""
    from hand_model.diagnose.prove.inverse import CompiledMotor

    values = effect(name).parameters(shape, every(effect(name), amplitude), DECLARED)
    root = etree.fromstring(MOTOR)
    place = effect(name).write_mjcf(root, {"actuator": "index"}, values)
    beyond = np.array([-1e3, 1e3])
    read = not np.array_equal(effect(name).reading(beyond, *np.array([[0.0, 1.0], [50.0, 50.0]]), values), beyond)
    # the file holds it, or the callback applies it, or it is in the reading of a sensor that cannot
    held, applied = place is not None, effect(name).law(values) is not None
    assert held != applied or not held and read
    estimates = {k: Estimate(v, None, "", "") for k, v in values.items()}
    motor = Motor("index", 0.0, 100.0, {"presliding": Estimate(GIVE, None, "%", "")}, 1.0, ())
    hand = Hand(
        "h",
        "left",
        {},
        {},
        (),
        1e-4,
        {},
        (motor,),
        (Effect(name, {"actuator": "index", "finger": "index"}, estimates),),
    )
    return CompiledMotor(etree.fromstring(etree.tostring(root)), "index", "index_motor", UNIT, hand)


@pytest.mark.parametrize(
    ("name", "shape", "amplitude", "tolerance"), DRIVE, ids=[f"{d[0]}_{i}" for i, d in enumerate(DRIVE)]
)
def test_written_and_replayed_effect_is_the_effects_own_column(name, shape, amplitude, tolerance) -> None:
    from hand_model.diagnose.prove.inverse import current_along

    now = state()
    replayed = current_along(motor_with(name, shape, amplitude), now)
    wanted = predicted(name, shape, amplitude, now)
    plain = now.declared @ np.array(list(DECLARED.values()))
    size = np.abs(wanted - plain).max()
    assert size > 3
    error = np.abs(replayed - wanted)
    if name == "stribeck_friction":  # MuJoCo's rise has another form: nearest where it slides, and late to turn over
        assert (
            np.sqrt(np.mean(error[(np.abs(now.velocity) > 4) & (travelled(now.position) > 4)] ** 2)) < tolerance * size
        )
    else:
        assert np.quantile(error, 0.99) < tolerance * size + 0.3  # friction turns over within steps of 2 ms


def test_effects_are_of_one_model_and_go_off() -> None:
    """Another model is left alone; after the block nothing acts."""
    from hand_model.passive import effects_on

    hand = motor_with("detent_load", {"form": 0.0, "centre": 40.0, "width": 6.0}, {"load": 12.0}).hand
    mine, other = (mujoco.MjModel.from_xml_string(x) for x in (MOTOR, MOTOR.replace("index_motor", "index_other")))

    def force(model) -> float:
        data = mujoco.MjData(model)
        data.qpos[0] = 40.0
        mujoco.mj_forward(model, data)
        return float(data.qfrc_passive[0])

    plain = force(mine)
    with effects_on(mine, hand) as on:
        assert on.names == ("detent_load",)
        assert force(mine) == pytest.approx(plain - UNIT * 12.0)
        assert force(other) == pytest.approx(plain)
    assert force(mine) == plain


def test_delays_and_clipping_are_what_mujoco_does() -> None:
    """A command delay holds the drive's force back; the sensor of the current is late, or clips."""

    def run(name: str, values: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
        root = etree.fromstring(MOTOR.replace('gainprm="0"', f'gainprm="{UNIT}"'))
        assert effect(name).write_mjcf(root, {"actuator": "index"}, values) is not None
        model = mujoco.MjModel.from_xml_string(etree.tostring(root).decode())
        data, force, seen = mujoco.MjData(model), [], []
        for i in range(200):
            data.ctrl[0] = 30.0 if i >= 50 else 0.0
            mujoco.mj_step(model, data)
            force.append(data.actuator_force[0] / UNIT)
            seen.append(data.sensordata[0] / UNIT if model.nsensor else 0.0)
        return np.array(force), np.array(seen)

    force, _ = run("command_delay", {"delay": 0.06})
    assert int(np.argmax(force > 15)) == pytest.approx(50 + 30, abs=2)
    force, seen = run("current_channel_delay", {"form": 0.0, "delay": 0.04})
    assert int(np.argmax(force > 15)) == pytest.approx(50, abs=1)
    assert int(np.argmax(seen > 15)) == pytest.approx(50 + 20, abs=2)
    force, seen = run("current_saturation", {"limit": 20.0})
    assert force.max() == pytest.approx(30)
    assert seen.max() == pytest.approx(20)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("command_delay", "| yes | not needed |"),
        ("detent_load", "| no | yes |"),
        ("joint_wobble", "| no: over which course"),
        ("quadratic_damping", "| yes | not needed |"),
    ],
)
def test_the_readme_says_where_an_effect_is(name, said) -> None:
    from hand_model.compile.readme import _effects

    values = {"detent_load": {"centre": 40.0, "width": 5.0, "load": 20.0, "form": 0.0}}.get(name, {})
    found = Effect(
        name, {"finger": "index", "actuator": "index"}, {k: Estimate(v, None, "1", "test") for k, v in values.items()}
    )
    assert f"| {name} | index {said}" in _effects(SimpleNamespace(effects=(found,), fingers=()))
