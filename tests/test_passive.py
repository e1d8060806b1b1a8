"""Effects in a simulation: what the written file and the passive-force callback apply is what the effect predicts."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hand_model.effects import catalogue, effect
from hand_model.effects.base import DriveState
from hand_model.effects.path import dahl, travelled
from hand_model.hand import Effect, EncoderMap, Estimate, Finger, Hand, Joint, Motor

mujoco = pytest.importorskip("mujoco")
etree = pytest.importorskip("lxml.etree")

GIVE, UNIT = 0.8, 2.0
DECLARED = {"inertia": 0.012, "viscous": 0.15, "coulomb": 35.0, "spring": 0.22, "preload": 9.0}
MOTOR = f"""<mujoco><compiler angle="radian"/><option gravity="3 -9 0" integrator="implicitfast" timestep="0.002"/><worldbody><body name="palm">
 <body><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/><joint name="index_motor" axis="0 0 1" limited="false" damping="{UNIT * 0.15}"
 stiffness="{UNIT * 0.22}" springref="{-9 / 0.22}" armature="{UNIT * 0.012}"/></body></body></worldbody>
 <custom><numeric name="index_effort_per_raw" data="{UNIT}"/></custom>
 <actuator><general name="index" joint="index_motor" gainprm="0" biastype="none"/><dcmotor name="index_friction" joint="index_motor"
 input="none" motorconst="0 0" resistance="1" lugre="{UNIT * 35 / GIVE} 0 {UNIT * 35} {UNIT * 35} 20"/></actuator></mujoco>"""
SAG = 0.15  # of the effort, lost at 100 raw
# shape, amplitude, share of the effect's size by which file and column may differ in 99 % of the samples
DRIVE = [
    ("asymmetric_viscous_friction", {}, {"half_difference": 0.08}, 0.01),
    ("current_channel_delay", {"form": 0.0, "delay": 0.04}, {}, 0.03),
    ("current_channel_delay", {"form": 0.0, "delay": -0.05}, {}, 0.03),
    ("current_saturation", {"limit": 45.0}, {}, 0.02),
    ("detent_load", {"form": 0.0, "centre": 40.0, "width": 6.0}, {"load": -12.0}, 0.01),
    ("detent_load", {"form": 1.0, "centre": 60.0, "width": 4.0}, {"load": 12.0}, 0.01),
    ("drive_sag", {"form": 0.0}, {"torque_loss": SAG}, 0.01),
    ("elastoplastic_hysteresis", {"form": 0.0, "reach": 15.0}, {"yield_load": 14.0}, 0.02),
    ("elastoplastic_hysteresis", {"form": 1.0, "reach": 12.0}, {"yield_load": 14.0}, 0.02),
    ("end_stop_contact", {"side": 1.0, "begin": 82.0, "end": 97.0, "inward": 15.0}, {"stiffness": 1.5}, 0.01),
    ("end_stop_contact", {"side": -1.0, "begin": 12.0, "end": 0.0, "inward": 12.0}, {"stiffness": 1.5}, 0.01),
    ("gravity_load", {"sweep": 1.3}, {"along": 9.0, "across": -4.0}, 0.01),
    ("load_dependent_friction", {}, {"per_load": 0.2}, 0.02),
    ("nonlinear_spring", {}, {"cubic_stiffness": 3e-5}, 0.01),
    ("position_dependent_friction", {"centre": 45.0, "width": 7.0}, {"extra_friction": 20.0}, 0.02),
    ("presliding_friction", {"bristle_length": 6.0}, {}, 0.02),
    ("quadratic_damping", {}, {"drag": 0.002}, 0.01),
    ("stribeck_friction", {"stribeck_speed": 18.0}, {"static_excess": 25.0}, 0.06),
    ("thermal_friction_drift", {"form": 0.0, "warm_up_time": 30.0, "cooling_time": 90.0}, {"cold_excess": 12.0}, 0.02),
    ("torque_ripple", {"period": 9.0}, {"sine": 4.0, "cosine": 3.0}, 0.01),
    ("viscoelastic_spring", {"relaxation_time": 1.2}, {"stiffness": 0.3}, 0.01),
]
# Nothing of them is a force of the drive: an obstacle of one recording, a controller's speed, what is read of a
# command.
NOT_OF_THE_DRIVE = {"external_contact"}
# An encoder's own error and a clock are no motion of the finger; one that runs ahead is pushed by something else.
NOT_OF_A_MAP = {"encoder_periodic_error", "clock_drift", "spring_decoupling"}
MOTOR_NAMES = {
    "inertia": "inertia",
    "viscous": "viscous",
    "coulomb": "coulomb",
    "spring": "stiffness",
    "preload": "preload",
}


def state(until_s: float = 24.0, elapsed_s: float = 5.0) -> DriveState:
    """A drive that moves over its range at several speeds and rests between."""
    t = np.arange(0.0, until_s, 0.018)
    knots = np.array([0.0, 1, 3, 4, 5.5, 6, 7.2, 8, 12, 13, 17, 18, 19.2, 20, 22, 24])
    level = np.array([0.0, 0, 97, 97, 20, 20, 80, 80, 5, 5, 95, 95, 30, 30, 0, 0])
    fine = np.arange(-1.0, 25.0, 0.001)
    kernel = np.exp(-0.5 * (np.arange(-400, 401) / 120) ** 2)
    smooth = np.convolve(np.pad(np.interp(fine, knots, level), 400, mode="edge"), kernel / kernel.sum(), mode="valid")
    x, v, a = (
        np.interp(t, fine, y) for y in (smooth, np.gradient(smooth, fine), np.gradient(np.gradient(smooth, fine), fine))
    )
    declared = np.stack([a, v, dahl(x, GIVE), x, np.ones_like(x)], axis=-1)
    extra = {
        "bandwidth_s": 0 * t,
        "give": 0 * t + GIVE,
        "elapsed": t + elapsed_s,
        "gravity_along": 0 * t + 3.0,
        "gravity_across": 0 * t - 9.0,
        "gravity_x": 0 * t + 3.0,
        "gravity_z": 0 * t - 9.0,
    }
    needed = declared @ np.array(list(DECLARED.values()))
    # u (1 - SAG |u| / 100) = needed
    extra["required"] = np.sign(needed) * (1 - np.sqrt(1 - 4 * SAG / 100 * np.abs(needed))) / (2 * SAG / 100)
    return DriveState("log/a.csv", "index", t, x, v, a, 0 * x, declared, declared_names=tuple(DECLARED), extra=extra)


def every(found, amplitude: dict[str, float]) -> dict[str, float]:
    """All amplitudes of an effect, zero where none is given."""
    return {a[0]: amplitude.get(a[0], 0.0) for a in found.amplitudes()}


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
    assert (place is None) != (effect(name).law(values) is None)  # either the file holds it or the callback applies it
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


FINGER = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast"/><worldbody><body name="palm">
<body name="index_proximal_link"><inertial pos="0.02 0 0" mass="0.01" diaginertia="1e-6 1e-6 1e-6"/>
<joint name="index_proximal" type="hinge" axis="0 1 0" armature="1e-4" damping="1e-3"/>
<body name="index_distal_link" pos="0.04 0 0"><inertial pos="0.01 0 0" mass="0.005" diaginertia="1e-6 1e-6 1e-6"/>
<joint name="index_distal" type="hinge" axis="0 1 0"/></body></body></body></worldbody>
<equality><joint name="index_linkage" joint1="index_distal" joint2="index_proximal" polycoef="0.02 0.7 0.15 0 0" solref="0.002 1"
 solimp="0.9999 0.9999 0.001 0.5 2"/></equality></mujoco>"""
