"""Currents that read nothing below a threshold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drive_motion import TO_AND_FRO, to_and_fro

from hand_model.diagnose.locate.drive import dead_in, frozen_share
from hand_model.diagnose.locate.measurement import beyond, coefficients, dead_zone, frozen
from hand_model.diagnose.name.selection import name_effects
from hand_model.effects import effect
from hand_model.effects.base import DriveState
from hand_model.effects.current_saturation import PILED
from hand_model.effects.pile_up import piled_up


def drive(seed: int) -> DriveState:
    """A motor that goes to and fro over its range, read in whole raw units."""
    state = to_and_fro(seed, 15, 3.0)
    return replace(state, effort=np.round(state.effort))


def dead_below(zone: float) -> tuple[DriveState, ...]:
    """Recordings whose current reads zero below a threshold [raw]."""
    return tuple(
        replace(s, effort=np.where(np.abs(s.effort) < zone, 0.0, s.effort)) for s in (drive(1), drive(2), drive(3))
    )


def test_a_current_that_reads_zero_below_a_threshold_is_read_beyond_it_alone() -> None:
    zone, states = 12.0, dead_below(12.0)
    assert dead_zone(states) == pytest.approx(zone, abs=1.0)
    read = beyond(states, dead_zone(states))
    effort, declared = (np.concatenate([getattr(s, k) for s in read]) for k in ("effort", "declared"))
    known = np.isfinite(effort)
    assert known.any() and np.abs(effort[known]).min() >= zone - 3
    assert coefficients(declared[known], effort[known]) == pytest.approx(TO_AND_FRO, rel=0.1, abs=0.05)


def test_a_current_that_is_read_one_way_alone_is_not_read() -> None:
    states = dead_below(25.0)  # opening takes less than 26 raw
    assert dead_zone(states) == pytest.approx(25.0, abs=1.0) and beyond(states, 25.0) == ()


def test_a_current_that_is_read_all_along_has_no_dead_zone() -> None:
    states = (drive(1), drive(2))
    coarse = tuple(replace(s, effort=10.0 * np.round(s.effort / 10.0)) for s in states)
    assert dead_zone(states) == dead_zone(coarse) == 0.0


@pytest.mark.parametrize(("longest", "times"), [(0.3, 1), (0.03, 10)])
def test_a_current_that_stands_still_on_end_is_dead_and_one_that_is_read_late_now_and_then_is_not(
    longest: float, times: int
) -> None:
    state = to_and_fro(1, 15, 3.0)
    moving, effort = np.abs(state.velocity) > 0.5, np.array(state.effort)
    for begin in np.linspace(0, len(effort) * (1 - longest), times).astype(int):
        effort[begin : begin + int(longest * len(effort))] = effort[begin]
    extra = {**state.extra, "moving": moving.astype(float), "frozen": frozen(effort, moving).astype(float)}
    state = replace(state, effort=effort, extra=extra, trial="flexion_index")
    assert frozen_share([state]) == pytest.approx(0.3, abs=0.05)
    assert dead_in([state]) == (("flexion_index",) if times == 1 else ())


def loud(seed: int, limit: float = np.inf) -> DriveState:
    """The motor of `drive`, its reading as loud as the current of a small amplifier, clipped at a limit [raw]."""
    state = to_and_fro(seed, 15, 3.0)
    noise = np.random.default_rng(100 + seed).normal(0, 6.0, len(state.effort))
    return replace(state, effort=np.round(np.minimum(state.effort + noise, limit)), trial=f"flexion_{seed}")


def test_readings_that_pile_up_at_the_largest_clip_there_however_few_they_are() -> None:
    states = [loud(seed) for seed in range(1, 4)]
    top = float(np.quantile(np.concatenate([s.effort for s in states]), 0.98))
    clipped = tuple(loud(seed, top) for seed in range(1, 4))
    assert piled_up([s.effort for s in clipped]) > PILED
    assert max(piled_up([sign * s.effort for s in states]) for sign in (1, -1)) < PILED
    assert piled_up([-s.effort for s in clipped]) < PILED  # at the other end nothing clips
    (named,) = name_effects(clipped, [effect("current_saturation").among(clipped)]).found
    figures = named.term.effect.parameters(named.term.shape, named.amplitudes, {})
    assert figures["limit"] == np.round(top) and named.term.effect.told_otherwise(clipped, named.term.shape)
    assert not name_effects(clipped, [effect("current_saturation")]).found  # the balance alone does not see it


def test_a_channel_whose_noise_it_does_not_resolve_does_not_pile_up() -> None:
    coarse = [10.0 * np.round(s.effort / 10.0) for s in (loud(1), loud(2))]
    still = [np.minimum(s.effort, 20.0) for s in (drive(1), drive(2))]
    level = np.concatenate([drive(1).effort, 90.0 + np.random.default_rng(0).integers(0, 2, 300)])  # said, not read
    assert piled_up([level + np.random.default_rng(1).integers(-5, 6, len(level)) * (level < 90)]) < PILED
    assert piled_up(coarse) == piled_up(still) == piled_up([np.zeros(5), np.full(5, np.nan)]) == 0.0
