"""Two encoders along a transmission: plays that a load crosses, and polynomials that a narrow range does not tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_bench import RIG, written

from hand_model.rig import load_rig
from hand_model.rig.couplings import coupling_terms
from hand_model.rig.transmission import angle_residual, last_pushed
from hand_model.session import read_session

pytest.importorskip("mujoco")

MODEL = """<mujoco><compiler angle="radian"/><worldbody>
<body><joint name="horn"/><inertial pos="0 0 0" mass="0.01" diaginertia="1e-4 1e-4 1e-4"/></body>
<body><joint name="lever"/><inertial pos="0 0 0" mass="0.01" diaginertia="1e-4 1e-4 1e-4"/></body></worldbody>
<equality><joint name="spline" joint1="lever" joint2="horn" polycoef="0.02 1 0 0 0"/></equality>
<actuator><position name="horn" joint="horn" kp="10"/></actuator></mujoco>
"""
HEAD = (
    RIG
    + """position = "joint:horn:position"
lever = "joint:lever:position"
setpoint = "actuator:horn:setpoint"
"""
)
HALF_GAP = 0.0115


def bench(folder: Path, half_gap: float, centres: tuple[float, ...]) -> Path:
    """A servo holds a lever [rad] on a horn with play while it is pulled to either side; the fifth recording validates."""
    random, tables, steps = np.random.default_rng(2), [], 2 * np.pi / 4096
    t = np.arange(0, 60, 0.05)
    for centre in centres:
        pull = np.interp(t, np.arange(0, 61, 3), random.choice([-0.6, -0.3, 0.0, 0.3, 0.6], 21))
        horn = centre + pull / 10
        side = np.sign(pull) * (np.abs(pull) > 0.02)
        side = side[np.maximum.accumulate(np.where(side != 0, np.arange(len(t)), 0))]
        lever = 0.02 + horn + half_gap * side
        tables.append(
            np.c_[t, np.round(horn / steps) * steps, np.round(lever / steps) * steps, np.full(len(t), centre)]
        )
    return written(folder, MODEL, HEAD, "lever,setpoint", tables)


def test_a_play_that_the_load_crosses_while_the_drive_holds_is_found(tmp_path: Path) -> None:
    rig = load_rig(read_session(bench(tmp_path / "s", HALF_GAP, (0.0, 0.0, 0.15, 0.15, 0.15))))
    fit, terms, *_ = coupling_terms(rig, rig.couplings[0])
    assert [t.candidate.effect for t in terms][:1] == ["drive_backlash"]
    assert "load at horn" in terms[0].candidate.variant
    left = angle_residual(rig, rig.couplings[0], fit, terms)
    assert np.sqrt(np.mean(left.after**2)) < 0.3 * np.sqrt(np.mean(left.before**2))


def test_no_play_is_found_where_none_is(tmp_path: Path) -> None:
    rig = load_rig(read_session(bench(tmp_path / "s", 0.0, (0.0, 0.0, 0.15, 0.15, 0.15))))
    assert coupling_terms(rig, rig.couplings[0])[1] == ()


def test_powers_that_a_narrow_range_does_not_tell_stay_as_declared(tmp_path: Path) -> None:
    # two recordings lie far outside of what the others tell
    rig = load_rig(read_session(bench(tmp_path / "s", HALF_GAP, (0.0, 0.0, 0.5, 0.0, 1.2))))
    fit = coupling_terms(rig, rig.couplings[0])[0]
    assert fit.theta[1] == pytest.approx(1.0, abs=0.2) and not fit.theta[3:].any()


def test_the_side_to_which_a_load_last_pushed() -> None:
    load = np.array([0.0, 0.1, 2.0, 0.5, -0.5, -2.0, 0.0, 0.9, 1.1])
    assert last_pushed(load, 1.0).tolist() == [1, 1, 1, 1, 1, -1, -1, -1, 1]
    assert not last_pushed(load, 5.0).any()