# rad over the share of the range; over rad
ENCODER, LINKAGE = np.array([0.02, 1.1, 0.25, -0.1]), np.array([0.02, 0.7, 0.15, 0.0, 0.0])
KINEMATIC = [
    ("drive_backlash", {"gap": 2.5, "form": 0.0}, {}),
    ("series_elasticity", {"form": 0.0}, {"compliance": 0.02}),
    ("series_elasticity", {"form": 1.0}, {"compliance": 0.02}),
    ("linkage_backlash", {"gap": 2.0, "form": 0.0}, {}),
    ("linkage_compliance", {"form": 0.0}, {"compliance": 0.03}),
    ("linkage_compliance", {"form": 1.0}, {"compliance": 0.02}),
    ("coupling_deadband", {"until": 15.0, "corner": 0.1}, {}),
    ("distal_stop", {"from": 50.0, "passing": 0.0}, {}),
    ("distal_stop", {"from": 50.0, "passing": 0.2}, {}),
]


def kinematic_state(station: str) -> DriveState:
    """The same motion, as the percent of an encoder or the degrees of a proximal joint, under a load."""
    now = state(8.5)
    x = now.position if station == "encoder" else 0.72 * now.position
    scale = 100.0 if station == "encoder" else 70.0
    declared = np.stack([(x / scale) ** k for k in range(4 if station == "encoder" else 5)], axis=-1)
    polynomial = np.polynomial.Polynomial(ENCODER if station == "encoder" else LINKAGE)
    u, per = (x / 100, 0.01) if station == "encoder" else (np.deg2rad(x), np.deg2rad(1.0))
    extra = {
        "scale": 0 * x + scale,
        "load": now.declared @ np.array(list(DECLARED.values())),
        "slope": np.rad2deg(polynomial.deriv()(u)) * per,
    }
    return DriveState(
        "log/a.csv",
        "index",
        now.time_s,
        x,
        now.velocity,
        now.acceleration,
        np.rad2deg(polynomial(u)),
        declared,
        "%" if station == "encoder" else "deg",
        "deg",
        extra,
        tuple(f"power_{k}" for k in range(declared.shape[1])),
    )


