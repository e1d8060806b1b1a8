"""Effects between drive and segments in a simulation: a compiled finger moves as they predict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from passive_motion import DECLARED, DRIVE, ENCODER, FINGER, KINEMATIC, LINKAGE, MOTOR_NAMES, state

from hand_model.effects import catalogue, effect
from hand_model.effects.base import DriveState, rounded
from hand_model.effects.driven import segment_gap, soft_play
from hand_model.hand import Effect, EncoderMap, Estimate, Finger, Hand, Joint, Motor

mujoco = pytest.importorskip("mujoco")
etree = pytest.importorskip("lxml.etree")

# Nothing of them is a force of the drive: an obstacle of one recording, a controller's speed, what is read of a
# command.
NOT_OF_THE_DRIVE = {"external_contact"}
# An encoder's own error and a clock are no motion of the finger; one that runs ahead is pushed by something else.
NOT_OF_A_MAP = {"encoder_periodic_error", "clock_drift", "spring_decoupling"}
GIVE = {"compliance": 0.02, "drag_compliance": 0.0}


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
        "drag": DECLARED["viscous"] * now.velocity,
        "slope": np.rad2deg(polynomial.deriv()(u)) * per,
    }
    return DriveState(
        "log/a.csv",
        "index",
        now.time_s,
        x,
        now.velocity * (1.0 if station == "encoder" else 0.72),
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
    for name, value in values.items():
        further = effect(name).further((now,), {k: {"value": v} for k, v in value.items()})
        value.update({k: entry["value"] for k, entry in further.items() if k not in value})
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
    share = 0.08 if effect(name).hurries({**shape, **amplitude}) else 0.05  # ties follow less closely at full speed
    assert np.quantile(np.abs(moved - wanted), 0.98) < share * size + 0.03


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


LOST = (  # between a finger and its distal segment
    ("coupling_deadband", {"until": 15.0, "corner": 0.1}, {}),
    ("linkage_backlash", {"gap": 0.8, "form": 0.0}, {}),
)


def test_what_is_lost_behind_a_finger_is_not_asked_of_it(tmp_path) -> None:
    now = kinematic_state("encoder")
    held, free = (replayed(folder, now, "encoder", *written) for folder, written in ((tmp_path, LOST), (tmp_path, ())))
    assert np.abs(held - free).max() < 0.1  # 1.9 with them


def test_a_tie_that_a_bound_stretches_does_not_lift_the_finger_off_its_lever(tmp_path) -> None:
    """In the file as it is: the motor rests where the distal segment's dead band stretches its tie."""
    replayed(tmp_path, kinematic_state("encoder"), "encoder", *LOST)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "index.xml"))
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    motor, finger = model.joint("index_motor"), model.joint("index_proximal")
    model.dof_armature[motor.dofadr] = 1e6
    for _ in range(2000):
        mujoco.mj_step(model, data)
    assert np.rad2deg(abs(data.qpos[finger.qposadr[0]] - ENCODER[0])) < 0.4  # of 15


def on_the_map(now: DriveState, x: np.ndarray) -> np.ndarray:
    """Angle [deg] of a segment on the linkage's map of a driver at x [deg]."""
    scaled = x / now.extra["scale"][0]
    return np.stack([scaled**k for k in range(now.declared.shape[1])], axis=-1) @ powers(now, "linkage")


def off(wanted: np.ndarray, moved: np.ndarray, x: np.ndarray) -> float:
    """By how much [deg] a segment is off where it is wanted, but for a fiftieth of the samples since the motion of x
    [deg] began: on which side of a play it lay before is not asked."""
    begun = np.maximum.accumulate(np.abs(x - x[0]) > 4.0)
    return float(np.quantile(np.abs(moved - wanted)[begun], 0.98))


def off_the_map(now: DriveState, moved: np.ndarray, x: np.ndarray) -> float:
    """By how much [deg] a segment is off the linkage's map of a driver at x [deg]."""
    return off(on_the_map(now, x), moved, now.position)


