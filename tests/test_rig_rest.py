"""A joint that stands between its moves: what holds it there is nobody's friction, unless a law says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rig_bench import HEAD, written

from hand_model.rig import diagnose_rig
from hand_model.rig.balance import declared_columns
from hand_model.rig.declared import fit_declared
from hand_model.rig.model import load_rig
from hand_model.rig.name.candidates import candidates
from hand_model.rig.name.problem import Term, pose, solution
from hand_model.rig.rest import Creep, moving_weight, stands
from hand_model.rig.rest_known import known_at_rest
from hand_model.rig.trial_balance import trial_rows
from hand_model.session import read_session

SLIDE = """<mujoco><option timestep="0.001" gravity="0 0 -9.81"/>
<worldbody><body name="carriage"><joint name="slide" type="slide" axis="1 0 0" damping="60" frictionloss="10"/>
<inertial pos="0 0 0" mass="20" diaginertia="1 1 1"/></body></worldbody><actuator><motor name="motor" joint="slide"/></actuator></mujoco>
"""
SLIDE_HEAD = HEAD.replace("hinge", "slide").replace("torque", "force")
MASS, DAMPING, COULOMB = 30.0, 90.0, 15.0
RATE_HZ, STEP_M = 500.0, 1e-5


def strokes(seconds: float, period_s: float, stroke_m: float) -> tuple[np.ndarray, ...]:
    """Time, position, velocity and acceleration of strokes there and back with a pause of a fifth of the period after
    each."""
    t = np.arange(0, seconds, 1 / RATE_HZ)
    phase = (t / period_s) % 1.0
    moves = 0.3 * period_s
    x = np.where(phase < 0.5, np.clip(phase / 0.3, 0, 1), np.clip((phase - 0.5) / 0.3, 0, 1))
    sign, inside = np.where(phase < 0.5, 1.0, -1.0), (x > 0) & (x < 1)
    q = stroke_m * np.where(phase < 0.5, x**3 * (10 - 15 * x + 6 * x**2), 1 - x**3 * (10 - 15 * x + 6 * x**2))
    v = sign * stroke_m * 30 * x**2 * (1 - x) ** 2 / moves * inside
    a = sign * stroke_m * 60 * x * (1 - x) * (1 - 2 * x) / moves**2 * inside
    return t, q, v, a


def session(folder: Path, hold: float, reach_m: float = 0.0) -> Path:
    """Six recordings of a slide, two of them held out, with Coulomb friction, or all of it turning round over a
    distance; hold [N]: what its drive still gives in the direction of the last stroke while it stands and friction is
    Coulomb's."""
    random, tables = np.random.default_rng(7), []
    for k in range(6):
        t, q, v, a = strokes(16.0, random.uniform(2.0, 4.0), random.uniform(0.1, 0.3))
        dry = COULOMB * np.sign(v)
        if reach_m:
            state, dry = 0.0, np.zeros(len(q))
            for n, step in enumerate(np.diff(q, prepend=q[0])):
                state = dry[n] = np.clip(state + step / reach_m, -1, 1)
            dry = COULOMB * dry
        kept = hold * np.where(q > np.median(q), 1.0, -1.0)
        force = (
            MASS * a
            + DAMPING * v
            + np.where((v == 0) & (not reach_m), kept, dry)
            + 0.05 * random.standard_normal(len(t))
        )
        tables.append(np.stack([t, np.round(q / STEP_M) * STEP_M, force], 1))
    return written(folder, SLIDE, SLIDE_HEAD, "force", tables)


def test_pauses_are_found_and_neither_slow_motion_nor_a_reversal() -> None:
    """Strokes with pauses of 0.6 s: these and nothing else; a sine has none, nor has a creep of 5 mm/s; noise changes
    nothing."""
    t, q, v, _ = strokes(12.0, 3.0, 0.2)
    random = np.random.default_rng(0)
    for seen in (np.round(q / STEP_M) * STEP_M, q + 3e-6 * random.standard_normal(len(q))):
        still = stands(seen, RATE_HZ, 10.0)
        pause, far = v == 0, np.abs(v) > 0.01
        assert still[pause].mean() > 0.95 and not still[far].any()
        weight = moving_weight(seen, RATE_HZ, 10.0, 30.0)
        assert np.all(weight[still] == 0) and weight.max() == 1 and np.abs(np.diff(weight)).max() < 0.15
    for moving in (0.2 * np.sin(2 * np.pi * 0.5 * t), 5e-3 * t):
        assert not stands(np.round(moving / STEP_M) * STEP_M, RATE_HZ, 10.0).any()
        assert len(moving_weight(moving, RATE_HZ, 10.0, 30.0)) == 0


