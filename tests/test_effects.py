"""Effects: found by the catalogue, columns that are finite and have the physics they claim, path operators."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from hand_model.diagnose.locate.drive import bouts
from hand_model.effects import catalogue, effect
from hand_model.effects.base import DriveState, Effect
from hand_model.effects.path import dahl, jenkins, lowpass, strokes, travelled
from hand_model.errors import DescriptionError

STATIONS = {"drive", "encoder", "linkage", "command", "motors", "markers"}


def state(n: int = 1200, seed: int = 0) -> DriveState:
    """Three full cycles at different speeds, 0 to 100 %."""
    t = np.arange(n) * 0.018
    phase = np.cumsum(np.repeat([0.3, 0.6, 1.0], n // 3)) * 0.018
    x = 50 - 50 * np.cos(2 * np.pi * phase)
    v, a = np.gradient(x, t), np.gradient(np.gradient(x, t), t)
    declared = np.stack([a, v, np.sign(v), x, np.ones(n)], axis=-1)
    names = ("inertia", "viscous", "coulomb", "spring", "preload")
    effort = declared @ np.array([0.01, 0.15, 35.0, 0.2, 9.0]) + np.random.default_rng(seed).normal(0, 1, n)
    return DriveState(
        "trial",
        "drive",
        t,
        x,
        v,
        a,
        effort,
        declared,
        declared_names=names,
        extra={"load": effort, "trial_index": np.zeros(n)},
    )


def test_catalogue_holds_one_effect_per_name_and_station() -> None:
    names = [e.name for e in catalogue()]
    assert len(names) == len(set(names)) >= 26
    assert {e.station for e in catalogue()} == STATIONS
    for name in ("stribeck_friction", "linkage_backlash", "clock_drift", "current_channel_delay", "command_delay"):
        assert effect(name).name == name


def test_unknown_effect_names_a_near_one() -> None:
    with pytest.raises(DescriptionError, match="stribeck_friction"):
        effect("stribek_friction")


@pytest.mark.parametrize("candidate", catalogue(), ids=lambda e: e.name)
def test_columns_are_finite_and_as_many_as_amplitudes_at_every_start(candidate) -> None:
    s = state()
    for shape in candidate.grid((s,)):
        columns = candidate.columns(s, shape)
        if candidate.station in ("command", "motors"):
            continue
        assert columns.shape == (len(s.time_s), len(candidate.amplitudes()))
        assert np.isfinite(columns).all()
    for shape in candidate.shapes((s,)):
        assert shape.low < shape.high or shape.name == "trial"
        assert all(shape.low - 1e-9 <= start <= shape.high + 1e-9 for start in shape.starts), shape


@pytest.mark.parametrize(
    "name",
    [
        "stribeck_friction",
        "load_dependent_friction",
        "position_dependent_friction",
        "quadratic_damping",
        "thermal_friction_drift",
        "elastoplastic_hysteresis",
    ],
)
def test_friction_opposes_motion(name: str) -> None:
    s, candidate = state(), effect(name)
    for shape in candidate.grid((s,))[:5]:
        power = candidate.columns(s, shape)[:, 0] * s.velocity
        assert power.sum() > 0  # over cycles friction only takes energy
        if name != "elastoplastic_hysteresis":
            assert (power > -1e-9).all()


@pytest.mark.parametrize("name", ["detent_load", "nonlinear_spring", "end_stop_contact", "torque_ripple"])
def test_loads_depend_on_position_only(name: str) -> None:
    s, candidate = state(), effect(name)
    reverse = DriveState(
        s.trial,
        s.drive,
        s.time_s,
        s.position,
        -s.velocity,
        s.acceleration,
        s.effort,
        -s.declared,
        declared_names=s.declared_names,
    )
    for shape in candidate.grid((s,))[:5]:
        np.testing.assert_allclose(candidate.columns(s, shape), candidate.columns(reverse, shape))


def test_strokes_cover_every_sample_once_and_ignore_noise() -> None:
    s = state()
    noisy = s.position + np.random.default_rng(1).normal(0, 0.1, len(s.position))
    cut = strokes(noisy)
    assert cut[0][0] == 0 and cut[-1][1] == len(noisy)
    assert all(a[1] == b[0] for a, b in itertools.pairwise(cut))
    turns = np.sum(np.diff(np.sign(s.velocity[s.velocity != 0])) != 0)
    assert len(cut) == turns + 1


def test_travelled_restarts_at_reversals_and_never_falls_within_a_stroke() -> None:
    x = state().position
    for a, b, _ in strokes(x):
        d = travelled(x)[a:b]
        assert d[0] == 0 and (np.diff(d) >= 0).all()


def test_dahl_solves_its_differential_equation() -> None:
    x = np.concatenate([np.linspace(0, 20, 4000), np.linspace(20, 5, 3000)])
    z = dahl(x, 3.0, threshold=0.5)
    dx, dz = np.diff(x), np.diff(z)
    inside = np.abs(dx) > 0
    middle = 0.5 * (z[1:] + z[:-1])
    np.testing.assert_allclose(dz[inside], ((1 - middle * np.sign(dx)) / 3.0 * dx)[inside], atol=2e-5)
    assert np.abs(z).max() <= 1


def test_damped_bristles_follow_the_state_of_lugre() -> None:
    s, presliding = state(6000), effect("presliding_friction")
    z, damped = (
        presliding.declared(s, {"bristle_length": 8.0, "bristle_time": time, "form": 0.0})[:, 2] for time in (0.0, 0.05)
    )
    rate = np.gradient(z, s.time_s)
    assert np.corrcoef(damped - z, 0.05 * rate)[0, 1] > 0.99
    assert np.ptp(damped - z) == pytest.approx(np.ptp(0.05 * rate), rel=0.1)


def test_jenkins_is_elastic_then_yields() -> None:
    x = np.concatenate([np.linspace(0, 10, 500), np.linspace(10, 0, 500)])
    z = jenkins(x, 2.0, threshold=0.1)
    np.testing.assert_allclose(z[:100], x[:100] / 2.0, atol=1e-9)
    assert z[499] == 1 and z[-1] == -1


def test_lowpass_of_a_step_is_exponential() -> None:
    t = np.linspace(0, 3, 3001)
    y = lowpass(t, (t > 1e-4).astype(float), 0.5)
    np.testing.assert_allclose(y, 1 - np.exp(-t / 0.5), atol=2e-3)


def test_an_obstacle_of_a_while_of_the_session_acts_in_every_recording_of_that_while_and_is_told_from_none() -> None:
    contact, one = effect("external_contact"), state()
    session = tuple(
        replace(
            one,
            extra={
                "trial_index": np.full(1200, float(i)),
                "elapsed": one.time_s + 30 * i,
                "session_s": np.full(1200, 81.6),
            },
        )
        for i in range(3)
    )
    shape = next(p for p in contact.grid(session) if p["trial"] == -1.0 and (p["since"], p["until"]) == (0.5, 1.0))
    acting = [np.any(contact.columns(s, shape)[:, 0] > 0) for s in session]
    assert acting == [False, True, True]
    assert not any(p["trial"] == -1.0 and (p["since"], p["until"]) == (0.0, 1.0) for p in contact.grid(session))


PLACE = {
    "finger": "index",
    "actuator": "index",
    "joint": "proximal",
    "signal": "current",
    "trials": ["first.csv", "second.csv"],
    "region": {"time": {"first.csv": [[1.0, 2.0], [4.0, 8.0]]}},
}
DECLARED = {"viscous": 0.15, "coulomb": 35.0, "spring": 0.22}
READ_ELSEWHERE = {
    "asymmetric_friction": {"half_difference": -9.0},
    "command_as_measurement": {},
    "command_delay": {"delay": 0.06},
    "drive_sag": {"sag": 4e-4},
    # no balance has their parameters
    "joint_wobble": {"amplitude": 0.04},
    "moving_centre": {"travel": 0.008},
}


RATIOS = {
    "rate_minus_one",
    "side",
    "trial",
    "form",
    "ratio",
    "static_ratio",
    "load_coefficient",
    "since",
    "until",
    "passing",
    "exponent",
    "lead",
    "end",
}


def posed() -> DriveState:
    s = state()
    extra = {**s.extra, "gravity_along": s.time_s, "moving": np.ones(len(s.time_s))}
    return DriveState(
        s.trial,
        s.drive,
        s.time_s,
        s.position,
        s.velocity,
        s.acceleration,
        s.effort,
        s.declared,
        declared_names=s.declared_names,
        extra=extra,
    )


@pytest.mark.parametrize("one", [e for e in catalogue() if isinstance(e, Effect)], ids=lambda e: e.name)
def test_every_parameter_has_its_unit(one) -> None:
    for point in one.grid((posed(),)):
        amplitude = {n: 1e-3 for n, *_ in one.amplitudes()}
        own = (
            {s.name: s.unit for s in one.shapes((posed(),))}
            | {n: u for n, u, *_ in one.amplitudes()}
            | dict(one.units(point))
        )
        bare = {n for n in one.parameters(point, amplitude, DECLARED) if own.get(n, "1") == "1"}
        assert bare <= RATIOS


def named() -> list:
    """Every effect with parameters for each of its forms and sides, amplitudes of either sign where physics allows
    it."""
    out = []
    for e in catalogue():
        if e.name in READ_ELSEWHERE:
            out.append(pytest.param(e, READ_ELSEWHERE[e.name], id=e.name))
            continue
        points = {(p.get("form"), p.get("side")): p for p in e.grid((posed(),))}
        for (key, point), sign in itertools.product(points.items(), (1.0, -1.0)):
            amplitude = {n: max(low, sign * 3e-3 * (i + 1)) for i, (n, _, low, _) in enumerate(e.amplitudes())}
            out.append(pytest.param(e, e.parameters(point, amplitude, DECLARED), id=f"{e.name}-{key}-{sign:+.0f}"))
    return out


@pytest.mark.parametrize(("candidate", "parameters"), named())
def test_statement_says_where_and_how_large_in_plain_words(candidate, parameters) -> None:
    said = candidate.statement(PLACE, parameters)
    assert said.startswith("index: ") and said.endswith(".") and "_" not in said
    assert f"index: {candidate.name.replace('_', ' ')}" not in said  # more than its name
    assert any(c.isdigit() for c in said) or not parameters
    assert len(said) < 200


@pytest.mark.parametrize("broken", [np.nan, np.inf, None, "left out"], ids=str)
@pytest.mark.parametrize(("candidate", "parameters"), named())
def test_statement_never_raises_and_shows_no_figure_that_is_none(candidate, parameters, broken) -> None:
    for spoilt in parameters:
        kept = {k: v for k, v in parameters.items() if k != spoilt}
        said = candidate.statement(PLACE, kept if broken == "left out" else {**kept, spoilt: broken})
        assert said.startswith("index: ") and said.endswith(".") and "_" not in said
        assert not {"nan", "inf", "none"} & set(said.lower().replace("(", " ").replace(".", " ").split())
    for where in ({}, {"finger": "index", "trials": None, "region": None}):
        for partial in ({}, parameters):
            assert candidate.statement(where, partial).endswith(".")


@pytest.mark.parametrize(
    "candidate",
    [
        e
        for e in (*catalogue("encoder"), *catalogue("linkage"))
        if not hasattr(e, "signal") and e.name != "spring_decoupling"
    ],
    ids=lambda e: e.name,
)
def test_statement_names_the_segment_that_follows(candidate) -> None:
    parameters = candidate.parameters(
        candidate.grid((state(),))[0], {n: 0.1 for n, *_ in candidate.amplitudes()}, DECLARED
    )
    assert "the middle segment" in candidate.statement({**PLACE, "joint": "middle"}, parameters)


OPPOSITES = [
    ("nonlinear_spring", {"form": 0.0, "cubic_stiffness": 0.0}, "quadratic_stiffness", "stiffer", "softer"),
    ("nonlinear_spring", {"form": 1.0, "knee": 40.0}, "stiffness_beyond", "stiffer", "softer"),
    ("clock_drift", {}, "rate_minus_one", "gains", "loses"),
    ("current_channel_delay", {"form": 0.0}, "delay", "earlier", "later"),
    ("detent_load", {"form": 0.0, "centre": 40.0, "width": 5.0}, "load", "against", "towards"),
    ("detent_load", {"form": 1.0, "centre": 40.0, "width": 5.0}, "load", "notch", "hump"),
    ("end_stop_contact", {"begin": 40.0, "stiffness": 1.0}, "side", "beyond", "below"),
    ("thermal_friction_drift", {"form": 0.0, "warm_up_time": 60.0}, "cold_excess", "higher", "lower"),
]


@pytest.mark.parametrize(
    ("name", "others", "key", "plus", "minus"), OPPOSITES, ids=[f"{o[0]}-{o[3]}" for o in OPPOSITES]
)
def test_statement_tells_the_sign(name, others, key, plus, minus) -> None:
    for value, right, wrong in ((0.01, plus, minus), (-0.01, minus, plus)):
        said = effect(name).statement(PLACE, {**others, key: value})
        assert right in said and wrong not in said and "-" not in said


def test_statement_of_a_spring_that_softens_first_gives_the_stiffness_changes_of_its_own_load() -> None:
    quadratic, cubic = -0.02, 2e-4
    said = effect("nonlinear_spring").statement(
        PLACE, {"form": 0.0, "quadratic_stiffness": quadratic, "cubic_stiffness": cubic}
    )
    slope = np.polyder([cubic, quadratic, 0.0, 0.0])
    turn = np.roots(np.polyder(slope))[0]
    first, second = np.diff(np.polyval(slope, [0.0, turn, 100.0]))
    assert first < 0 < second
    for words in (f"{-first:.3g} raw/% softer at {turn:.1f} %", f"{second:.3g} raw/% stiffer at 100 %"):
        assert words in said


MOTOR = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><body><inertial pos="0 0 0" mass="1e-9"
 diaginertia="1e-9 1e-9 1e-9"/><joint name="index_motor" axis="0 0 1" limited="false" damping="0.15" stiffness="0.22"
 springref="-40" armature="0.01" frictionloss="35"/></body></worldbody><custom><numeric name="index_effort_per_raw" data="2.0"/></custom>
 <actuator><general name="index" joint="index_motor" gainprm="0" biastype="none"/></actuator></mujoco>"""
