"""Proof and report of a diagnosis: errors before and after with their interval, the page that shows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hand_model.diagnose.findings import Finding, Findings
from hand_model.diagnose.page import render
from hand_model.diagnose.prove.replays import Replay, reduction


def test_reduction_holds_the_truth_and_knows_blocks() -> None:
    rng = np.random.default_rng(1)
    blocks = [np.repeat(np.arange(30), 40)] * 2
    before = [3.0 * np.sign(rng.normal(size=30)).repeat(40) + rng.normal(0, 4, 1200) for _ in blocks]
    after = [rng.normal(0, 4, 1200) for _ in blocks]
    found = reduction(before, after, blocks)
    assert found["before"] == pytest.approx(5.0, rel=0.05)
    assert found["after"] == pytest.approx(4.0, rel=0.05)
    assert found["ci95_reduction"][0] < 1.0 < found["ci95_reduction"][1]
    assert found["ci95_reduction"][0] > 0.6


def test_reduction_of_nothing_is_no_reduction() -> None:
    rng = np.random.default_rng(2)
    blocks = [np.repeat(np.arange(30), 40)]
    found = reduction([rng.normal(0, 4, 1200)], [rng.normal(0, 4, 1200)], blocks)
    assert found["ci95_reduction"][0] < 0 < found["ci95_reduction"][1]


def _finding(**more) -> Finding:
    fit = {
        "unit": "raw",
        "before": 9.0,
        "after": 5.1,
        "noise_floor": 5.0,
        "ci95_reduction": [3.7, 4.1],
        "held_out": ["log/b.csv"],
        "engine": "mujoco: mj_inverse",
    }
    where = {"finger": "index", "joint": None, "actuator": "index", "share_of_mismatch": 0.9}
    model = {
        "native": False,
        "mjcf": None,
        "urdf": "not expressible",
        "callback": "hand_model.effects_on(model, folder)",
    }
    values = {"finding": "detent_load", "model": model, "correction": None, **more}
    return Finding(
        values["finding"],
        (values["finding"], "nonlinear_spring"),
        0.98,
        (),
        where,
        "A detent.",
        {"centre": {"value": 40.0, "unit": "%", "ci95": [39.0, 41.0]}},
        fit,
        values["model"],
        values["correction"],
    )


def test_page_says_what_where_how_sure_and_where_it_is_put_right() -> None:
    rng = np.random.default_rng(3)
    x = np.tile(np.linspace(0, 100, 400), 4)
    v = np.repeat([1.0, -1.0, 1.0, -1.0], 400)
    noise = rng.normal(0, 5, 1600)
    bell = 9 * np.exp(-0.5 * ((x - 40) / 6) ** 2)
    slip = _finding(finding="marker_slip", model=None, correction="the displacement is taken out")
    detent = _finding()
    replay = Replay(detent, x, v, noise + bell, noise, "%", "raw", 5.0, ("log/b.csv",))
    findings = Findings(
        "mismatch", {"before": 3.0, "after": 1.0, "limit": 1.2}, {}, (detent, slip), next_experiment="slower moves"
    )
    page = render(findings, (), (replay,), "a session").decode()
    for said in (
        "A detent.",
        "39 to 41",
        "3.7 to 4.1",
        "passive-force callback, hand_model.effects_on(model, folder)",
        "9 to 5.1 raw",
        "corrected copy of the session: the displacement is taken out",
        "Next experiment: slower moves",
        "nonlinear spring",
    ):
        assert said in page, said
    assert page.count("<svg") == 2


def test_every_section_with_maps_says_what_its_colours_mean() -> None:
    x, v = np.tile(np.linspace(0, 100, 400), 2), np.repeat([1.0, -1.0], 400)
    replay = Replay(_finding(), x, v, np.sin(x), np.zeros(800), "%", "raw", 5.0, ("log/b.csv",))
    for _ in range(2):  # of a second page, too
        page = render(Findings("mismatch", {}, {}, (_finding(),)), (), (replay, replay), "a session").decode()
        assert page.count("position rises") == 2


def test_moves_at_one_speed_are_one_cell_of_a_map() -> None:
    from hand_model.diagnose.page import CELLS, _means

    rng = np.random.default_rng(4)
    speed = np.concatenate([s + rng.normal(0, 0.2, 400) for s in (15.0, 30.0, 55.0, 110.0)])
    ((middle, mean),) = _means(speed, np.ones(len(speed)), rng.normal(0, 1, len(speed)))
    assert np.diff(middle).min() > 0.25 * np.ptp(speed) / CELLS
    assert len(middle) < 15
    assert np.abs(mean[np.searchsorted(middle, [14.0, 54.0])]).max() < 0.3
    ((level, _),) = _means(np.full(10, 7.0), np.ones(10), np.ones(10))  # all at one place
    assert level == pytest.approx([7.0])
    ((even, _),) = _means(np.linspace(0, 100, 4000), np.ones(4000), np.ones(4000))
    assert len(even) == CELLS


def test_a_choice_among_forms_is_no_figure_of_the_page() -> None:
    gap = replace(_finding(), parameters={"gap": {"value": 1.2, "unit": "deg"}, "form": {"value": 0.0, "unit": "1"}})
    page = render(Findings("mismatch", {}, {}, (gap,)), (), (), "a session").decode()
    assert ">gap<" in page
    assert ">form<" not in page


def test_a_page_without_channels_claims_no_residual() -> None:
    bent = {
        "where": {"finger": None, "joint": None, "actuator": "thumb", "signal": "log"},
        "share_of_mismatch": 1.0,
        "shape": "stamps",
    }
    page = render(
        Findings("unexplained", {"before": 1.0, "after": 1.0, "limit": 1.0}, {}, unexplained=(bent,)),
        (),
        (),
        "a session",
    ).decode()
    assert "thumb log: stamps" in page
    assert "residual over noise" not in page
    assert "Every channel" not in page


def test_a_refused_channel_is_in_no_copy_and_every_parameter_says_its_interval() -> None:
    refused = _finding(finding="command_as_measurement", model=None, correction="the channel is refused")
    findings = Findings("mismatch", {}, {}, (refused,))
    page = render(findings, (), (), "a session").decode()
    assert "the channel is refused" in page
    assert "corrected copy" not in page
    bare = Finding(
        "marker_swap", ("marker_swap",), 1.0, (), {}, "", {"begin": {"value": 3.0, "unit": "s"}}, {}, None, "put right"
    )
    assert bare.to_dict()["parameters"]["begin"] == {"value": 3.0, "unit": "s", "ci95": None}


def test_lengths_of_markers_are_read_in_millimetres() -> None:
    fit = {"unit": "m", "before": 2.03e-4, "after": 7.06e-5, "noise_floor": 7.06e-5, "ci95_reduction": None}
    slip = Finding(
        "marker_slip",
        ("marker_slip",),
        1.0,
        (),
        {},
        "P1: a slip.",
        {"distance": {"value": 0.00238, "unit": "m", "ci95": [0.0023, 0.0025]}},
        fit,
        None,
        "taken out",
    )
    page = render(Findings("mismatch", {}, {}, (slip, _finding())), (), (), "a session").decode()
    for said in ("0.203", "0.0706", "2.38", "2.3 to 2.5", "mm", "P1: a slip.", "A detent."):
        assert said in page, said


def test_page_of_a_consistent_session_has_no_findings() -> None:
    page = render(Findings("consistent", {}, {}, notes=("no palm markers",)), (), (), "a session").decode()
    assert "Nothing is missing" in page
    assert "no palm markers" in page
    assert "error before" not in page


def test_a_model_that_holds_an_effect_already_gets_it_once() -> None:
    from types import SimpleNamespace

    from hand_model.diagnose.prove.improve import with_effects, without_effects
    from hand_model.hand import Effect, Estimate, Hand

    def held(actuator: str, centre: float) -> Effect:
        return Effect(
            "detent_load",
            {"finger": actuator, "joint": None, "actuator": actuator},
            {"centre": Estimate(centre, None, "%", "earlier")},
        )

    fingers = tuple(SimpleNamespace(name=n) for n in ("index", "little"))
    hand = Hand("h", "left", {}, {}, fingers, 1e-4, {}, (), (held("index", 38.0), held("little", 60.0)))
    before = without_effects(hand, [_finding()])
    after = with_effects(before, [_finding()])
    assert [e.where["actuator"] for e in before.effects] == ["little"]
    assert [(e.where["actuator"], e.parameters["centre"].value) for e in after.effects] == [
        ("little", 60.0),
        ("index", 40.0),
    ]


def test_a_finding_whose_finger_the_model_lacks_is_in_no_file(tmp_path) -> None:
    from hand_model.diagnose.prove.improve import written

    told = written(tmp_path, tmp_path, _finding(), {"ring"})
    assert told == {
        "native": False,
        "mjcf": None,
        "urdf": "not expressible",
        "callback": None,
        "note": "the model has no index",
    }


def test_joints_go_where_newly_fitted_maps_take_them() -> None:
    from types import SimpleNamespace

    from hand_model.diagnose.prove.improve import as_fitted
    from hand_model.hand import Coupling, EncoderMap, Finger, Hand, Joint

    def joint(name: str, high: float) -> Joint:
        return Joint(name, np.array([0.0, 1.0, 0.0]), np.zeros(3), np.zeros((6, 6)), (0.0, high), {})

    linkage = Coupling("proximal", "distal", np.array([0.0, 0.8]), {}, {})
    maps = tuple(EncoderMap(0.0, 4000.0, np.array([0.0, high]), {}, {}) for high in (1.2, 0.96))
    finger = Finger("index", "index", (joint("proximal", 1.2), joint("distal", 0.96)), maps, (linkage,))
    declared = {"power_0": 0.0, "power_1": 80.0, "offset_0": 0.1}
    recorded = (SimpleNamespace(position=np.array([0.0, 40.0, np.nan, 96.0])),)
    fitted = SimpleNamespace(declared=declared)
    station = SimpleNamespace(
        signal="encoder",
        finger="index",
        actuator="index",
        joint="proximal",
        reading=fitted,
        naming=SimpleNamespace(balance=SimpleNamespace(states=recorded)),
    )
    hand = Hand("h", "left", {}, {}, (finger,), 1e-4, {}, (), ())
    (out,) = as_fitted(hand, [station], {"index": (0.0, 4000.0)}, lambda source: source).fingers
    reached = np.deg2rad(80.0 * 0.96)
    assert [j.range_rad for j in out.joints] == [pytest.approx((0.0, reached)), pytest.approx((0.0, 0.8 * reached))]
    declared["power_1"] = 60.0  # a model may know more of a joint than this session does
    (out,) = as_fitted(hand, [station], {"index": (0.0, 4000.0)}, lambda source: source).fingers
    assert [j.range_rad[1] for j in out.joints] == [1.2, 0.96]