def test_a_joint_that_dithers_in_its_pauses_stands_there_and_does_not_where_it_turns_round() -> None:
    t, q, v, _ = strokes(12.0, 3.0, 0.2)
    creep, seen = Creep(1e-2 * float(np.std(v)), 0.2), q + 5e-5 * np.sin(2 * np.pi * 0.9 * t)  # up to 0.3 mm/s
    pause, far = v == 0, np.abs(v) > 0.05
    assert stands(seen, RATE_HZ, 10.0)[pause].mean() < 0.3
    still = stands(seen, RATE_HZ, 10.0, creep)
    assert still[pause].mean() > 0.95 and not still[far].any()
    turning = 0.2 * np.sin(2 * np.pi * 0.5 * t)
    assert not stands(turning, RATE_HZ, 10.0, Creep(1e-2 * 0.44, 0.5 / (2 * np.pi * 0.5))).any()
    slow = 0.2 * np.sin(2 * np.pi * 0.05 * t)
    assert not stands(slow, RATE_HZ, 10.0, Creep(1e-2 * 0.044, 0.5 / (2 * np.pi * 0.05))).any()


def test_what_holds_a_joint_changes_nothing_of_its_balance(tmp_path: Path) -> None:
    """The same strokes held by 3 N and by 12 N: the same parameters, the true ones; with rests kept they move with the
    hold."""
    fits = {}
    for hold in (3.0, 12.0):
        rig = load_rig(read_session(session(tmp_path / str(hold), hold)))
        fits[hold] = [fit_declared(rig, (), 10.0, kept=kept).theta for kept in ((), ("slide",))]
    at = [k for k, c in enumerate(declared_columns(rig)) if not c.part or c.part == "m"]
    fits = {hold: [theta[at] for theta in each] for hold, each in fits.items()}
    for hold in fits:
        assert fits[hold][0] == pytest.approx([MASS, DAMPING, COULOMB], rel=0.01)
    assert fits[3.0][0] == pytest.approx(fits[12.0][0], rel=1e-4)
    assert fits[3.0][1] != pytest.approx(fits[12.0][1], rel=1e-3)


def test_delayed_columns_pass_the_same_weight(tmp_path: Path) -> None:
    """A recording in which all comes 10 ms later is its columns 10 ms later, beside the pauses as well."""
    rig = load_rig(read_session(session(tmp_path / "s", 0.0)))
    row = trial_rows(rig, rig.trials[0], declared_columns(rig), 10.0)[0]
    assert len(row.weight)
    early = row.filtered(row.full_columns, 0.01)
    again = replace(row, weight=np.roll(row.weight, -round(0.01 * row.rate_hz))).filtered(row.full_columns)
    shift = 0.01 * row.rate_hz / row.step
    apart = np.abs(early - np.stack([np.interp(np.arange(len(c)) - shift, np.arange(len(c)), c) for c in again.T], 1))[
        50:-50
    ]
    assert np.all(apart.max(0) <= 0.05 * np.abs(early).max(0))


def test_a_law_that_turns_round_over_a_distance_knows_what_holds(tmp_path: Path) -> None:
    """Friction that is wholly such a law explains rests as motion; Coulomb's, held anyhow, does not."""
    for name, hold, reach, known in (("dry", 6.0, 0.0, ()), ("stop", 0.0, 0.004, ("slide",))):
        rig = load_rig(read_session(session(tmp_path / name, hold, reach)))
        fit = fit_declared(rig, (), 10.0)
        stop = next(c for c in candidates(rig, fit, "slide") if c.key == "elastoplastic_hysteresis@slide")
        terms = [Term(stop, {"form": 0.0, "reach": reach})] if reach else []
        assert known_at_rest(fit, terms, solution(pose(fit), terms)) == known


@pytest.mark.slow
def test_a_healthy_slide_that_stands_between_strokes_gets_no_name(tmp_path: Path) -> None:
    """It is held by half of its friction: no Stribeck rise, nor friction by load."""
    findings = diagnose_rig(read_session(session(tmp_path / "s", 7.0)))
    assert [f.effect for f in findings.findings] == []