NATIVE = [
    ("quadratic_damping", {}, {"drag": 0.002}, [0.002]),
    ("nonlinear_spring", {}, {"quadratic_stiffness": 1e-3, "cubic_stiffness": 3e-5}, [1e-3, 3e-5]),
    (
        "end_stop_contact",
        {"side": 1.0, "inward": 18.0, "end": 100.0},
        {"side": 1.0, "begin": 82.0, "stiffness": 1.5},
        [1.5],
    ),
    (
        "end_stop_contact",
        {"side": -1.0, "inward": 12.0, "end": 0.0},
        {"side": -1.0, "begin": 12.0, "stiffness": 1.5},
        [1.5],
    ),
    (
        "torque_ripple",
        {"period": 9.0},
        {"amplitude": 5.0, "period": 9.0, "phase": float(np.arctan2(3.0, 4.0))},
        [4.0, 3.0],
    ),
]


@pytest.mark.parametrize(
    ("name", "shape", "parameters", "amplitude"), NATIVE, ids=[f"{n[0]}_{i}" for i, n in enumerate(NATIVE)]
)
def test_native_element_forces_are_the_effects_own(name, shape, parameters, amplitude) -> None:
    """MuJoCo's force at the motor joint changes by minus the effect's load, times the file's effort per raw unit."""
    mujoco = pytest.importorskip("mujoco")
    from lxml import etree

    root = etree.fromstring(MOTOR)
    place = effect(name).write_mjcf(root, {"actuator": "index"}, parameters)
    assert place is not None
    x, v = np.array([0.0, 3.0, 11.0, 50.0, 81.0, 90.0, 99.0]), np.array([0.0, -20.0, 35.0, -80.0, 110.0, 10.0, -5.0])
    state = DriveState(
        "t",
        "index",
        np.arange(7) * 0.02,
        x,
        v,
        0 * x,
        0 * x,
        np.stack([np.sign(v)], -1),
        declared_names=("coulomb",),
        extra={"bandwidth_s": np.zeros(7)},
    )
    load = effect(name).columns(state, shape) @ np.array(amplitude)

    def force(xml: bytes | str) -> np.ndarray:
        model = mujoco.MjModel.from_xml_string(xml if isinstance(xml, str) else xml.decode())
        data, out = mujoco.MjData(model), []
        for position, velocity in zip(x, v, strict=True):
            data.qpos[0], data.qvel[0] = position, velocity
            mujoco.mj_forward(model, data)
            out.append(float(data.qfrc_passive[0] + data.qfrc_actuator[0]))
        return np.array(out)

    np.testing.assert_allclose(force(etree.tostring(root)) - force(MOTOR), -2.0 * load, atol=1e-8)


