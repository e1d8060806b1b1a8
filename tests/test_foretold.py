"""Figures read from answers, strokes and a controller foretell recordings that took no part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_ceiling import NOISE, asked

from hand_model.diagnose.locate.ceiling import foretold
from hand_model.diagnose.locate.foretold import ceiling_foretold, delay_foretold, sag_foretold
from hand_model.diagnose.locate.strokes import Stroke, ceiling

SPEEDS, VISCOUS, FRICTION, STIFF = (100.0, 60.0, 25.0), 0.15, 30.0, 0.3
JITTER = 4e-3  # of the speed of a stroke


def strokes(sag: float = 0.0, limit: float = np.inf, repeats: int = 8, seed: int = 0) -> list[Stroke]:
    """To and fro at three speeds under friction and a spring; a drive loses `sag` of its speed per raw of load, and what
    its limit [raw] does not let it draw. The last quarter of the repeats is kept out."""
    rng, out = np.random.default_rng(seed), []
    for repeat in range(repeats):
        held = repeat >= 0.75 * repeats
        for commanded in SPEEDS:
            for way in (1.0, -1.0):
                position = np.linspace(10, 90, 60) if way > 0 else np.linspace(90, 10, 60)
                needed = way * (FRICTION + VISCOUS * commanded) + STIFF * position
                flows = np.minimum(needed, limit)
                speed = commanded * (1 - sag * way * np.mean(flows)) * (1 + rng.normal(0, JITTER))
                velocity = way * speed - (needed - flows) / VISCOUS + rng.normal(0, 0.5, len(position))
                time_s = np.r_[0.0, np.cumsum(np.diff(position) / (way * speed))]
                current = flows + rng.normal(0, 2.0, len(position))
                recording = "held" if held else "learned"
                out.append(Stroke(way, commanded, time_s, position, velocity, current, recording, held))
    return out


def test_a_loss_of_speed_foretells_recordings_kept_out() -> None:
    fit = sag_foretold(strokes(sag=2e-3))
    assert fit["held_out"] == ["held"]
    assert fit["before"] > 5 * fit["noise_floor"] and fit["after"] < 1.5 * fit["noise_floor"]
    assert fit["noise_floor"] == pytest.approx(JITTER, rel=0.4)
    low, high = fit["ci95_reduction"]
    assert low <= fit["before"] - fit["after"] <= high and low > 0


def test_a_drive_that_loses_nothing_is_foretold_no_better() -> None:
    fit = sag_foretold(strokes())
    assert fit["after"] == pytest.approx(fit["before"], rel=0.3)


def test_a_limit_foretells_what_the_fastest_strokes_lose() -> None:
    limited = strokes(limit=62.0)
    assert ceiling(limited)[0] == pytest.approx(62.0, abs=1.5)
    fit = ceiling_foretold(limited)
    assert fit["held_out"] == ["held"]
    assert fit["after"] < 0.3 * fit["before"] and fit["ci95_reduction"][0] > 0


def test_without_recordings_kept_out_none_is_said_to_be() -> None:
    every = [replace(s, kept_out=False) for s in strokes(sag=2e-3)]
    assert sag_foretold(every)["held_out"] == []
    late = 0.1 + np.random.default_rng(0).normal(0, 0.01, 20)
    assert delay_foretold(late, np.zeros(20, bool), ())["held_out"] == []
    assert delay_foretold(late, np.zeros(0, bool), ())["held_out"] == []


def test_a_delay_foretells_answers_of_recordings_kept_out() -> None:
    late = 0.1 + np.random.default_rng(1).normal(0, 0.01, 40)
    fit = delay_foretold(late, np.arange(40) >= 30, ("log/b.csv",))
    assert fit["before"] == pytest.approx(0.1, rel=0.1) and fit["after"] == pytest.approx(0.01, rel=0.5)
    assert fit["noise_floor"] == pytest.approx(0.01, rel=0.4) and fit["held_out"] == ["log/b.csv"]


def test_a_limit_foretells_the_current_that_a_controller_gets() -> None:
    limited = asked(7, lambda i: np.clip(i, -55.0, 55.0))
    halves = replace(limited, kept_out=limited.move >= 0.7 * limited.move.max())
    proof = foretold(halves, NOISE, ("log/b.csv",))
    assert proof["held_out"] == ["log/b.csv"]
    assert proof["before"] > 1.1 * proof["noise_floor"] and proof["after"] < 1.1 * proof["noise_floor"]
    assert foretold(limited, NOISE, ())["held_out"] == []


def test_strokes_of_speeds_that_no_other_recording_has_foretell_nothing() -> None:
    strange = [replace(s, commanded=s.commanded + 1.0) if s.kept_out else s for s in strokes(sag=2e-3)]
    assert sag_foretold(strange)["held_out"] == []
    limited = [replace(s, commanded=s.commanded + 1.0) if s.kept_out else s for s in strokes(limit=62.0)]
    assert ceiling_foretold(limited)["held_out"] == []
