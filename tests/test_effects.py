"""Effects: found by the catalogue, columns that are finite and have the physics they claim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drive_motion import state

from hand_model.diagnose.locate.drive import bouts
from hand_model.effects import catalogue, effect, outsiders
from hand_model.effects.base import DriveState
from hand_model.errors import DescriptionError

STATIONS = {"drive", "encoder", "linkage", "command", "motors", "markers"}


def test_catalogue_holds_one_effect_per_name_and_station() -> None:
    names = [e.name for e in catalogue()]
    assert len(names) == len(set(names)) >= 26
    assert {e.station for e in catalogue()} == STATIONS
    for name in ("stribeck_friction", "linkage_backlash", "clock_drift", "current_channel_delay", "command_delay"):
        assert effect(name).name == name


def test_unknown_effect_names_a_near_one() -> None:
    with pytest.raises(DescriptionError, match="stribeck_friction"):
        effect("stribek_friction")


@pytest.mark.parametrize("candidate", catalogue(), ids=lambda e: e.name)
def test_columns_are_finite_and_as_many_as_amplitudes_at_every_start(candidate) -> None:
    s = state()
    for shape in candidate.grid((s,)):
        columns = candidate.columns(s, shape)
        if candidate.station in ("command", "motors"):
            continue
        assert columns.shape == (len(s.time_s), len(candidate.amplitudes()))
        assert np.isfinite(columns).all()
    for shape in candidate.shapes((s,)):
        assert shape.low < shape.high or shape.name == "trial"
        assert all(shape.low - 1e-9 <= start <= shape.high + 1e-9 for start in shape.starts), shape


@pytest.mark.parametrize(
    "name",
    [
        "stribeck_friction",
        "load_dependent_friction",
        "position_dependent_friction",
        "quadratic_damping",
        "thermal_friction_drift",
        "elastoplastic_hysteresis",
    ],
)
def test_friction_opposes_motion(name: str) -> None:
    s, candidate = state(), effect(name)
    for shape in candidate.grid((s,))[:5]:
        power = candidate.columns(s, shape)[:, 0] * s.velocity
        assert power.sum() > 0  # over cycles friction only takes energy
        if name != "elastoplastic_hysteresis":
            assert (power > -1e-9).all()


@pytest.mark.parametrize("name", ["detent_load", "nonlinear_spring", "end_stop_contact", "torque_ripple"])
def test_loads_depend_on_position_only(name: str) -> None:
    s, candidate = state(), effect(name)
    reverse = DriveState(
        s.trial,
        s.drive,
        s.time_s,
        s.position,
        -s.velocity,
        s.acceleration,
        s.effort,
        -s.declared,
        declared_names=s.declared_names,
    )
    for shape in candidate.grid((s,))[:5]:
        np.testing.assert_allclose(candidate.columns(s, shape), candidate.columns(reverse, shape))


def test_an_obstacle_of_a_while_of_the_session_acts_in_every_recording_of_that_while_and_is_told_from_none() -> None:
    contact, one = effect("external_contact"), state()
    session = tuple(
        replace(
            one,
            extra={
                "trial_index": np.full(1200, float(i)),
                "elapsed": one.time_s + 30 * i,
                "session_s": np.full(1200, 81.6),
            },
        )
        for i in range(3)
    )
    shape = next(p for p in contact.grid(session) if p["trial"] == -1.0 and (p["since"], p["until"]) == (0.5, 1.0))
    acting = [np.any(contact.columns(s, shape)[:, 0] > 0) for s in session]
    assert acting == [False, True, True]
    assert not any(p["trial"] == -1.0 and (p["since"], p["until"]) == (0.0, 1.0) for p in contact.grid(session))


def test_a_recording_without_the_pose_of_the_hand_bears_no_weight_out() -> None:
    plain = state()
    posed = replace(plain, extra={**plain.extra, "pose_seen": np.ones(len(plain.time_s))})
    assert not effect("gravity_load").told_by(plain) and effect("gravity_load").told_by(posed)
    assert effect("stribeck_friction").told_by(plain)


def test_a_delay_is_the_one_that_answers_to_commands_tell_where_they_tell_it_well() -> None:
    delay, s = effect("current_channel_delay"), state()
    read = {"form": {"value": 0.0}, "delay": {"value": 0.05}}

    def told(late_s: float, doubt_s: float) -> tuple[DriveState, ...]:
        return (DriveState(**{**vars(s), "extra": {**s.extra, "late": np.array([late_s, doubt_s])}}),)

    entry = delay.further(told(0.062, 0.005), read)["delay"]
    assert entry["value"] == 0.062 and entry["ci95"][0] < 0.055 and entry["ci95"][1] > 0.069
    assert delay.further((s,), read) == {}  # no commands
    assert delay.further(told(0.062, 0.03), read) == {}  # told to more than a sample interval
    assert delay.further(told(0.062, 0.005), {**read, "form": {"value": 1.0}}) == {}  # a filter
    assert delay.lateness({"form": 0.0, "delay": 0.05}) == (0.05, 0.05)
    assert delay.lateness({"form": 0.0, "delay": -0.05}) == (-0.05, 0.0)
    low, high = delay.lateness({"form": 1.0, "delay": 0.05})
    assert 0 < low < high == 0.05


def test_a_drive_warms_in_motion_and_cools_at_every_rest() -> None:
    time_s = np.arange(0, 60, 0.02)
    moving = (time_s % 10 > 2) & (time_s > 4)
    warm_s, cool_s, want, cold = 12.0, 30.0, [], 1.0
    for now, step in zip(moving, np.diff(time_s, prepend=0.0), strict=True):
        cold = cold * np.exp(-step / warm_s) if now else 1 - (1 - cold) * np.exp(-step / cool_s)
        want.append(cold)
    half = len(time_s) // 2
    earlier = np.array(bouts(time_s[:half], moving[:half]))
    assert earlier.sum() == pytest.approx(time_s[half - 1])
    earlier[-1, 1] += 0.02  # until the second half begins
    late = DriveState(
        "b",
        "drive",
        time_s[half:],
        0 * time_s[half:],
        np.ones(len(time_s) - half),
        0 * time_s[half:],
        0 * time_s[half:],
        np.zeros((len(time_s) - half, 0)),
        extra={"history": earlier, "moving": moving[half:].astype(float)},
    )
    column = effect("thermal_friction_drift").columns(
        late, {"form": 1.0, "warm_up_time": warm_s, "cooling_time": cool_s}
    )[:, 0]
    np.testing.assert_allclose(column, want[half:], atol=1e-3)


@pytest.mark.parametrize(
    ("trial", "until", "acts"), [(-2.0, 0.95, False), (-1.0, 1.0, False), (-2.0, 0.7, True), (0.0, 1.0, True)]
)
def test_what_is_there_all_along_in_every_recording_is_no_obstacle(trial: float, until: float, acts: bool) -> None:
    s = state()
    s = replace(s, extra={**s.extra, "session_s": np.full(len(s.time_s), s.elapsed_s[-1])})
    columns = effect("external_contact").columns(
        s, {"trial": trial, "form": 0.0, "since": 0.0, "until": until, "begin": float(np.median(s.position))}
    )
    assert bool(columns.any()) is acts


def test_static_friction_that_no_recorded_effort_could_overcome_is_impossible() -> None:
    s = state()
    largest = float(np.abs(s.effort).max())
    stribeck = effect("stribeck_friction")
    assert stribeck.possible((s,), {"static_excess": 0.9 * largest})
    assert not stribeck.possible((s,), {"static_excess": 1.1 * largest})
    assert not stribeck.possible((), {"static_excess": 1.1 * largest})


def test_an_obstacle_apart_is_of_one_recording_and_what_it_leaves_in_the_angles_stays_that() -> None:
    states = tuple(
        replace(state(), extra={**state().extra, "trial_index": np.full(len(state().time_s), float(i))})
        for i in range(3)
    )
    for kind in (effect("external_contact"), next(e for e in outsiders("linkage") if e.name == "obstructed")):
        assert {p["trial"] for p in kind.grid(states)} >= {0.0, 1.0, 2.0, -2.0}
        apart = kind.apart()
        assert {p["trial"] for p in apart.grid(states)} == {0.0, 1.0, 2.0}
        assert (apart.name, apart.station) == (kind.name, kind.station)
    assert effect("torque_ripple").apart() is effect("torque_ripple")