def test_native_elements_are_not_written_where_there_is_no_motor() -> None:
    from lxml import etree

    for name in ("quadratic_damping", "stribeck_friction", "torque_ripple"):
        root = etree.fromstring(MOTOR)
        before = etree.tostring(root)
        assert effect(name).write_mjcf(root, {"actuator": "thumb"}, {}) is None
        assert etree.tostring(root) == before


@pytest.mark.parametrize(
    ("name", "parameters", "lugre"),
    [
        (
            "stribeck_friction",
            {"static_ratio": 1.8, "stribeck_speed": 18.0, "static_excess": 14.0, "exponent": 2.0},
            [350.0, 0.0, 35.0, 63.0, 18.0],
        ),
        ("presliding_friction", {"bristle_length": 7.0}, [5.0, 0.0, 35.0, 35.0, 20.0]),
        ("presliding_friction", {"bristle_length": 7.0, "bristle_time": 0.04}, [5.0, 0.2, 35.0, 35.0, 20.0]),
    ],
)
def test_lugre_replaces_the_joints_friction(name, parameters, lugre) -> None:
    mujoco = pytest.importorskip("mujoco")
    from lxml import etree

    root = etree.fromstring(MOTOR)
    assert (
        effect(name).write_mjcf(root, {"actuator": "index"}, parameters) == "actuator/dcmotor[@name='index_friction']"
    )
    assert mujoco.MjModel.from_xml_string(etree.tostring(root).decode()).dof_frictionloss[0] == 0
    written = [float(x) for x in root.find("actuator/dcmotor").get("lugre").split()]
    np.testing.assert_allclose(written, lugre, rtol=1e-9)


