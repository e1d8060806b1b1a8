"""A drive's motion between the samples of its log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from hand_model.diagnose.locate.motion import (
    Motion,
    estimate_motion,
    lasting_errors,
    least_error,
    local_quadratic,
    position_at,
    standing_at_turns,
    sure_acceleration,
    told_between,
)
from hand_model.session import between_rows


def strokes(time_s: np.ndarray, acceleration: float = 900.0, speed: float = 110.0) -> np.ndarray:
    """Position [%] that goes there and back in trapezoids of velocity, a rest before and after each."""
    fine = np.arange(0.0, time_s[-1] + 1e-3, 1e-3)
    wanted = speed * (((fine % 4.0) > 1.0) & ((fine % 4.0) < 1.8)) - speed * (
        ((fine % 4.0) > 2.8) & ((fine % 4.0) < 3.6)
    )
    velocity = np.zeros_like(fine)
    for i in range(1, len(fine)):
        velocity[i] = velocity[i - 1] + np.clip(wanted[i] - velocity[i - 1], -acceleration * 1e-3, acceleration * 1e-3)
    return np.interp(time_s, fine, np.cumsum(velocity) * 1e-3)


def stamps(seed: int, step_s: float = 0.028, until_s: float = 60.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.cumsum(step_s * rng.uniform(0.6, 1.4, int(until_s / step_s)))


def test_a_slow_log_is_not_taken_for_a_segment_that_swings() -> None:
    at = stamps(1)
    then = np.arange(at[0], at[-1], 1 / 120)
    motion = estimate_motion(at, strokes(at))
    acceleration = np.interp(then, at, motion.acceleration)
    off = strokes(then) - position_at(motion, at, then), strokes(then) - np.interp(then, at, motion.position)
    following, smeared = (abs(np.polyfit(acceleration, e, 1)[0]) for e in off)
    assert following < 0.15 * smeared
    assert np.abs(off[0]).max() < 0.6 * np.abs(off[1]).max()


def test_a_drive_that_turns_round_between_two_samples_stands_there() -> None:
    at = np.arange(0.0, 6.0, 0.014)
    there_and_back = 100 * np.abs((at / 1.5) % 2 - 1)  # at full speed to the turn
    motion = standing_at_turns(estimate_motion(at, there_and_back), at)
    turns = np.flatnonzero(np.diff(np.sign(motion.velocity)) != 0)
    assert len(turns) == 3 and not motion.moving[turns].any() and not motion.moving[turns + 1].any()
    assert motion.moving.mean() > 0.9 and np.isfinite(motion.until_stop_s[turns[0] - 10])


def test_a_position_is_quieter_where_nothing_bends_it_and_keeps_its_corners() -> None:
    at = stamps(7, 0.012)
    noise = np.random.default_rng(8).normal(0, 0.08, len(at))
    motion = estimate_motion(at, strokes(at) + noise)
    again = local_quadratic(at, motion.position, motion.bandwidth_s)[0]
    narrow, quiet = (x - strokes(at) for x in (2 * motion.position - again, position_at(motion, at, at)))
    bent = np.abs(np.gradient(np.gradient(strokes(at), at), at)) > 100.0
    far = np.convolve(bent, np.ones(31), mode="same") == 0
    assert far.sum() > 1000 and np.std(quiet[far]) < 0.65 * np.std(narrow[far])
    assert np.sqrt(np.mean(quiet[bent] ** 2)) < 1.05 * np.sqrt(np.mean(narrow[bent] ** 2))


def test_noise_of_the_position_is_not_found_again_with_the_acceleration() -> None:
    at = stamps(2)
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 0.08, len(at))
    motion = estimate_motion(at, strokes(at, 300.0) + noise)
    sure = sure_acceleration(motion)
    wrong = position_at(motion, at, at) - strokes(at, 300.0)
    steady = np.abs(np.gradient(np.gradient(strokes(at, 300.0), at), at)) < 1.0
    assert np.corrcoef(wrong[steady], motion.acceleration[steady])[0, 1] < -0.25  # else this test tells nothing
    assert np.mean(sure[steady] == 0) > 0.95
    fast = np.abs(motion.acceleration) > 200.0
    assert fast.sum() > 20
    assert np.all(np.abs(sure[fast]) > 0.75 * np.abs(motion.acceleration[fast]))


def test_noise_of_the_position_takes_nothing_off_a_motor_s_inertia() -> None:
    """As a column with an error of its own it would: what starts and stops then lack looks like a bent spring."""
    at = stamps(4, 0.009)
    clean = np.where(at < 8.0, strokes(at, 850.0, 95.0), strokes(at, 850.0, 15.0))  # fast ones set the kernel
    exact = estimate_motion(at, clean)
    noisy = clean + np.random.default_rng(5).normal(0, 0.05, len(at))
    effort = 0.014 * exact.acceleration + 0.15 * exact.velocity + 35 * np.sign(exact.velocity) + 0.2 * exact.position
    motion = estimate_motion(at, noisy)
    use = motion.moving & (motion.since_start_s > 0.03) & (motion.until_stop_s > 0.03)

    def inertia(acceleration: np.ndarray) -> float:
        columns = np.stack([acceleration, motion.velocity, np.sign(motion.velocity), motion.position], axis=-1)[use]
        return float(np.linalg.lstsq(columns, effort[use], rcond=None)[0][0])

    as_narrow_as_velocity = local_quadratic(at, noisy, motion.bandwidth_s)[2]
    assert inertia(as_narrow_as_velocity) < 0.8 * 0.014  # else this test tells nothing
    assert abs(inertia(sure_acceleration(motion)) / 0.014 - 1) < 0.15


def test_a_smooth_controller_s_inertia_is_not_lost_to_the_noise_of_the_encoder() -> None:
    """Minimum jerk (Flash & Hogan 1985) at 100 rows a second: a narrow kernel makes 117 %/s^2 of noise beside 250, of
    which next to nothing is sure."""
    at = stamps(7, 0.01)
    u = np.clip(at % 2.0 - 0.4, 0.0, 1.3) / 1.3
    way = np.where(at % 4.0 < 2.0, 1.0, -1.0)
    position = 40.0 - 40.0 * way + 80.0 * way * (10 * u**3 - 15 * u**4 + 6 * u**5)
    acceleration = 80.0 * way / 1.3**2 * (60 * u - 180 * u**2 + 120 * u**3)
    noisy = position + np.random.default_rng(8).normal(0, 0.07, len(at))
    motion = estimate_motion(at, noisy)
    narrow = replace(
        motion,
        acceleration=local_quadratic(at, noisy, motion.bandwidth_s)[2],
        acceleration_noise=117.0,
    )

    def slope(motion: Motion) -> float:
        sure = sure_acceleration(motion)[motion.moving]
        return float(sure @ acceleration[motion.moving] / (sure @ sure))

    assert slope(narrow) < 0.6  # else this test tells nothing
    assert abs(slope(motion) - 1) < 0.1


def test_where_rows_of_a_log_were_lost_nobody_knows_the_motion() -> None:
    at = np.delete(stamps(9, 0.013), np.s_[100:112])
    then = np.linspace(at[0] - 0.1, at[-1] + 0.1, 5000)
    known = between_rows(at, then)
    inside = (then > at[0]) & (then < at[-1])
    lost = (then > at[99]) & (then < at[100])
    assert lost.any()
    assert np.array_equal(known, inside & ~lost)
    packets = (np.arange(300) // 3) * 0.1 + (np.arange(300) % 3) * 1e-3  # rows that come in threes
    assert between_rows(packets, np.linspace(0.01, packets[-1] - 0.01, 500)).all()


def test_a_drive_may_have_stopped_where_rows_were_lost() -> None:
    at = stamps(10, 0.013)
    stop = int(np.searchsorted(at, 9.4))  # in full motion, which ends and goes back before rows are logged again
    lost = np.delete(at, np.s_[stop : stop + 110])
    motion = estimate_motion(lost, strokes(lost))
    assert strokes(lost)[stop] > strokes(lost)[0] + 10
    assert motion.since_start_s[stop] == 0.0
    assert motion.until_stop_s[stop - 1] == 0.0
    assert motion.since_start_s[stop + 3] < 0.1


@pytest.mark.parametrize(("uneven", "attenuated"), [(True, False), (False, True)])
def test_times_that_are_known_less_well_than_told_do_not_take_the_acceleration_away(
    uneven: bool, attenuated: bool
) -> None:
    """Rows every 8 ms, read 2 ms off at random, in moves between rests: fast positions err by more than the encoder
    does, and an error of a regressor takes its square off what is regressed on it (Fuller 1987)."""
    rng = np.random.default_rng(0)
    t = np.arange(0, 12, 0.008)
    read, rate = t + rng.normal(0, 0.002, len(t)), 2 * np.pi * 1.1
    turned, moving = (np.minimum(x % 3.0, 1 / 1.1) * rate for x in (read, t)), t % 3.0 < 1 / 1.1
    position, true = (wave * np.cos(turn) for wave, turn in zip((-25.0, 25.0 * rate**2), turned, strict=True))
    found = estimate_motion(t, position + rng.normal(0, 0.03, len(t)), uneven=uneven).acceleration[moving]
    slope = float(true[moving] @ found / (found @ found))
    assert (slope < 0.8) == attenuated and (0.93 < slope < 1.1) == (not attenuated)


@pytest.mark.parametrize("rate_hz", [100.0, 240.0])
def test_noise_that_lasts_is_no_departure(rate_hz: float) -> None:
    at = np.arange(0.0, 40.0, 1 / rate_hz)
    calm = at % 4.0 < 1.5
    slow = 0.3 * np.sin(2 * np.pi * at / 20.0)
    white, lasting = np.random.default_rng(6).normal(0, 1.0, (2, len(at)))
    lasting = lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], lasting)
    noisy = slow + 0.3 * (np.sqrt(0.7) * white + np.sqrt(0.3) * lasting)
    alike = lasting_errors(at, noisy, calm)[1]
    off, followed = (np.std(least_error(at, noisy, *a)[0] - slow) for a in ((alike,), ()))
    assert off < 0.6 * followed
    assert not len(lasting_errors(at, slow + 0.3 * white, calm)[1])  # of white noise a calm spell tells nothing further


def test_noise_of_which_little_lasts_is_told_by_many_neighbours() -> None:
    at = np.arange(0.0, 100.0, 1 / 120.0)
    white, lasting = np.random.default_rng(6).normal(0, 1.0, (2, len(at)))
    lasting = lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], lasting)
    jumping = 5.0 * (at % 30.0 > 29.0)  # a finger that jumps off its drive
    variance, alike = lasting_errors(
        at, np.sqrt(0.9) * white + np.sqrt(0.1) * lasting + jumping, np.ones(len(at), bool)
    )
    assert variance == pytest.approx(1.0, rel=0.1)
    assert np.mean(alike[:6]) == pytest.approx(np.mean(0.1 * 0.9 ** np.arange(1, 7)), rel=0.35)


def few_rows(rate_hz: float) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Of a log of strokes: where its rows tell the position, times of strokes' beginnings and ends apart; the largest
    error there is, and the largest of what is told [%]."""
    rng = np.random.default_rng(3)
    fine = np.arange(0.0, 60.0, 5e-3)
    truth = strokes(fine)
    rows = np.arange(1.0, 60.0 * rate_hz - 1) / rate_hz
    rows = rows + rng.uniform(-0.1, 0.1, len(rows)) / rate_hz
    position = np.interp(rows, fine, truth) + 0.1 * rng.standard_normal(len(rows))
    motion = estimate_motion(rows, position)
    within = (fine > rows[4]) & (fine < rows[-5])
    told = told_between(motion, rows, position, fine)[within]
    error = np.abs(position_at(motion, rows, fine) - truth)[within]
    turns = np.any([np.abs(fine[within] % 4.0 - t) < 0.25 for t in (1.0, 1.8, 2.8, 3.6)], axis=0)
    return told, turns, float(error.max()), float(np.percentile(error[told], 99.5))


def test_few_rows_do_not_tell_how_a_stroke_begins() -> None:
    told, turns, worst, left = few_rows(11.0)
    assert told[~turns].mean() > 0.85
    assert told[turns].mean() < 0.4
    assert worst > 1.0
    assert left < 0.6 * worst


def test_rows_that_follow_a_stroke_tell_all_of_it() -> None:
    told, _, worst, _ = few_rows(80.0)
    assert told.mean() > 0.98
    assert worst < 0.6
