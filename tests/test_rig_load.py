"""Friction by load at a hinge: which side of the gear it goes by, and how large; springs and offsets beside what is
declared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rig_bench import ARM, HEAD, Motion, recorded

from hand_model.rig import diagnose_rig, load_rig
from hand_model.rig.diagnose import trusted_fit
from hand_model.rig.laws import (
    ALL_TURNING,
    BRISTLES,
    GEAR,
    GEAR_LOW,
    GEAR_MORE,
    LOW,
    MORE,
    MOTOR,
    MOTOR_LOW,
    MOTOR_MORE,
    TURNING,
    Now,
    law,
)
from hand_model.rig.name.candidates import PRELOADED, UNDECLARED, Candidate, candidates
from hand_model.rig.name.compete import _resettled, _said
from hand_model.rig.name.problem import Term, pose, rescaled, solution
from hand_model.rig.name.settled import settled
from hand_model.rig.name.turning import knees
from hand_model.session import read_session

SIZE = 0.25
LAWS = {
    MOTOR: lambda drive, load, bias: np.abs(drive),
    GEAR: lambda drive, load, bias: 0.5 * np.abs(drive + bias),
    "": lambda drive, load, bias: np.abs(load),
}


def bench(
    folder: Path, side: str | None = None, offset: float = 0.0, stiffness: float = 0.0, weight: float = 9.81
) -> Path:
    """Five recordings of two sines each, the last held out: friction in proportion to one side of the gear (None:
    constant), an offset [N m] and a spring [N m/rad] that nobody declared; weight [m/s2]: of the arm."""

    def torque(motion: Motion) -> np.ndarray:
        _, q, v, a = motion
        bias = 0.6 * 0.2 * weight * np.sin(q)
        load = bias + (0.6 * 0.04 + 0.002) * a
        rest = load + 0.004 * a + 0.03 * v + offset + stiffness * q
        asked = rest + 0.08 * np.sign(v)
        for _ in range(60 if side is not None else 0):  # the friction is part of the drive's effort that it grows with
            asked = rest + np.sign(v) * (0.08 + SIZE * LAWS[side](asked, load, bias))
        return asked

    arm = ARM.replace('damping="', 'armature="0.002" damping="').replace("-9.81", repr(-weight))
    return recorded(folder, arm, 5, torque, 0.01)


@pytest.mark.parametrize("side", LAWS)
def test_friction_by_either_side_of_a_gear(tmp_path: Path, side: str) -> None:
    """Named first, its size within 10 % by whichever side it goes, and little of the mismatch is left."""
    found = diagnose_rig(read_session(bench(tmp_path / "s", side)))
    first = found.findings[0]
    assert first.effect == "load_dependent_friction"
    amplitude = [p["value"] for name, p in first.parameters.items() if name.startswith("per_")]
    assert amplitude == pytest.approx([SIZE], rel=0.1)
    assert found.lack_of_fit["one_effect"] < 0.25


def test_friction_of_a_gear_is_half_the_sum_of_both_sides() -> None:
    """The law in open loop: none at the moment at which drive and bias cancel."""
    act = law({"effect": "load_dependent_friction", "variant": GEAR, "shape": {}, "amplitude": {"per_load": 0.2}})
    assert act is not None
    assert act(Now(0.0, 1.0, load=9.0, drive=3.0, bias=1.0)) == pytest.approx((0.0, 0.4))
    assert act(Now(0.0, 1.0, load=9.0, drive=3.0, bias=-3.0)) == pytest.approx((0.0, 0.0))


def test_every_friction_by_load_is_in_open_loop_what_it_is_in_the_balance(tmp_path: Path) -> None:
    rig = load_rig(read_session(bench(tmp_path / "s", MOTOR)))
    fit = trusted_fit(rig)[0]
    row, variants = fit.rows[0], set()
    sides = [row.position, row.velocity, row.load(fit.theta), fit.expected(row), row.bias(fit.theta)]
    for candidate in (
        c
        for c in candidates(rig, fit, "hinge")
        if c.effect == "load_dependent_friction" and c.variant not in ("", TURNING, ALL_TURNING)
    ):
        shape, sizes = candidate.grid[-1], dict(zip((a[0] for a in candidate.amplitudes), (0.2, 0.3), strict=False))
        act = law({"effect": candidate.effect, "variant": candidate.variant, "shape": shape, "amplitude": sizes})
        assert act is not None
        size = np.array([np.sum(act(Now(*now))) for now in zip(*(x[100:400] for x in sides), strict=True)])
        column = candidate.columns(row, shape)[100:400] @ list(sizes.values())
        moving = np.abs(row.velocity[100:400]) > 0.3
        np.testing.assert_allclose(np.abs(column)[moving], np.abs(size)[moving], rtol=1e-6)
        variants.add(candidate.variant)
    assert variants == {LOW, MORE, MOTOR, MOTOR_LOW, MOTOR_MORE, GEAR, GEAR_LOW, GEAR_MORE, "with speed"}


def test_friction_by_load_and_a_constant_turn_round_together_in_open_loop_as_in_the_balance(tmp_path: Path) -> None:
    rig = load_rig(read_session(bench(tmp_path / "s", MOTOR)))
    fit = trusted_fit(rig)[0]
    (both,) = (c for c in candidates(rig, fit, "hinge") if c.variant == ALL_TURNING)
    row = fit.rows[0]
    for form in (0.0, 1.0):
        shape, sizes = {"form": form, "reach": 0.05}, {"per_load": 0.2, "yield_load": 0.3}
        act = law({"effect": both.effect, "variant": both.variant, "shape": shape, "amplitude": sizes})
        assert act is not None
        states = zip(row.position, row.velocity, row.load(fit.theta), strict=True)
        size = np.array([act(Now(q, v, load, 0.0)) for q, v, load in states])
        np.testing.assert_allclose(both.columns(row, shape) @ [0.2, 0.3], size[:, 0], atol=1e-7)
        assert not size[:, 1].any()


def test_a_spring_that_nobody_declared(tmp_path: Path) -> None:
    """Where nothing declared pulls the joint back a spring is seen by its line, and the law in open loop has it too;
    beside a weight it is not looked for."""
    rigs = [load_rig(read_session(bench(tmp_path / f"{w}", stiffness=0.5, weight=w))) for w in (9.81, 0.0)]
    fits = [trusted_fit(rig)[0] for rig in rigs]
    none, spring = (
        [c for c in candidates(*x, "hinge") if c.variant == UNDECLARED] for x in zip(rigs, fits, strict=True)
    )
    assert not none
    fit, spring = fits[1], spring[0]
    theta = solution(pose(fit), [Term(spring, {})])
    fitted = dict(zip([a[0] for a in spring.amplitudes], theta[len(fit.columns) :], strict=True))
    at = 0.6  # [rad]
    act = law({"effect": spring.effect, "variant": spring.variant, "shape": {}, "amplitude": fitted})
    assert act is not None
    assert act(Now(at, 0.0, 0.0, 0.0))[0] == pytest.approx(0.5 * at, rel=0.03)


def test_a_spring_may_be_at_rest_anywhere(tmp_path: Path) -> None:
    """One that is at rest 0.4 rad from the joint's zero is read with what it gives there, in open loop too; beside an
    offset, which says the same, it is not asked."""
    rig = load_rig(read_session(bench(tmp_path / "s", stiffness=0.5, weight=0.0)))
    fit = trusted_fit(rig)[0]
    fit = replace(
        fit, rows=tuple(replace(r, effort=r.effort + r.filtered(np.full(len(r.position), 0.2))) for r in fit.rows)
    )
    every = candidates(rig, fit, "hinge")
    spring = next(c for c in every if c.variant == PRELOADED)
    theta = solution(pose(fit), [Term(spring, {})])
    fitted = dict(zip([a[0] for a in spring.amplitudes], theta[len(fit.columns) :], strict=True))
    act = law({"effect": spring.effect, "variant": spring.variant, "shape": {}, "amplitude": fitted})
    assert act is not None and fitted["preload"] == pytest.approx(0.2, rel=0.05)
    for at in (-0.4, 0.6):
        assert act(Now(at, 0.0, 0.0, 0.0))[0] == pytest.approx(0.5 * (at + 0.4), abs=0.02)
    offset = Term(next(c for c in every if c.effect == "asymmetric_friction"), {})
    assert _said(spring, [offset]) and not _said(spring, [])


def test_a_large_effect_does_not_hold_the_declared_parameters_back(tmp_path: Path) -> None:
    """Beside an offset of many times the rest, once it is there, the weight is as the recordings say, not as
    declared."""
    rig = load_rig(read_session(bench(tmp_path / "s", offset=8.0)))
    fit = trusted_fit(rig)[0]
    offset = Term(next(c for c in candidates(rig, fit, "hinge") if c.effect == "asymmetric_friction"), {})
    theta = solution(pose(fit), [offset])
    weight = theta[[c.label for c in fit.columns].index("inertial:arm:hz")]
    assert weight == pytest.approx(-0.6 * 0.2, rel=5e-3)
    assert rescaled(pose(fit), [offset]).fit.scale["hinge"] < 0.05 * fit.scale["hinge"]


def test_bristles_that_slacken_with_speed_are_in_open_loop_what_they_are_in_the_balance(tmp_path: Path) -> None:
    rig = load_rig(read_session(bench(tmp_path / "s")))
    fit = trusted_fit(rig)[0]
    row = fit.rows[0]
    candidate = next(
        c for c in candidates(rig, fit, "hinge") if (c.effect, c.variant) == ("stribeck_friction", TURNING)
    )
    shape = candidate.grid[5]
    act = law(
        {"effect": candidate.effect, "variant": candidate.variant, "shape": shape, "amplitude": {"static_excess": 0.2}}
    )
    assert act is not None
    column = 0.2 * candidate.columns(row, shape)[:, 0]
    stepped = np.array([np.sum(act(Now(q, v, 0.0, 0.0))) for q, v in zip(row.position, row.velocity, strict=True)])
    np.testing.assert_allclose(column[50:], stepped[50:], atol=1e-9)
    assert np.ptp(column) > 0.1


def test_bristles_that_hold_more_while_slow_are_a_lugre_model_beside_those_that_do_not(tmp_path: Path) -> None:
    """Both together are the model integrated in small steps; in open loop they are what they are in the balance."""
    rig = load_rig(read_session(bench(tmp_path / "s")))
    fit = trusted_fit(rig)[0]
    row = fit.rows[0]
    every = {(c.effect, c.variant): c for c in candidates(rig, fit, "hinge")}
    more, plain = every["stribeck_friction", BRISTLES], every["elastoplastic_hysteresis", ""]
    reach, slow, ratio = 0.05, 0.6, 0.8
    shape = {"reach": reach, "stribeck_speed": slow, "static_ratio": ratio}
    column = ratio * more.columns(row, shape)[:, 0]
    both = plain.columns(row, {"form": 1.0, "reach": reach})[:, 0] + column
    fine = np.arange(0, row.time_s[-1] - row.time_s[0], 1e-4)
    time_s = row.time_s - row.time_s[0]
    q, v = np.interp(fine, time_s, row.position), np.interp(fine, time_s, row.velocity)
    z, state = 0.0, np.zeros(len(fine))
    for k in range(1, len(fine)):
        level = 1.0 + ratio * np.exp(-((v[k] / slow) ** 2))
        step = q[k] - q[k - 1]
        z += (step - abs(step) * z / level) / reach
        state[k] = z
    assert np.abs(both - np.interp(time_s, fine, state))[200:].max() < 0.05
    assert column[200:].max() > 0.3
    record = {"effect": more.effect, "variant": more.variant, "shape": shape, "amplitude": {"static_excess": ratio}}
    act = law(record)
    assert act is not None
    stepped = np.array([np.sum(act(Now(q, v, 0.0, 0.0))) for q, v in zip(row.position, row.velocity, strict=True)])
    assert np.abs(column - stepped)[200:].max() < 0.05


@pytest.mark.slow
def test_a_stribeck_rise_beside_friction_by_load_is_read_at_its_size(tmp_path: Path) -> None:
    """Where it is largest friction turns round: what is read there must not be blurred by how the log is thinned."""

    def torque(motion: Motion) -> np.ndarray:
        _, q, v, a = motion
        load = (0.6 * 0.04 + 0.002) * a + 0.6 * 0.2 * 9.81 * np.sin(q)
        return load + 0.03 * v + np.sign(v) * (0.08 + 0.06 * np.exp(-np.abs(v) / 0.3) + SIZE * np.abs(load))

    found = diagnose_rig(read_session(recorded(tmp_path / "s", ARM, 6, torque, 0.01))).findings
    assert [f.effect for f in found] == ["load_dependent_friction", "stribeck_friction"]
    sizes = found[0].parameters["per_load"], found[1].parameters["static_excess"], found[1].parameters["stribeck_speed"]
    assert [p["value"] for p in sizes] == pytest.approx([SIZE, 0.06, 0.3], rel=0.1)


def test_friction_by_load_that_is_larger_at_low_speed_is_one_effect(tmp_path: Path) -> None:
    """A part of the load at every speed and a larger one below a Stribeck speed: one name, all three figures within 10
    %."""

    def torque(motion: Motion) -> np.ndarray:
        _, q, v, a = motion
        load = (0.6 * 0.04 + 0.002) * a + 0.6 * 0.2 * 9.81 * np.sin(q)
        return load + 0.03 * v + np.sign(v) * (0.08 + (0.1 + SIZE * np.exp(-((v / 0.4) ** 2))) * np.abs(load))

    found = diagnose_rig(read_session(recorded(tmp_path / "s", ARM, 6, torque, 0.01))).findings
    assert [f.effect for f in found] == ["load_dependent_friction"]
    sizes = [found[0].parameters[k]["value"] for k in ("per_load", "per_load_low", "stribeck_speed")]
    assert sizes == pytest.approx([0.1, SIZE, 0.4], rel=0.1)


def test_what_stood_in_for_a_later_friction_by_load_goes(tmp_path: Path) -> None:
    """Each at the loads of what remains; not where the rest stood before, or two sets would follow each other for
    ever."""
    rig = load_rig(read_session(bench(tmp_path / "s", MOTOR)))
    fit = trusted_fit(rig)[0]

    def settle(terms: tuple[Term, ...]) -> tuple[tuple[Term, ...], tuple[Candidate, ...]]:
        same, _, at = settled(rig, fit, terms)
        return tuple(same), candidates(rig, at, "hinge")

    known = {c.variant: c for c in candidates(rig, fit, "hinge") if c.effect == "load_dependent_friction"}
    terms = settle((Term(known["with speed"], {}), Term(known[MOTOR], {})))[0]
    kept, stays = _resettled(pose(fit, "hinge"), terms, 0, set(), settle)
    assert [t.candidate.variant for t in kept] == [MOTOR] and stays == [False, True]
    assert _resettled(pose(fit, "hinge"), terms, 0, {(terms[1].candidate.key,)}, settle)[1] == [True, True]


def test_no_stribeck_speed_lies_where_the_joint_stands(tmp_path: Path) -> None:
    """A joint that stands most of the time, its encoder noisy: what is tried acts on what moves, for friction at rest
    is unknown."""
    folder, t = tmp_path / "s", np.arange(0, 12, 0.004)
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(ARM)
    text = HEAD
    for k in range(4):
        q = 0.4 * np.where(t < 7, 1.0, np.cos(2 * np.pi * (0.3 + 0.1 * k) * (t - 7)))
        v = np.gradient(q, t)
        torque = 0.6 * 0.2 * 9.81 * np.sin(q) + 0.026 * np.gradient(v, t) + 0.03 * v + 0.1 * np.sign(v)
        table = np.stack([t, q + 1e-4 * np.random.default_rng(k).standard_normal(len(t)), torque], 1)
        np.savetxt(
            folder / f"log/{k}.csv", table, delimiter=",", header="time,position,torque", comments="", fmt="%.8g"
        )
        text += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n'
    (folder / "session.toml").write_text(text)
    rig = load_rig(read_session(folder))
    fit = trusted_fit(rig)[0]
    assert np.mean([np.mean(np.abs(r.velocity) < r.rest_speed) for r in fit.rows]) > 0.5
    speeds = [g["stribeck_speed"] for c in candidates(rig, fit, "hinge") for g in c.grid if "stribeck_speed" in g]
    assert speeds and min(speeds) > max(r.rest_speed for r in fit.rows)


@pytest.mark.parametrize("speed", [0.0, 1e-4])
def test_a_joint_that_is_held_throughout_has_stribeck_speeds_to_try(speed: float) -> None:
    held = SimpleNamespace(velocity=np.full(50, speed), rest_speed=1e-3)
    assert all(0 < knee["stribeck_speed"] <= 1e-3 for knee in knees([held]))