@pytest.mark.parametrize(("damping", "nearly"), [(0.0, 0.025), (0.05, 0.02), (0.15, 0.014), (0.5, 0.0125)])
def test_a_rise_of_exponent_one_is_written_as_near_as_the_joints_damping_allows(damping, nearly) -> None:
    """Friction and damping of the file against 35 + 28 exp(-v / 18) + damping v (root mean square over the rise, 0.25
    to 9 Stribeck speeds)."""
    from lxml import etree

    root = etree.fromstring(MOTOR.replace('damping="0.15"', f'damping="{damping}"'))
    effect("stribeck_friction").write_mjcf(
        root,
        {"actuator": "index"},
        {"static_ratio": 1.8, "stribeck_speed": 18.0, "static_excess": 14.0, "exponent": 1.0},
    )
    _, _, sliding, static, speed = (float(x) for x in root.find("actuator/dcmotor").get("lugre").split())
    linear, quadratic = ([float(x) for x in root.find(".//joint").get("damping").split()] + [0.0])[:2]
    v = np.linspace(0.25 * 18, 9 * 18, 300)
    written = sliding + (static - sliding) * np.exp(-((v / speed) ** 2)) + linear * v + quadratic * v**2
    assert linear >= 0 and np.sqrt(np.mean((written - (35 + 28 * np.exp(-v / 18) + damping * v)) ** 2)) < nearly * 28


