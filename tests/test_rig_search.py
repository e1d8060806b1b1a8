"""The search in a rig's balance: noise that is no mismatch, friction that turns round over a distance, delays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_bench import ARM, Motion, recorded

from hand_model.effects.path import jenkins, lugre
from hand_model.rig import diagnose_rig, load_rig
from hand_model.rig.diagnose import trusted_fit
from hand_model.rig.laws import BRISTLES, TURNING
from hand_model.rig.name.added import Added
from hand_model.rig.name.beside import score
from hand_model.rig.name.candidates import candidates
from hand_model.rig.name.compete import _settled_down, borne_out, compete, splits
from hand_model.rig.name.problem import Term, extended, normal, pose, training_error
from hand_model.rig.name.refit import in_other_forms
from hand_model.session import read_session


def bench(folder: Path, by_load: float, noise: float, late: float = 0.0, last: float = 1.0) -> Path:
    """Six recordings of two sines each, the last two held out; by_load: friction per load, which turns round over 0.1
    rad;
    noise [N m] of the torque, which acts late [s] after it is recorded; last: times as fast the fourth of them."""

    def torque(motion: Motion) -> np.ndarray:
        t, q, v, a = motion
        load = (0.6 * 0.04 + 0.002) * a + 0.6 * 0.2 * 9.81 * np.sin(q)
        return np.interp(t + late, t, load + 0.03 * v + 0.08 * np.sign(v) + by_load * np.abs(load) * jenkins(q, 0.1))

    return recorded(folder, ARM, 6, torque, noise, last)


@pytest.mark.slow
def test_friction_by_load_that_turns_round_over_a_distance(tmp_path: Path) -> None:
    """Load-dependent friction is named first, with its size and the distance within 10 %, and leaves little of the
    mismatch."""
    found = diagnose_rig(read_session(bench(tmp_path / "s", 0.3, 0.01)))
    first = found.findings[0]
    assert first.effect == "load_dependent_friction"
    assert [first.parameters[n]["value"] for n in ("per_load", "reach")] == pytest.approx([0.3, 0.1], rel=0.1)
    assert found.lack_of_fit["one_effect"] < 0.2


def test_a_noisy_torque_is_no_mismatch(tmp_path: Path) -> None:
    """Ten percent of noise on a torque that the declared model explains: consistent, and the friction is the planted
    one."""
    session = read_session(bench(tmp_path / "s", 0.0, 0.08))
    assert diagnose_rig(session).verdict == "consistent"
    fit = trusted_fit(load_rig(session))[0]
    friction = [t for c, t in zip(fit.columns, fit.theta, strict=True) if c.kind in ("damping", "frictionloss")]
    assert friction == pytest.approx([0.03, 0.08], rel=0.1)


@pytest.mark.slow
def test_a_torque_that_acts_a_fraction_of_a_sample_late_is_a_delay_and_no_spring(tmp_path: Path) -> None:
    """Loudest in one fast recording: the delay wins, as long as it is; without it nothing does."""
    for late in (0.0, 0.0015):
        rig = load_rig(read_session(bench(tmp_path / str(late), 0.0, 0.002, late, 3.0)))
        fit = trusted_fit(rig)[0]
        terms = compete(pose(fit), candidates(rig, fit, "hinge"))[0]
        assert [t.candidate.effect for t in terms] == ["current_channel_delay"] * (late > 0)
        assert not late or terms[0].shape["delay"] == pytest.approx(-late, rel=0.1)


def test_a_form_that_made_up_for_a_later_effect_is_asked_again_beside_it(tmp_path: Path) -> None:
    """Bristles of a LuGre model: an abrupt yield stood before what they hold while slow came, and a gradual one is
    right beside it."""
    slow, ratio = 0.5, 0.6

    def torque(motion: Motion) -> np.ndarray:
        _, q, v, a = motion
        bristles = lugre(q, 0.06, 1.0 + ratio * np.exp(-((v / slow) ** 2)))
        return (0.6 * 0.04 + 0.002) * a + 0.6 * 0.2 * 9.81 * np.sin(q) + 0.03 * v + 0.2 * bristles

    rig = load_rig(read_session(recorded(tmp_path / "s", ARM, 6, torque, 1e-3)))
    fit = trusted_fit(rig)[0]
    known = {c.key: c for c in candidates(rig, fit, "hinge")}
    problem = pose(fit, "hinge")
    abrupt = Term(known["elastoplastic_hysteresis@hinge"], {"form": 0.0, "reach": 0.06})
    more = Term(
        known[f"stribeck_friction/{BRISTLES}@hinge"], {"reach": 0.06, "stribeck_speed": slow, "static_ratio": 1.0}
    )
    first, second = in_other_forms(problem, (abrupt, more))
    assert first.shape["form"] == 1.0
    assert [first.shape["reach"], second.shape["stribeck_speed"]] == pytest.approx([0.06, slow], rel=0.1)
    assert in_other_forms(problem, (first, second))[0].shape["form"] == 1.0


def test_terms_are_fitted_beside_each_other_and_leave_where_they_do_not_pay(tmp_path: Path) -> None:
    """A shape that is off finds its place beside another term; what takes nothing away goes, unless that was tried
    before."""
    rig = load_rig(read_session(bench(tmp_path / "s", 0.3, 0.01)))
    fit = trusted_fit(rig)[0]
    problem, known = pose(fit, "hinge"), {c.key: c for c in candidates(rig, fit, "hinge")}
    turning, drag = (
        next(c for k, c in known.items() if k.startswith(name))
        for name in (f"load_dependent_friction/{TURNING}", "quadratic_damping")
    )
    terms = Term(turning, {"form": 1.0, "reach": 0.3}), Term(drag, {})
    kept, stays = _settled_down(problem, terms, 0, set())
    assert [t.candidate.key for t in kept] == [turning.key] and stays == [True, False]
    assert kept[0].shape["reach"] == pytest.approx(0.1, rel=0.3)  # at the loads of the declared fit
    assert _settled_down(problem, terms, 0, {(turning.key,)})[1] == [True, True]


def test_a_column_beside_a_delay_is_late_as_all_others_are(tmp_path: Path) -> None:
    """Normal equations with one more term are those of all terms at once."""
    rig = load_rig(read_session(bench(tmp_path / "s", 0.3, 0.01, late=0.02)))
    fit = trusted_fit(rig)[0]
    known = {c.effect: c for c in candidates(rig, fit, "hinge")}
    late, drag = Term(known["current_channel_delay"], {"delay": 0.02}), Term(known["quadratic_damping"], {})
    problem = pose(fit, "hinge")
    for one, other in zip(
        extended(problem, [late], drag, normal(problem, [late])), normal(problem, [late, drag]), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def test_a_term_added_leaves_what_the_fit_of_all_leaves(tmp_path: Path) -> None:
    """Training errors of every starting shape of every candidate, beside nothing, a turning friction and a delay."""
    rig = load_rig(read_session(bench(tmp_path / "s", 0.3, 0.01, late=0.02)))
    fit = trusted_fit(rig)[0]
    every, problem = candidates(rig, fit, "hinge"), pose(fit, "hinge")
    known = {c.effect: c for c in every}
    late = Term(known["current_channel_delay"], {"delay": 0.02})
    turning = Term(known["elastoplastic_hysteresis"], {"form": 1.0, "reach": 0.1})
    for terms in ((), (turning,), (late,)):
        parts = normal(problem, terms)
        for c in every:
            several = [*terms, Term(c, c.grid[-1])]
            left = training_error(problem, several, normal(problem, several))
            assert Added(problem, terms, c, parts).errors(c.grid)[-1] == pytest.approx(left, rel=1e-7)


def test_shapes_may_move_where_they_begin(tmp_path: Path) -> None:
    """Every starting shape of every candidate lies within the bounds that it may move in: one beyond would stay."""
    rig = load_rig(read_session(bench(tmp_path / "s", 0.3, 0.01)))
    every = candidates(rig, trusted_fit(rig)[0], "hinge")
    for c in every:
        for name, shape in c.shapes.items():
            starts, slack = [g[name] for g in c.grid if name in g], 1e-9 * (shape.high - shape.low)
            assert all(shape.low - slack <= start <= shape.high + slack for start in starts), (c.key, name)
    assert sum("reach" in c.shapes for c in every) >= 3


def test_a_recording_with_a_level_of_its_own_is_not_left_out_whole(tmp_path: Path) -> None:
    """Two recordings: each is left out alone where they share all parameters, in halves and thirds where each sets its
    own friction."""
    folder = bench(tmp_path / "s", 0.3, 0.01)
    head, *trials = (path := folder / "session.toml").read_text().split("[[trial]]")
    for levels, count in (
        (("", ""), 2),
        (('set = { "joint:hinge:frictionloss" = 0.05 }\n', 'set = { "joint:hinge:frictionloss" = 0.1 }\n'), 5),
    ):
        path.write_text("[[trial]]".join([head, *(t + level for t, level in zip(trials[:2], levels, strict=True))]))
        parts = splits(pose(trusted_fit(load_rig(read_session(folder)))[0]))
        assert len(parts) == count and np.all(np.sum(parts, 0) == (1 if count == 2 else 2))


def test_a_term_of_one_recording_is_borne_out_in_every_part_of_it(tmp_path: Path) -> None:
    """Friction by load that is there all the time is; a load tied to a place that the first half alone was drawn to is
    not."""
    folder = bench(tmp_path / "s", 0.3, 0.01)
    text = (folder / "session.toml").read_text().split("[[trial]]")
    (folder / "session.toml").write_text("[[trial]]".join([text[0], text[1], text[-1]]))
    table = np.loadtxt(folder / "log/0.csv", delimiter=",", skiprows=1)
    half = len(table) // 2
    table[:half, 2] += 1.4 * np.exp(-(((table[:half, 1] - 0.1) / 0.05) ** 2))
    np.savetxt(folder / "log/0.csv", table, delimiter=",", header="time,position,torque", comments="", fmt="%.8g")
    rig = load_rig(read_session(folder))
    fit = trusted_fit(rig)[0]
    problem = pose(fit)
    assert np.all(np.sum(splits(problem), 0) == 2)  # once in halves, once in thirds
    parts = normal(problem, ())
    known = {c.key: c for c in candidates(rig, fit, "hinge")}
    planted = Term(known[f"load_dependent_friction/{TURNING}@hinge"], {"form": 0.0, "reach": 0.1})
    drawn = score(problem, (), known["detent_load@hinge"], parts)
    assert borne_out(problem, ((), parts), ((planted,), normal(problem, (planted,))))
    assert not borne_out(problem, ((), parts), ((drawn.term,), drawn.parts))
