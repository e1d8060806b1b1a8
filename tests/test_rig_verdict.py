"""What an analysis of a rig comes to where nothing has a name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_bench import ARM, Motion, balance, recorded

from hand_model.rig import diagnose_rig
from hand_model.rig.verdict import ACCURATE, accurate, unexplained, verdict
from hand_model.session import read_session

pytest.importorskip("mujoco")


def joint_lack(after: float, floor: float) -> dict[str, object]:
    return {
        "before": 1.0,
        "metric": "effort_rmse",
        "joints": {"hinge": {"before": 1.0, "after": after, "noise_floor": floor}},
    }


def test_more_than_noise_is_unexplained_unless_the_machine_is_known_so_well() -> None:
    lack = joint_lack(0.9, 0.1)
    assert verdict([], lack) == "unexplained" and len(unexplained(lack, [])) == 1
    assert verdict([], lack, {"hinge": 0.01}) == "consistent" and unexplained(lack, [], {"hinge": 0.01}) == ()
    assert verdict([], joint_lack(0.11, 0.1)) == "consistent"


@pytest.mark.parametrize(("share", "told"), [(0.007, "consistent"), (0.1, "unexplained")])
def test_a_quiet_sensor_shows_what_no_machine_is_known_to(tmp_path: Path, share: float, told: str) -> None:
    random = np.random.default_rng(2)

    def torque(motion: Motion) -> np.ndarray:
        t, clean = motion[0], balance(motion)
        phases = random.uniform(0, 6, 5)  # a hum of nobody's, other in each recording
        hum = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip((0.31, 0.47, 0.83, 1.3, 1.7), phases, strict=True))
        return clean + share * np.std(clean) * np.sqrt(2 / 5) * hum

    findings = diagnose_rig(read_session(recorded(tmp_path / "s", ARM, 6, torque, 1e-5)))
    assert (findings.verdict, [f.effect for f in findings.findings]) == (told, [])
    assert any("more than noise" in note for note in findings.notes) == (told == "consistent")


def test_what_counts_is_the_effort_of_recordings_kept_out() -> None:
    rows = [type("Row", (), {"trial": str(k), "joint": "hinge", "validate": k > 2})() for k in range(5)]
    quality = {(str(k), "hinge"): 5 * ACCURATE if k < 3 else 0.5 * ACCURATE for k in range(5)}
    fit = type("Fit", (), {"rows": rows, "quality": quality})()
    assert accurate(fit) == {"hinge": pytest.approx(0.5 * ACCURATE)}