def test_a_recording_without_the_pose_of_the_hand_bears_no_weight_out() -> None:
    plain = state()
    posed = replace(plain, extra={**plain.extra, "pose_seen": np.ones(len(plain.time_s))})
    assert not effect("gravity_load").told_by(plain) and effect("gravity_load").told_by(posed)
    assert effect("stribeck_friction").told_by(plain)


def test_a_delay_is_the_one_that_answers_to_commands_tell_where_they_tell_it_well() -> None:
    delay, s = effect("current_channel_delay"), state()
    read = {"form": {"value": 0.0}, "delay": {"value": 0.05}}

    def told(late_s: float, doubt_s: float) -> tuple[DriveState, ...]:
        return (DriveState(**{**vars(s), "extra": {**s.extra, "late": np.array([late_s, doubt_s])}}),)

    entry = delay.further(told(0.062, 0.005), read)["delay"]
    assert entry["value"] == 0.062 and entry["ci95"][0] < 0.055 and entry["ci95"][1] > 0.069
    assert delay.further((s,), read) == {}  # no commands
    assert delay.further(told(0.062, 0.03), read) == {}  # told to more than a sample interval
    assert delay.further(told(0.062, 0.005), {**read, "form": {"value": 1.0}}) == {}  # a filter
    assert delay.lateness({"form": 0.0, "delay": 0.05}) == (0.05, 0.05)
    assert delay.lateness({"form": 0.0, "delay": -0.05}) == (-0.05, 0.0)
    low, high = delay.lateness({"form": 1.0, "delay": 0.05})
    assert 0 < low < high == 0.05


