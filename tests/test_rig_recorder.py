"""The recorder of simulated machines: known motions, what sticks, and starts that a log with uneven stamps tells."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from hand_model.rig.states import low_pass, recorded_states

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from rig_recorder.compose import make_set
from rig_recorder.law import Law
from rig_recorder.moves import cycles, follow, play
from rig_recorder.record import Logger
from rig_recorder.steps import Drive, one_joint


def test_a_small_swing_has_its_period_and_dry_friction_takes_four_of_its_levels_a_period() -> None:
    """Period 2 pi sqrt(I / w); amplitude falls by 4 F / w in each (Coulomb friction, exact for a spring)."""
    law = Law(0.02, 0.5, coulomb=5e-4)
    period = 2 * np.pi * np.sqrt(0.02 / 0.5)
    track = one_joint(law, Drive(0.0), play(np.zeros(9000)), 4.2 * period, (0.1, 0.0), np.random.default_rng(0))
    q = track.position[:, 0]
    top = [float(np.max(q[np.abs(track.time_s - k * period) < 0.2 * period])) for k in range(5)]
    assert np.diff(top) == pytest.approx(-4 * 5e-4 / 0.5, rel=0.03)


def test_a_joint_sticks_below_its_friction() -> None:
    """A drive that asks for less than dry friction moves nothing."""
    track = one_joint(
        Law(0.02, coulomb=0.1), Drive(), play(np.full(1100, 0.09)), 1.0, (0.3, 0.0), np.random.default_rng(0)
    )
    assert np.all(track.position == 0.3)


def test_uneven_stamps_do_not_hide_the_noise_of_a_coarse_encoder() -> None:
    """A pendulum let go at rest, 4096 steps a turn, stamps uneven: its start is at rest to what the encoder can
    tell."""
    random, speeds = np.random.default_rng(1), []
    # a line between samples makes -0.56, 0.36 and -0.29 of these
    for rate_hz, angle in ((300.0, 1.5), (1000.0, 0.4), (1000.0, 0.95)):
        logger = Logger(rate_hz, 0.05, 0.0, 0.0, 4096 / 2 / np.pi, 0.0, 1.0)
        track = one_joint(Law(0.02, 0.5), Drive(0.0), play(np.zeros(4000)), 3.0, (angle, 0.0), random)
        at, stamps = logger.times(3.0, random)
        speeds.append(recorded_states(stamps, logger.position(at, track.time_s, track.position[:, 0]))[2][0])
    assert np.max(np.abs(speeds)) < 0.2  # [rad/s]; of 2 to 7 in the swing


def test_a_set_is_the_same_for_a_seed_and_says_nothing_in_its_sessions(tmp_path: Path) -> None:
    """Same seed (one that begins with a drive of several stages), same answers; a session holds its model, its logs and
    its manifest alone."""
    one, two = (make_set(tmp_path / name, 2, 1) for name in ("a", "b"))
    assert one == two
    names = {p.name for p in (tmp_path / "a" / "rig_00").iterdir()}
    assert names == {"session.toml", "rig.xml", "log"}


@pytest.mark.parametrize(("rate_hz", "late_s"), [(250.0, 6.5e-4), (333.0, 3e-4), (500.0, 6.5e-4), (1000.0, 6.5e-4)])
def test_a_held_torque_comes_late_in_a_log(rate_hz: float, late_s: float) -> None:
    """Inertia and damping alone, no channel late and no noise: the shift of the effort at which they explain it best is
    what `rig_trial` takes for there, since a value holds for a millisecond and a log that keeps step with it reads it
    at the end."""
    law, stiff = Law(60.0, viscous=80.0), 60.0 * (2 * np.pi * 12) ** 2
    track = one_joint(
        law,
        Drive(),
        follow(cycles(6, 0.0, 0.3, 2, 0.25), stiff, 1.2 * stiff / (2 * np.pi * 12), 1e5),
        6.0,
        (0.0, 0.0),
        np.random.default_rng(0),
    )
    at = np.arange(1, int(5.9 * rate_hz)) / rate_hz
    filtered = lambda x: low_pass(x, rate_hz, 20.0)
    velocity = np.gradient(np.interp(at, track.time_s, track.position[:, 0]), at)
    columns = np.stack([filtered(np.gradient(velocity, at)), filtered(velocity)], 1)
    effort, shifts = np.interp(at, track.time_s, track.effort[:, 0]), np.arange(-5e-4, 2e-3, 5e-5)
    left = [np.linalg.lstsq(columns, filtered(np.interp(at + s, at, effort)))[1][0] for s in shifts]
    assert shifts[int(np.argmin(left))] == pytest.approx(late_s, abs=1.5e-4)
