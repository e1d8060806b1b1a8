"""Effects with shapes beside each other: what stands must not keep out what it has made up for; what is largest comes
first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rig_bench import ARM, HEAD, Motion, balance, recorded, two_sines, written

from hand_model.report.rig_effort import _turn
from hand_model.rig import diagnose_rig, load_rig, trial_balance
from hand_model.rig.diagnose import _rank, trusted_fit
from hand_model.rig.findings import Finding
from hand_model.rig.name.beside import Beside, score
from hand_model.rig.name.candidates import Candidate, candidates
from hand_model.rig.name.compete import LEAST_SHARE, _met, compete
from hand_model.rig.name.problem import Term, held_out, normal, pose
from hand_model.rig.name.refit import refit
from hand_model.rig.name.ripple import fine_periods
from hand_model.rig.words import shares
from hand_model.session import read_session

SPEED = 0.49  # rad/s, of the planted Stribeck rise


@pytest.fixture(scope="module")
def rig_fit(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A hinge with a Stribeck rise and a small drag, and its declared fit."""

    def torque(motion: Motion) -> np.ndarray:
        _, q, v, a = motion
        dry = 0.065 + 0.056 * np.exp(-((v / SPEED) ** 2))
        return (
            (0.6 * 0.04 + 0.002) * a
            + 0.6 * 0.2 * 9.81 * np.sin(q)
            + 0.02 * v
            + 0.0142 * v * np.abs(v)
            + np.sign(v) * dry
        )

    path: Path = tmp_path_factory.mktemp("bench") / "s"
    rig = load_rig(read_session(recorded(path, ARM, 5, torque, 0.01)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trial_balance, "ENOUGH_SAMPLES", 0)  # on a coarse grid, as a long recording has it
        return rig, trusted_fit(rig)[0]


def test_a_rival_is_held_to_what_stands_with_its_shapes_moved_for_it(rig_fit: Any) -> None:
    """Alone a Stribeck rise takes a speed that makes up for the drag: beside that the drag is not worth a name, beside
    the right one it is."""
    rig, fit = rig_fit
    problem, known = pose(fit, "hinge"), {c.key: c for c in candidates(rig, fit, "hinge")}
    rise = replace(
        known["stribeck_friction@hinge"],
        grid=tuple(g for g in known["stribeck_friction@hinge"].grid if g["form"] == 1.0),
    )
    terms = refit(problem, (Term(rise, dict(rise.grid[0])),))
    parts = normal(problem, terms)
    none = held_out(problem, terms, parts).sum()
    frozen = score(problem, terms, known["quadratic_damping@hinge"], parts)
    with Beside(problem, terms, parts, [known["quadratic_damping@hinge"]], 0) as beside:
        moved = _met(problem, terms, beside)[0]
    assert frozen.error.sum() > (1 - 2 * LEAST_SHARE) * none
    assert moved.error.sum() < 0.3 * none
    assert moved.others[0].shape["stribeck_speed"] == pytest.approx(SPEED, rel=0.1)


def test_a_form_that_was_chosen_without_a_later_effect_is_chosen_again_beside_it(rig_fit: Any) -> None:
    """Without the drag the exponential rise explains more than the Gaussian one, which was planted."""
    rig, fit = rig_fit
    some = [
        c
        for c in candidates(rig, fit, "hinge")
        if c.effect in ("stribeck_friction", "quadratic_damping") and not c.variant
    ]
    first = compete(pose(fit), some, most=1)[0][0]
    both = {t.candidate.effect: t.shape for t in compete(pose(fit), some)[0]}
    assert first.shape["form"] == 0.0 and both["stribeck_friction"]["form"] == 1.0
    assert both["stribeck_friction"]["stribeck_speed"] == pytest.approx(SPEED, rel=0.1)


def with_load(folder: Path, load: Callable[[np.ndarray], np.ndarray]) -> Any:
    """A hinge that its drive pushes against a load [N m] by position [rad], and its declared fit."""

    def torque(motion: Motion) -> np.ndarray:
        _, q, v, a = motion
        return (0.6 * 0.04 + 0.002) * a + 0.6 * 0.2 * 9.81 * np.sin(q) + 0.02 * v + 0.065 * np.sign(v) + load(q)

    rig = load_rig(read_session(recorded(folder, ARM, 5, torque, 0.01)))
    return rig, trusted_fit(rig)[0]


def test_a_rival_is_held_to_the_others_at_its_best_place_not_at_that_of_a_grid(tmp_path: Path) -> None:
    """A detent between two places of its grid: there it leaves most of itself, and another effect would take its
    name."""
    rig, fit = with_load(tmp_path / "s", lambda q: 0.3 * np.exp(-0.5 * ((q - 0.13) / 0.09) ** 2))
    detent = next(c for c in candidates(rig, fit, "hinge") if c.effect == "detent_load")
    places = np.unique([g["centre"] for g in detent.grid])
    near = places[np.argsort(np.abs(places - 0.13))[:1]]
    coarse = replace(detent, grid=tuple(g for g in detent.grid if g["form"] == 0.0 and g["centre"] not in near))
    problem = pose(fit, "hinge")
    parts = normal(problem, ())
    frozen = score(problem, (), coarse, parts)
    with Beside(problem, (), parts, [coarse], 0) as beside:
        best = _met(problem, (), beside)[0]
    assert best.error.sum() < 0.5 * frozen.error.sum()
    assert (best.term.shape["centre"], best.term.shape["width"]) == pytest.approx((0.13, 0.09), rel=0.1)


def test_a_detent_narrower_than_any_of_its_grid_is_as_narrow_and_as_high_as_it_is(tmp_path: Path) -> None:
    """A fiftieth of the range: it lies between places that are looked at, and no start is as narrow."""
    rig, fit = with_load(tmp_path / "s", lambda q: 0.3 * np.exp(-0.5 * ((q - 0.137) / 0.03) ** 2))
    detent = next(c for c in candidates(rig, fit, "hinge") if c.effect == "detent_load")
    assert min(g["width"] for g in detent.grid) > 0.031
    problem = pose(fit, "hinge")
    shape = refit(problem, compete(problem, [detent], most=1)[0])[0].shape
    assert shape["form"] == 0.0 and (shape["centre"], shape["width"]) == pytest.approx((0.137, 0.03), rel=0.05)


def test_two_effects_of_which_neither_alone_is_worth_a_name(tmp_path: Path) -> None:
    """What is left is the difference of two columns that are nearly one: both are found, in whichever order; one of
    them alone is not."""
    columns = {"detent_load": lambda q: np.sin(7 * q), "torque_ripple": lambda q: np.sin(7 * q) + 0.1 * np.cos(19 * q)}
    _, fit = with_load(tmp_path / "s", lambda q: columns["torque_ripple"](q) - columns["detent_load"](q))
    rivals = [
        Candidate(
            name,
            "",
            "hinge",
            (("size", "effort", -np.inf, np.inf),),
            ({},),
            lambda r, s, c=column: c(r.position)[:, None],
        )
        for name, column in columns.items()
    ]
    terms, steps, _ = compete(pose(fit, "hinge"), rivals)
    assert {t.candidate.effect for t in terms} == set(columns) and len(steps) == 2
    assert not any(compete(pose(fit, "hinge"), [rival])[0] for rival in rivals)


def found(joint: str, before: float, after: float) -> Finding:
    """A finding at a joint that takes the error from before to after."""
    return Finding(
        "torque_ripple",
        ("torque_ripple",),
        1.0,
        (),
        {"joint": joint, "share_of_mismatch": before**2 - after**2},
        "",
        {},
        {},
        {},
    )


def test_a_faint_effect_alone_at_a_joint_is_a_small_share() -> None:
    """Of what the declared model leaves beyond the noise, at each joint; where noise is all there is, of what is
    explained."""
    declared = {
        "shoulder": {"before": 5.0, "noise_floor": 3.0},
        "elbow": {"before": 5.0, "noise_floor": 3.0},
        "wrist": {"before": 2.0, "noise_floor": 2.0},
    }
    told = shares([found("shoulder", 5.0, 4.9), found("elbow", 5.0, 3.5), found("wrist", 2.0, 1.0)], declared)
    assert [f.where["share_of_mismatch"] for f in told] == pytest.approx([0.99 / 16, 12.75 / 16, 1.0])


def test_shares_that_hardly_differ_do_not_set_the_order() -> None:
    """What is first is first by more than what would be worth a name."""
    declared = {j: {"before": 1.0, "noise_floor": 0.0} for j in ("effort", "angle", "half")}
    told = shares([found("half", 1.0, 0.7), found("effort", 1.0, 0.08), found("angle", 1.0, 0.02)], declared)
    assert [f.where["joint"] for f in sorted(told, key=_rank)] == ["effort", "angle", "half"]


def test_two_processes_try_rivals_as_one_does(rig_fit: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    rig, fit = rig_fit
    problem, known = pose(fit, "hinge"), {c.key: c for c in candidates(rig, fit, "hinge")}
    rivals = [known[f"{name}@hinge"] for name in ("quadratic_damping", "stribeck_friction", "asymmetric_friction")]
    rivals[1] = replace(rivals[1], grid=rivals[1].grid[:3])
    parts, found = normal(problem, ()), []
    for forks in (True, False):
        monkeypatch.setattr("hand_model.background._forks", lambda forks=forks: forks)
        with Beside(problem, (), parts, rivals, 0) as beside:
            scores = beside.scores()
            found.append((scores, beside.together(scores)))
    for two, one in zip(*found, strict=True):
        assert [s.term.candidate.key for s in two] == [c.key for c in rivals]
        assert [s.term.shape for s in two] == [s.term.shape for s in one]
        assert all(np.array_equal(a.error, b.error) for a, b in zip(two, one, strict=True))


def slow_screw(folder: Path, period: float) -> Path:
    """A session of slow motions with a Stribeck rise and a ripple of that period [rad]."""
    random, tables = np.random.default_rng(4), []
    t = np.arange(0, 60, 0.01)
    for _ in range(5):
        motion = two_sines(random, t, 0.15)
        _, q, v, _ = motion
        rise = 0.1 * np.exp(-((v / 0.1) ** 2))
        torque = balance(motion, 0.6) + np.sign(v) * rise + 0.04 * np.sin(2 * np.pi * q / period + 0.4)
        tables.append(np.stack([t, np.round(q / 4e-4) * 4e-4, torque + 0.005 * random.standard_normal(len(t))], 1))
    return written(folder, ARM, HEAD, "torque", tables)


@pytest.mark.parametrize("period", [0.03, 0.02])
def test_a_ripple_that_comes_many_times_over_the_range_is_found(tmp_path: Path, period: float) -> None:
    """As that of a screw, or of a gear's teeth; beside a Stribeck rise that is larger."""
    findings = diagnose_rig(read_session(slow_screw(tmp_path / "s", period)))
    named = {f.effect: f for f in findings.findings}
    assert named.keys() == {"stribeck_friction", "torque_ripple"}
    ripple = {name: entry["value"] for name, entry in named["torque_ripple"].parameters.items()}
    assert ripple["period"] == pytest.approx(period, rel=1e-3)
    assert np.hypot(ripple["sine"], ripple["cosine"]) == pytest.approx(0.04, rel=0.15)


def test_no_fine_ripple_is_tried_where_none_could_be_seen(tmp_path: Path) -> None:
    fit = trusted_fit(load_rig(read_session(slow_screw(tmp_path / "s", 0.03))))[0]
    rows = [r for r in fit.rows if not r.validate]
    periods = fine_periods(fit, rows, 0.05)
    assert min(abs(p / 0.03 - 1) for p in periods) < 5e-3
    slow = np.percentile(np.concatenate([np.abs(np.diff(r.position[:: r.step])) for r in rows]), 25)
    assert 3 * slow < min(periods) and max(periods) < 0.052
    assert fine_periods(fit, rows, slow) == []
    still = [replace(r, moving=np.zeros_like(r.moving)) for r in rows]
    assert fine_periods(fit, still, 0.05) == []


@pytest.mark.parametrize(("period", "turn"), [(0.01, 0.01), (0.2, 0.0), (None, 0.0)])
def test_a_fine_ripple_is_shown_over_one_turn(period: float | None, turn: float) -> None:
    """Over the whole range its picture would be a band."""
    row = SimpleNamespace(position=np.linspace(-0.1, 0.5, 50))
    parameters = {} if period is None else {"period": {"value": period}}
    finding = SimpleNamespace(where={"joint": "slide"}, parameters=parameters)
    assert _turn(finding, [(SimpleNamespace(joint="slide", row=row), None)]) == turn