def _add_passive_motor(root) -> None:
    """Another finger's friction, a motor without control, ahead of all others: controls and actuators are numbered
    apart."""
    other = etree.SubElement(root.find("worldbody"), "body", name="other")
    etree.SubElement(other, "inertial", pos="0 0 0", mass="0.01", diaginertia="1e-6 1e-6 1e-6")
    etree.SubElement(other, "joint", name="other", type="hinge", axis="0 1 0", armature="1e-3")
    friction = etree.Element(
        "dcmotor",
        name="other_friction",
        joint="other",
        input="none",
        motorconst="0 0",
        resistance="1",
        lugre="1 0.1 0.01 0.01 20",
    )
    root.find("actuator").insert(0, friction)


def replayed(folder, now: DriveState, station: str, *written: tuple[str, dict, dict]) -> np.ndarray:
    """Angle [deg] of a compiled finger's joint with effects written into its file, its driver moved as in `now`."""
    from hand_model.compile.motor import write_motors
    from hand_model.diagnose.prove.forward import follower_along

    motor = Motor(
        "index", 0.0, 100.0, {MOTOR_NAMES[k]: Estimate(v, None, "", "") for k, v in DECLARED.items()}, 1.0, ()
    )
    hinge = Joint("proximal", np.array([0, 1.0, 0]), np.zeros(3), np.zeros((6, 6)), (0.0, 1.4), {})
    finger = Finger(
        "index", "index", (hinge, replace(hinge, name="distal")), (EncoderMap(0.0, 100.0, ENCODER, {}, {}),)
    )
    at = {
        s: {"finger": "index", "joint": "proximal" if s == "encoder" else "distal", "actuator": "index"}
        for s in ("encoder", "linkage")
    }
    values = {name: effect(name).parameters(shape, amplitude, {}) for name, shape, amplitude in written}
    found = tuple(
        Effect(name, at[effect(name).station], {k: Estimate(v, None, "", "") for k, v in value.items()})
        for name, value in values.items()
    )
    hand = Hand("h", "left", {}, {}, (finger,), 1e-4, {}, (motor,), found)
    root = etree.fromstring(FINGER)
    write_motors(root, hand)
    _add_passive_motor(root)
    for name, value in values.items():
        place = effect(name).write_mjcf(root, at[effect(name).station], value)
        assert (place is None) != (effect(name).law(value) is None)
    (folder / "index.xml").write_bytes(etree.tostring(root))
    hand.save(folder / "hand.json")
    return np.rad2deg(follower_along(folder, now, at[station], station))


def powers(now: DriveState, station: str) -> np.ndarray:
    """What the columns of a state's declared map are multiplied by [deg]."""
    per = np.array([now.extra["scale"][0] ** k for k in range(now.declared.shape[1])])
    unit = 0.01 if station == "encoder" else np.deg2rad(1.0)
    return np.rad2deg(ENCODER if station == "encoder" else LINKAGE) * per * unit ** np.arange(len(per))


@pytest.mark.parametrize(
    ("name", "shape", "amplitude"), KINEMATIC, ids=[f"{d[0]}_{i}" for i, d in enumerate(KINEMATIC)]
)
def test_written_finger_moves_as_the_effect_predicts(name, shape, amplitude, tmp_path) -> None:
    station = effect(name).station
    now = kinematic_state(station)
    moved = replayed(tmp_path, now, station, (name, shape, amplitude))
    columns = effect(name).columns(now, shape)
    wanted = effect(name).declared(now, shape) @ powers(now, station) + columns @ np.array(
        list(amplitude.values()) if columns.shape[1] else []
    )
    size = np.abs(wanted - now.effort).max()
    assert size > 0.5
    assert np.quantile(np.abs(moved - wanted), 0.98) < 0.05 * size + 0.03


