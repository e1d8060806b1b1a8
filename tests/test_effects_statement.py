"""What effects say of themselves: where, how large, of which sign and unit."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from drive_motion import state

from hand_model.effects import catalogue, effect
from hand_model.effects.base import DriveState, Effect

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
    [e for e in (*catalogue("encoder"), *catalogue("linkage")) if e.signal is None and e.name != "spring_decoupling"],
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