def test_a_drive_warms_in_motion_and_cools_at_every_rest() -> None:
    time_s = np.arange(0, 60, 0.02)
    moving = (time_s % 10 > 2) & (time_s > 4)
    warm_s, cool_s, want, cold = 12.0, 30.0, [], 1.0
    for now, step in zip(moving, np.diff(time_s, prepend=0.0), strict=True):
        cold = cold * np.exp(-step / warm_s) if now else 1 - (1 - cold) * np.exp(-step / cool_s)
        want.append(cold)
    half = len(time_s) // 2
    earlier = np.array(bouts(time_s[:half], moving[:half]))
    assert earlier.sum() == pytest.approx(time_s[half - 1])
    earlier[-1, 1] += 0.02  # until the second half begins
    late = DriveState(
        "b",
        "drive",
        time_s[half:],
        0 * time_s[half:],
        np.ones(len(time_s) - half),
        0 * time_s[half:],
        0 * time_s[half:],
        np.zeros((len(time_s) - half, 0)),
        extra={"history": earlier, "moving": moving[half:].astype(float)},
    )
    column = effect("thermal_friction_drift").columns(
        late, {"form": 1.0, "warm_up_time": warm_s, "cooling_time": cool_s}
    )[:, 0]
    np.testing.assert_allclose(column, want[half:], atol=1e-3)


@pytest.mark.parametrize(
    ("trial", "until", "acts"), [(-2.0, 0.95, False), (-1.0, 1.0, False), (-2.0, 0.7, True), (0.0, 1.0, True)]
)
def test_what_is_there_all_along_in_every_recording_is_no_obstacle(trial: float, until: float, acts: bool) -> None:
    s = state()
    s = replace(s, extra={**s.extra, "session_s": np.full(len(s.time_s), s.elapsed_s[-1])})
    columns = effect("external_contact").columns(
        s, {"trial": trial, "form": 0.0, "since": 0.0, "until": until, "begin": float(np.median(s.position))}
    )
    assert bool(columns.any()) is acts
