"""What a rig makes of rounded, thinned and passive recordings: the noise of coarse encoders, slopes, weights as the
scale."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from hand_model.rig import diagnose_rig, load_rig
from hand_model.rig.diagnose import trusted_fit
from hand_model.rig.states import differentiate, noise_std
from hand_model.session import read_session

LINKS = """<mujoco><compiler angle="radian"/><option timestep="0.0005" integrator="RK4" gravity="0 0 -9.81"/>
<worldbody><body name="upper"><joint name="one" axis="0 -1 0" damping="2e-5" frictionloss="2e-4"/>
<inertial pos="0 0 -0.11" mass="{upper}" diaginertia="4e-4 4e-4 1e-5"/>
<body name="lower" pos="0 0 -0.17"><joint name="two" axis="0 -1 0" damping="2e-5" frictionloss="1e-4"/>
<inertial pos="0 0 -0.12" mass="{lower}" diaginertia="6e-4 6e-4 1e-5"/></body></body></worldbody></mujoco>"""
SIGNALS = 'one = "joint:one:position"\ntwo = "joint:two:position"\n'


def swings(folder: Path, drag: float, step: float, upper: float = 0.094, lower: float = 0.138) -> Path:
    """Four swings of a passive double pendulum (the last held out) with drag [N m s^2/rad^2] at both joints, as an
    encoder of that step [rad] reads them at 1 kHz; upper, lower: masses [kg] that are declared."""
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(LINKS.format(upper=upper, lower=lower))
    text = f'format = "hand-session/1"\n[hand]\nname = "swings"\n[rig]\nmodel = "rig.xml"\n[signals]\n{SIGNALS}'
    model, random = mujoco.MjModel.from_xml_string(LINKS.format(upper=0.094, lower=0.138)), np.random.default_rng(0)
    for k in range(4):
        data = mujoco.MjData(model)
        data.qpos[:] = random.uniform(-1.8, 1.8, 2)
        rows = np.zeros((12_000, 3))
        for row in rows:
            row[:] = data.time, *np.round(data.qpos / step) * step
            for _ in range(2):
                data.qfrc_applied[:] = -drag * data.qvel * np.abs(data.qvel)
                mujoco.mj_step(model, data)
        np.savetxt(folder / f"log/{k}.csv", rows, delimiter=",", header="time,one,two", comments="", fmt="%.7f")
        text += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n' + ('purpose = "validate"\n' if k == 3 else "")
    (folder / "session.toml").write_text(text)
    return folder


@pytest.mark.parametrize("step", [1e-4, 1.57e-4, 1e-3, 6e-3])
@pytest.mark.parametrize("size", [0.05, 0.3, 1.5])
def test_the_noise_of_an_encoder_is_that_of_its_rounding(step: float, size: float) -> None:
    """Within 3 % of step / sqrt(12), fast or slow; with white noise as large as a step beside it, of both together
    within 10 %."""
    t = np.arange(0, 20, 1e-3)
    q = size * np.sin(2 * np.pi * 0.8 * t) * np.exp(-t / 20)
    rounded = np.round(q / step) * step
    for stamps in (None, t):
        assert noise_std(rounded, stamps) == pytest.approx(step / np.sqrt(12), rel=0.03)
    noisy = np.round((q + step * np.random.default_rng(0).standard_normal(len(t))) / step) * step
    assert noise_std(noisy) == pytest.approx(step * np.sqrt(1 + 1 / 12), rel=0.1)


def test_slopes_of_what_is_resolved_lose_nothing() -> None:
    """A sine at a tenth of the sampling rate: slope and acceleration within 0.1 % away from the ends; a jump that no
    filter has seen does not ring."""
    t = np.arange(0, 2, 0.01)
    turn = 2 * np.pi * 10
    v = differentiate(np.sin(turn * t), 100.0)
    assert v[10:-10] == pytest.approx(turn * np.cos(turn * t)[10:-10], abs=1e-3 * turn)
    assert differentiate(v, 100.0)[10:-10] == pytest.approx(-(turn**2) * np.sin(turn * t)[10:-10], abs=2e-3 * turn**2)
    assert np.all(differentiate((t > 1).astype(float), 100.0, resolved=False) >= 0)


@pytest.mark.slow
def test_drag_of_a_passive_double_pendulum(tmp_path: Path) -> None:
    """Behind coarse encoders drag is named at the lower joint and nothing else anywhere; where there is none, nothing
    is, and the model leaves what the encoders' noise is."""
    found = diagnose_rig(read_session(swings(tmp_path / "drag", 5e-5, 1.5e-3)))
    assert {f.effect for f in found.findings} == {"quadratic_damping"}
    assert "two" in {f.where["joint"] for f in found.findings}
    healthy = diagnose_rig(read_session(swings(tmp_path / "none", 0.0, 1.5e-3)))
    assert healthy.verdict == "consistent" and not healthy.findings
    for proof in healthy.lack_of_fit["joints"].values():
        assert proof["before"] == pytest.approx(proof["noise_floor"], rel=0.2)


def test_one_weight_is_the_scale_of_what_nothing_drives(tmp_path: Path) -> None:
    """Masses that are declared wrong by a tenth each, in opposite ways: their ratio is found, the heavier one's weight
    is kept."""
    fit = trusted_fit(load_rig(read_session(swings(tmp_path / "s", 0.0, 1e-4, 0.094 * 1.1, 0.138 / 1.1))))[0]
    theta = {c.label: t for c, t in zip(fit.columns, fit.theta, strict=True)}
    assert theta["inertial:lower:hz"] == pytest.approx(-0.138 / 1.1 * 0.12, rel=1e-3)
    assert theta["inertial:upper:hz"] == pytest.approx(-0.094 / 1.1 * 0.11, rel=0.02)
