"""A drive at its limit, told by what its controller asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hand_model.diagnose.locate.ceiling import Asked, Ceiling, limit_of
from hand_model.diagnose.locate.command import BEYOND_CHANCE, CommandFacts, command_findings
from hand_model.diagnose.locate.simulated import SimulatedDrive

GAIN, SENSED, ENCODER = 22.0, 5.0, 0.08
NOISE = float(np.hypot(SENSED, GAIN * ENCODER))
Array = np.ndarray


def asked(seed: int, flows: Callable[[Array], Array] = lambda i: i, moves: int = 40, late_s: float = 0.0) -> Asked:
    """A drive that follows ramps to and fro under friction and a spring; flows: the current, of what is asked for.
    late_s: spread of the instants at which commands act beyond those that are known."""
    rng = np.random.default_rng(seed)
    parts = []
    for k in range(moves):
        speed, way = (100.0, 50.0, 20.0)[k % 3], 1 if k % 2 == 0 else -1
        t = np.arange(0.02, 90 / speed, 0.018)
        reference = (5 if way > 0 else 95) + way * speed * t
        velocity = np.full(len(t), way * speed)
        load = 34 * np.sign(velocity) + 0.15 * velocity + 0.23 * reference + 9
        behind = load / GAIN + rng.normal(0, ENCODER, len(t)) + rng.normal(0, late_s) * velocity
        parts.append(np.stack([load, behind, velocity, np.full(len(t), k)]))
    load, behind, velocity, move = np.concatenate(parts, axis=1)
    columns = np.stack([behind, velocity, velocity, np.ones(len(load))], axis=1)
    sensed = flows(load) + rng.normal(0, SENSED, len(load))
    return Asked(sensed, GAIN * behind, columns, 0 * load, 0 * load, move.astype(int))


@pytest.mark.parametrize("seed", range(5))
def test_a_drive_that_gets_what_it_asks_for_has_no_limit(seed: int) -> None:
    for late_s in (0.0, 2e-3):
        found = limit_of(asked(seed, late_s=late_s), NOISE)
        assert found is None or found.likelier < BEYOND_CHANCE


@pytest.mark.parametrize("limit", [55.0, 66.0])
def test_where_a_controller_asks_for_more_the_limit_is_told(limit: float) -> None:
    found = limit_of(asked(7, lambda i: np.clip(i, -limit, limit)), NOISE)
    assert found is not None and found.likelier > BEYOND_CHANCE
    assert found.limit == pytest.approx(limit, rel=0.03)


def test_a_reference_that_is_wrong_in_one_move_is_no_limit() -> None:
    one = asked(3)
    there = np.flatnonzero(one.move == 18)[-12:]  # fast, and where the load is largest
    one.asked[there] += 40.0
    found = limit_of(one, NOISE)
    assert found is None or found.likelier < BEYOND_CHANCE


def test_a_sensor_that_errs_otherwise_tells_no_limit() -> None:
    assert limit_of(asked(3, lambda i: i + 8 * np.sin(i / 8)), NOISE) is None
    # what still lets half of it pass is a controller, or a motion, that is read a little wrong
    assert limit_of(asked(3, lambda i: i - 0.5 * np.maximum(i - 50, 0)), NOISE) is None
    assert limit_of(asked(3, moves=2), NOISE) is None
    # nor is there a limit where more than that was seen to flow
    sensed = asked(3, lambda i: np.minimum(i, 55.0))
    sensed.sensed[:20] = 110.0
    assert limit_of(sensed, NOISE) is None


def test_a_likely_limit_is_a_finding_of_its_motor_and_an_unlikely_one_none() -> None:
    from hand_model.diagnose.locate.answers import Answers
    from hand_model.diagnose.locate.strokes import Loss

    facts = CommandFacts(Answers(np.zeros(0), np.zeros(0), 0.018), Loss(), Loss())
    for likelier, count in ((BEYOND_CHANCE + 1, 1), (BEYOND_CHANCE - 1, 0)):
        drive = SimulatedDrive("ring", 0.0, 1e-3, ceiling=Ceiling(70.0, 0.02, 0.3, likelier))
        found = command_findings({"ring": facts}, {"ring": "ring"}, {"ring": drive})
        assert [(f.effect, f.where["actuator"]) for _, f in found] == [("current_saturation", "ring")] * count
