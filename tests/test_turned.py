"""A support that turned about its joint's own axis, told by the joint before it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drive_motion import to_and_fro

from hand_model.diagnose.locate.turned import turned_finding, turned_support
from hand_model.effects.base import DriveState

STEP_DEG, SHARE = -0.8, 0.42


def joint(seed: int, added: str = "none", noise_deg: float = 0.25) -> DriveState:
    """A follower's angle [deg] against its driver's, whose strokes scatter, with something added or nothing."""
    state, random = to_and_fro(seed, 10, 4.0), np.random.default_rng(100 + seed)
    x = state.position / 100
    share = (state.time_s - state.time_s[0]) / np.ptp(state.time_s)
    strokes = np.repeat(0.05 * random.standard_normal(200), 50)[: len(x)]
    angle = 60 * x + 8 * x**2 + strokes + noise_deg * random.standard_normal(len(x)) + 0.2 * np.sign(state.velocity)
    angle += {
        "none": 0 * share,
        "step": STEP_DEG * (share > SHARE),
        "late": STEP_DEG * (share > (SHARE if seed == 2 else 2 if seed < 2 else -1)),
        "while": STEP_DEG * ((share > SHARE) & (share < 0.7)),
        "drift": 2 * STEP_DEG * share,
        "obstacle": 6 * STEP_DEG * np.maximum(x - 0.5, 0.0) * (share < 0.65) * (seed == 1),
        "obstacle of each": 6 * STEP_DEG * np.maximum(x - 0.4, 0.0) * (share > 0.3),
    }[added]
    powers = np.stack([x**k for k in range(5)], 1)
    clocks = np.zeros((len(x), 3))
    clocks[:, seed - 1] = state.velocity  # each recording's own
    return replace(
        state,
        trial=f"log/{seed}.csv",
        effort=angle,
        declared=np.c_[powers, clocks],
        declared_names=(*(f"power_{k}" for k in range(5)), *(f"offset_{k}" for k in range(3))),
        extra={"trial_index": np.full(len(x), float(seed - 1))},
        validate=seed == 3,
    )


@pytest.mark.parametrize("added, begins", [("step", [0, 1, 2]), ("late", [1, 2])])
def test_a_step_that_stays_is_a_turned_support(added: str, begins: list[int]) -> None:
    states = [joint(k, added) for k in (1, 2, 3)]
    turned = turned_support(states)
    assert turned is not None
    assert turned.step_deg == pytest.approx(STEP_DEG, abs=0.1)
    assert [s.record for s in turned.steps] == begins
    at = turned.steps[0].time_s - states[begins[0]].time_s[0]
    assert at == pytest.approx(SHARE * np.ptp(states[begins[0]].time_s), abs=0.4)
    weight, finding = turned_finding(turned, "index", "distal")
    assert (finding.effect, finding.where["joint"], finding.where["signal"]) == ("support_slip", "distal", "markers")
    low, high = finding.parameters["turn"]["ci95"]
    assert low < np.deg2rad(abs(STEP_DEG)) < high
    assert finding.fit["held_out"] == ["log/3.csv"] and finding.fit["after"] < 0.7 * finding.fit["before"] < 1.0
    assert weight > 0


@pytest.mark.parametrize("added", ["none", "while", "drift", "obstacle", "obstacle of each"])
def test_nothing_else_is(added: str) -> None:
    assert turned_support([joint(k, added) for k in (1, 2, 3)]) is None


def test_where_the_driver_steps_too_it_is_not_the_follower_s_support() -> None:
    states = [joint(k, "step") for k in (1, 2, 3)]
    assert turned_support(states, [joint(k, "step") for k in (1, 2, 3)]) is None
    assert turned_support(states, [joint(k) for k in (1, 2, 3)]) is not None
    assert turned_support([]) is None
