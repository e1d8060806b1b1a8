"""The band in which a balance is weighed: wide enough for what is narrow in position and passes fast."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_bench import ARM, Motion, balance, recorded

from hand_model.rig import diagnose_rig, fit_declared, load_rig
from hand_model.rig.declared import _beside_places
from hand_model.session import read_session

pytest.importorskip("mujoco")
PERIOD, SIZE = 0.15, 0.12  # [rad], [N m]


def rippling(motion: Motion) -> np.ndarray:
    """Torque [N m] with a ripple that passes up to twenty times a second."""
    return balance(motion) + SIZE * np.sin(2 * np.pi * motion[1] / PERIOD)


def test_a_ripple_that_passes_fast_widens_the_band_and_is_read(tmp_path: Path) -> None:
    session = read_session(recorded(tmp_path / "s", ARM, 6, rippling, 0.02))
    assert fit_declared(load_rig(session)).cutoff_hz >= 12.0
    found = diagnose_rig(session).findings
    assert [f.effect for f in found] == ["torque_ripple"]
    assert np.hypot(*(found[0].parameters[k]["value"] for k in ("sine", "cosine"))) == pytest.approx(SIZE, rel=0.1)
    assert found[0].parameters["period"]["value"] == pytest.approx(PERIOD, rel=0.01)


def test_what_recordings_share_by_place_is_taken_out_and_noise_is_not() -> None:
    random = np.random.default_rng(0)
    places = [random.uniform(0, 1, 4000) for _ in range(3)]
    shared = [np.sin(2 * np.pi * p / 0.02) for p in places]
    noise = [random.standard_normal(len(p)) for p in places]
    assert np.std(np.concatenate(_beside_places(places, shared))) < 0.3
    assert np.array_equal(np.concatenate(_beside_places(places, noise)), np.concatenate(noise))
    assert _beside_places(places[:1], shared[:1])[0] is shared[0]  # one alone shares nothing