def test_a_play_before_a_stop_is_replayed_as_both_predict(tmp_path) -> None:
    play, stop = (
        ("linkage_backlash", {"gap": 2.0, "form": 0.0}, {}),
        ("distal_stop", {"from": 50.0, "passing": 0.0}, {}),
    )
    now = kinematic_state("linkage")
    moved = replayed(tmp_path, now, "linkage", play, stop)
    by_play = effect(play[0]).declared(now, play[1])[:, 1] * now.extra["scale"][0]
    assert off_the_map(now, moved, np.minimum(by_play, 50.0)) < 0.1


def test_what_rubs_in_a_play_does_not_stretch_the_spring_of_a_bound(tmp_path) -> None:
    bound, play = (
        ("coupling_deadband", {"until": 10.0, "corner": 0.1}, {}),
        ("linkage_backlash", {"gap": 0.8, "form": 0.0}, {}),
    )
    now = kinematic_state("linkage")
    moved = replayed(tmp_path, now, "linkage", bound, play)
    x = soft_play(np.maximum(now.position, 10.0), 0.8, 0.0)
    assert off_the_map(now, moved, x) < 0.1  # of 0.8 deg; 0.29 with a soft spring


def test_a_play_behind_the_map_is_replayed_behind_a_bound(tmp_path) -> None:
    bound, play = (
        ("coupling_deadband", {"until": 10.0, "corner": 0.1}, {}),
        ("linkage_backlash", {"gap": 1.5, "form": 2.0}, {}),
    )
    now = kinematic_state("linkage")
    moved = replayed(tmp_path, now, "linkage", bound, play)
    driven = np.maximum(now.position, 10.0)
    wanted = soft_play(on_the_map(now, driven), segment_gap((now,), {"value": 1.5})["value"], 0.0)
    assert off(wanted, moved, driven) < 0.1


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("series_elasticity", {"form": 0.0}, GIVE), ("drive_backlash", {"gap": 1.5, "form": 2.0}, {})),
        (("series_elasticity", {"form": 1.0}, GIVE), ("drive_backlash", {"gap": 1.5, "form": 2.0}, {})),
        (("series_elasticity", {"form": 0.0}, GIVE), ("drive_backlash", {"gap": 1.5, "form": 4.0, "reach": 3.0}, {})),
        (
            ("coupling_deadband", {"until": 15.0, "corner": 0.1}, {}),
            ("linkage_backlash", {"gap": 2.0, "form": 2.0}, {}),
        ),
        (("coupling_deadband", {"until": 8.0, "corner": 2.5}, {}), ("linkage_compliance", {"form": 0.0}, GIVE)),
        (("distal_stop", {"from": 50.0, "passing": 0.2}, {}), ("linkage_compliance", {"form": 1.0}, GIVE)),
        (
            ("distal_stop", {"from": 50.0, "passing": 0.2}, {}),
            ("linkage_backlash", {"gap": 2.0, "form": 4.0, "reach": 3.0}, {}),
        ),
    ],
    ids=lambda e: f"{e[0]}_{e[1].get('form', '')}",
)
def test_two_effects_are_replayed_as_they_predict_together(first, second, tmp_path) -> None:
    """Changes of the driver follow one another; a give reads its drive ahead of the map, in whose unit it is."""
    station = effect(first[0]).station
    now = kinematic_state(station)
    moved = replayed(tmp_path, now, station, first, second)
    told = now
    for name, shape, _ in (first, second):
        told = replace(told, declared=effect(name).declared(told, shape))
    wanted = told.declared @ powers(now, station)
    for name, shape, amplitude in (first, second):
        if amplitude:
            wanted += effect(name).columns(now, shape) @ np.array(list(amplitude.values()))
    assert off(wanted, moved, now.position) < 0.05 * np.abs(wanted - now.effort).max() + 0.05


def test_a_play_is_replayed_behind_a_round_bound_and_a_map_that_grows_steep(tmp_path, monkeypatch) -> None:
    """What rubs in the play stretches the bound's spring the more the steeper the map between them is."""
    monkeypatch.setitem(globals(), "LINKAGE", np.array([0.02, 0.3, 0.4, 0.0, 0.0]))
    monkeypatch.setitem(globals(), "FINGER", FINGER.replace("0.02 0.7 0.15 0 0", "0.02 0.3 0.4 0 0"))
    bound, play = (
        ("coupling_deadband", {"until": 4.0, "corner": 1.8}, {}),
        ("linkage_backlash", {"gap": 0.4, "form": 2.0}, {}),
    )
    now = kinematic_state("linkage")
    moved = replayed(tmp_path, now, "linkage", bound, play)
    driven = 4.0 + rounded(now.position - 4.0, 1.8)
    wanted = soft_play(on_the_map(now, driven), segment_gap((now,), {"value": 0.4})["value"], 0.0)
    assert off(wanted, moved, driven) < 0.1  # of 0.3 deg


