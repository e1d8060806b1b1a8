"""Slips of markers as findings."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from hand_model.diagnose.findings import Finding
from hand_model.diagnose.locate.angles import Step, _stepped
from hand_model.diagnose.locate.displacement import MarkerEffect
from hand_model.diagnose.locate.slips import displacement, turn, with_steps
from hand_model.diagnose.locate.wobble import centre_travel, wobble_amplitude


@pytest.mark.parametrize(("begin", "end"), [(10, 100), (10, 30), (None, None)])
def test_a_slip_is_as_large_as_it_is_while_it_lasts(begin: int | None, end: int | None) -> None:
    everywhere = np.zeros((100, 6, 3))  # of two markers, the second moves
    everywhere[:, 3:] = np.eye(3)
    slip = MarkerEffect("marker_slip", 1, "P1", begin, end, everywhere, 50.0, 100.0, np.array([1e-3, -2e-3, 2e-3]))
    assert displacement([slip], slip) == pytest.approx(3e-3)


def turned(about: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = angle * about / np.linalg.norm(about)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k


def test_a_support_turns_by_the_angle_of_all_its_effects_together() -> None:
    rng = np.random.default_rng(0)
    position = rng.normal(size=(1, 5, 3)) * 0.01 + np.zeros((60, 1, 1))
    body = np.array([0, 0, 1, 1, 1])
    shift = np.zeros((60, 5, 3))
    shift[:, 2:] = position[:, 2:] @ (turned(np.array([1.0, -2.0, 0.5]), 0.12) - np.eye(3)).T + 1e-3
    halves = [
        MarkerEffect("support_slip", 1, None, 20, 60, 0.5 * shift.reshape(60, 15, 1), 50.0, 100.0, np.ones(1))
        for _ in range(2)
    ]
    blocks = SimpleNamespace(body=body, position=position)
    assert turn(blocks, halves, halves[0]) == pytest.approx(0.12, rel=1e-3)


def test_a_turn_is_whole_with_what_a_small_slip_and_the_angle_took_of_it() -> None:
    """Markers cannot tell a turn about the hinge from motion: the encoder sees it as a step."""
    rng = np.random.default_rng(2)
    position = rng.normal(size=(1, 5, 3)) * 0.01 + np.zeros((60, 1, 1))
    body, axis = np.array([0, 0, 1, 1, 1]), np.array([0.0, 1.0, 0.0])
    whole, step = np.array([0.05, 0.04, -0.02]), 0.03
    seen = whole - step * axis
    shift = np.zeros((60, 5, 3))
    shift[:, 2:] = position[:, 2:] @ (turned(seen, float(np.linalg.norm(seen))) - np.eye(3)).T
    slipped = np.zeros((60, 5, 3))
    slipped[:, 4] = 2e-4
    main = MarkerEffect(
        "support_slip", 1, None, 20, 60, (shift - slipped).reshape(60, 15, 1), 900.0, 1000.0, np.ones(1)
    )
    small = MarkerEffect("marker_slip", 1, "P3", 20, 60, slipped.reshape(60, 15, 1), 15.0, 20.0, np.ones(1))
    blocks = SimpleNamespace(
        body=body,
        position=position,
        axes=np.broadcast_to(axis, (60, 1, 3)),
        record=np.zeros(60, int),
        residual=np.zeros((60, 5, 3)),
    )
    naming = SimpleNamespace(blocks=blocks, found=(main, small), believed=True)
    finger = SimpleNamespace(segments=[SimpleNamespace(name="proximal")])
    found = Finding(
        "support_slip",
        ("support_slip",),
        1.0,
        (),
        {"joint": "proximal"},
        "",
        {"turn": {"value": 0.03, "unit": "rad", "ci95": [0.027, 0.033]}},
        {},
        None,
    )
    sd = 0.002  # of what the angle tells
    told_deg = {"proximal": {"step_0": (np.rad2deg(step), np.rad2deg(sd))}}
    ((weight, told),) = with_steps([(2.0, found)], SimpleNamespace(finger=finger), naming, told_deg)
    assert told.parameters["turn"]["value"] == pytest.approx(np.linalg.norm(whole), rel=0.01)
    assert weight == pytest.approx(2.0 * told.parameters["turn"]["value"] / 0.03)
    assert np.ptp(told.parameters["turn"]["ci95"]) / 2 == pytest.approx(np.hypot(0.003, 1.96 * sd))


@pytest.mark.parametrize(
    ("wave", "amplitude"), [(lambda u: np.sin(2 * np.pi * u + 0.8), 0.04), (lambda u: np.sin(np.pi * u), 0.03)]
)
@pytest.mark.parametrize("body", [1, 2])
@pytest.mark.parametrize("with_segment", [False, True])
def test_a_wobble_is_read_whatever_another_axis_would_explain(
    wave, amplitude: float, body: int, with_segment: bool
) -> None:
    rng, u = np.random.default_rng(1), np.r_[np.linspace(0, 1, 150), np.linspace(1, 0, 150)]
    first, angle, axis = 0.9 * u, 1.3 * u, np.array([0.0, 1.0, 0.0])
    before = np.stack([turned(axis, a + 1e-9) if body == 2 else np.eye(3) for a in first])
    own = before @ np.stack([turned(axis, a + 1e-9) for a in angle])
    arms = rng.normal(size=(3, 3)) * 0.01 + [0.02, 0.0, 0.0]
    position = np.zeros((300, 6, 3))
    position[:, 3:] = np.einsum("bij,mj->bmi", own, arms)
    across = np.array([0.6, 0.0, 0.8])
    # and what a hinge's axis and the markers' places would do
    tilt = amplitude * wave(u)[:, None] * ((own if with_segment else before) @ across)
    tilt = tilt + before @ np.array([0.05, 0.0, -0.02]) + own @ np.array([-0.03, 0.0, 0.04])
    shift = np.zeros_like(position)
    shift[:, 3:] = np.cross(tilt[:, None], position[:, 3:]) + rng.normal(size=3) * 1e-3
    blocks = SimpleNamespace(
        body=np.repeat([body - 1, body], 3),
        position=position,
        angle=np.stack([first, angle][-body:], axis=1),
        axes=np.broadcast_to(axis, (300, body, 3)),
        rotation=np.concatenate([np.repeat(before[:, None], 3, 1), np.repeat(own[:, None], 3, 1)], 1),
    )
    assert wobble_amplitude(blocks, body, shift) == pytest.approx(amplitude, rel=0.02)


@pytest.mark.parametrize(
    "course",
    [
        lambda u: np.stack([u, 0 * u]),
        lambda u: np.stack([0 * u, u**2]),
        lambda u: np.stack([np.sin(np.pi * u), 1 - np.cos(np.pi * u)]) / 2,
    ],
)
@pytest.mark.parametrize("body", [1, 2])
def test_a_centre_travels_as_far_as_it_does_whatever_another_hinge_would_explain(course, body: int) -> None:
    u = np.r_[np.linspace(0, 1, 150), np.linspace(1, 0, 150)]
    first, angle, axis = 0.9 * u, 1.3 * u, np.array([0.0, 1.0, 0.0])
    before = np.stack([turned(axis, a + 1e-9) if body == 2 else np.eye(3) for a in first])
    own = before @ np.stack([turned(axis, a + 1e-9) for a in angle])
    x, z = 2e-3 * course(u)
    moved = np.einsum("bij,bj->bi", before, np.stack([x, 0 * x, z], axis=1))
    # another centre, other places of the markers
    moved = moved + before @ np.array([1e-3, 0.0, -2e-3]) + own @ np.array([-2e-3, 0.0, 1e-3])
    shift = np.zeros((300, 6, 3))
    shift[:, 3:] = moved[:, None]
    blocks = SimpleNamespace(
        body=np.repeat([body - 1, body], 3),
        position=shift,
        angle=np.stack([first, angle][-body:], axis=1),
        axes=np.broadcast_to(axis, (300, body, 3)),
        rotation=np.concatenate([np.repeat(before[:, None], 3, 1), np.repeat(own[:, None], 3, 1)], 1),
    )
    assert centre_travel(blocks, body, shift) == pytest.approx(2e-3, rel=0.03)


def test_a_step_lasts_as_long_as_its_slip() -> None:
    time_s = np.linspace(0.0, 10.0, 11)
    anew, for_good = Step(0, 4.0, 0), Step(0, 4.0, 2)
    for record, (first, second) in enumerate([(7, 7), (0, 11), (0, 11), (0, 0)]):
        columns, names = _stepped(record, time_s, (anew, for_good))
        assert names == ("step_0", "step_1") and columns.sum(axis=0).tolist() == [first, second]