@pytest.mark.parametrize(
    "bound",
    [("coupling_deadband", {"until": 15.0, "corner": 0.1}, {}), ("distal_stop", {"from": 50.0, "passing": 0.0}, {})],
)
def test_a_distal_segment_held_back_does_not_lift_the_finger_off_its_lever(bound, tmp_path) -> None:
    now = kinematic_state("encoder")
    held, free = (
        replayed(folder, now, "encoder", *written) for folder, written in ((tmp_path, (bound,)), (tmp_path, ()))
    )
    assert np.abs(held - free).max() < 0.5  # of a segment held back by 15 to 20 deg


def test_a_play_before_a_stop_is_replayed_as_both_predict(tmp_path) -> None:
    play, stop = (
        ("linkage_backlash", {"gap": 2.0, "form": 0.0}, {}),
        ("distal_stop", {"from": 50.0, "passing": 0.0}, {}),
    )
    now = kinematic_state("linkage")
    moved = replayed(tmp_path, now, "linkage", play, stop)
    by_play = effect(play[0]).declared(now, play[1])[:, 1] * now.extra["scale"][0]
    x = np.minimum(by_play, 50.0)
    wanted = np.stack([(x / now.extra["scale"][0]) ** k for k in range(now.declared.shape[1])], axis=-1) @ powers(
        now, "linkage"
    )
    # on which side it lay before is not asked
    begun = np.maximum.accumulate(np.abs(now.position - now.position[0]) > 4.0)
    assert np.quantile(np.abs(moved - wanted)[begun], 0.98) < 0.1


def test_every_effect_of_a_force_or_a_map_is_replayed() -> None:
    assert {d[0] for d in DRIVE} | NOT_OF_THE_DRIVE == {e.name for e in catalogue("drive")}
    assert {d[0] for d in KINEMATIC} | NOT_OF_A_MAP == {e.name for e in (*catalogue("encoder"), *catalogue("linkage"))}


def test_keyframes_satisfy_maps_behind_inputs() -> None:
    """A dead band: at zero the input stands where the motion begins, and the follower on its map there."""
    from hand_model.effects.input import settle

    root = etree.fromstring(FINGER)
    where = {"finger": "index", "joint": "distal", "actuator": "index"}
    assert effect("coupling_deadband").write_mjcf(root, where, {"until": 20.0}) is not None
    pose = {"index_proximal": 0.0, "index_distal": 0.0, "index_linkage_input": 0.0}
    settle(root, pose)
    assert pose["index_linkage_input"] == pytest.approx(np.deg2rad(20.0))
    assert pose["index_distal"] == pytest.approx(np.polynomial.polynomial.polyval(np.deg2rad(20.0), LINKAGE))


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


def test_compliance_moves_the_target_within_the_step() -> None:
    """The callback shifts the violation of the map's equality, not the model."""
    from hand_model.compile.motor import write_motors
    from hand_model.passive import effects_on

    root = etree.fromstring(FINGER)
    motor = Motor(
        "index", 0.0, 100.0, {MOTOR_NAMES[k]: Estimate(v, None, "", "") for k, v in DECLARED.items()}, 1.0, ()
    )
    hinge = Joint("proximal", np.array([0, 1.0, 0]), np.zeros(3), np.zeros((6, 6)), (0.0, 1.4), {})
    finger = Finger(
        "index", "index", (hinge, replace(hinge, name="distal")), (EncoderMap(0.0, 100.0, ENCODER, {}, {}),)
    )
    give = Effect(
        "series_elasticity",
        {"finger": "index", "joint": "proximal", "actuator": "index"},
        {"compliance": Estimate(0.05, None, "deg/raw", ""), "form": Estimate(1.0, None, "1", "")},
    )
    hand = Hand("h", "left", {}, {}, (finger,), 1e-4, {}, (motor,), (give,))
    write_motors(root, hand)
    model = mujoco.MjModel.from_xml_string(etree.tostring(root).decode())
    before = model.eq_data.copy()
    data = mujoco.MjData(model)
    with effects_on(model, hand):
        for _ in range(3000):  # the drive pushes against the end of its range
            data.ctrl[model.actuator("index").id] = 101.0
            mujoco.mj_step(model, data)
    load = float(data.actuator("index").force[0])
    lever = np.polynomial.polynomial.polyval(data.joint("index_motor").qpos[0] / 100, ENCODER)
    assert load > 3
    assert data.joint("index_drive").qpos[0] == pytest.approx(lever - np.deg2rad(0.05 * load), abs=2e-4)
    np.testing.assert_array_equal(model.eq_data, before)


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