def test_a_play_is_replayed_behind_two_bounds(tmp_path) -> None:
    bounds = (
        ("coupling_deadband", {"until": 10.0, "corner": 0.1}, {}),
        ("distal_stop", {"from": 55.0, "passing": 0.0}, {}),
    )
    now = kinematic_state("linkage")
    moved = replayed(tmp_path, now, "linkage", *bounds, ("linkage_backlash", {"gap": 1.5, "form": 2.0}, {}))
    driven = np.clip(now.position, 10.0, 55.0)
    wanted = soft_play(on_the_map(now, driven), segment_gap((now,), {"value": 1.5})["value"], 0.0)
    assert off(wanted, moved, driven) < 0.1


def test_a_bound_holds_its_input_firmly_where_the_map_begins_flat(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(globals(), "LINKAGE", np.array([0.02, 0.01, 0.5, 0.0, 0.0]))
    finger = FINGER.replace("0.02 0.7 0.15 0 0", "0.02 0.01 0.5 0 0")
    finger = finger.replace('name="index_proximal" type', 'name="index_proximal" range="0 1.3" type')
    monkeypatch.setitem(globals(), "FINGER", finger)
    now = kinematic_state("linkage")
    moved = replayed(tmp_path, now, "linkage", ("coupling_deadband", {"until": 15.0, "corner": 0.1}, {}))
    assert off_the_map(now, moved, np.maximum(now.position, 15.0)) < 0.1


def test_plays_are_compiled_behind_bounds() -> None:
    """The spring that holds an input on its driver would pull a play ahead of it shut."""
    from hand_model.compile.mjcf import in_order

    names = ("linkage_backlash", "coupling_deadband", "drive_backlash", "distal_stop", "torque_ripple")
    found = [Effect(name, {}, {}) for name in names]
    assert [e.effect for e in in_order(found)] == [names[i] for i in (1, 3, 4, 0, 2)]  # as they stood otherwise


def test_a_finger_on_the_path_is_not_pulled_back_to_its_lever(tmp_path) -> None:
    from hand_model.diagnose.prove.forward import follower_along

    now, bound = kinematic_state("linkage"), ("coupling_deadband", {"until": 5.0, "corner": 0.1}, {})
    free = replayed(tmp_path, now, "linkage", bound)
    root = etree.parse(str(tmp_path / "index.xml")).getroot()
    (push,) = (t for t in root.iterfind("tendon/fixed") if t.get("name") == "index_push")
    push.set("stiffness", "20")
    push.set("damping", "0.1")
    (tmp_path / "index.xml").write_bytes(etree.tostring(root))
    where = {"finger": "index", "joint": "distal", "actuator": "index"}
    firm = np.rad2deg(follower_along(tmp_path, now, where, "linkage"))
    np.testing.assert_allclose(firm, free, atol=0.02)


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


def test_keyframes_satisfy_a_map_ahead_of_a_play() -> None:
    from hand_model.effects.input import settle, source

    root = etree.fromstring(FINGER)
    where = {"finger": "index", "joint": "distal", "actuator": "index"}
    play = {"gap": 2.0, "form": 2.0, "segment_gap": 1.6}
    assert effect("linkage_backlash").write_mjcf(root, where, play) is not None
    pose = {"index_proximal": 0.4} | dict.fromkeys(("index_distal", "index_linkage_mapped", "index_linkage_input"), 0.0)
    settle(root, pose)
    for joint in ("index_distal", "index_linkage_mapped", "index_linkage_input"):
        assert pose[joint] == pytest.approx(np.polynomial.polynomial.polyval(0.4, LINKAGE))
    assert source(root, "index_linkage_input") == "index_proximal"


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
