"""An arm on a bench, as a rig session: one hinge with a motor, moved in two sines at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
<worldbody><body name="arm"><joint name="hinge" axis="0 -1 0" damping="0.02" frictionloss="0.05"/>
<inertial pos="0 0 -0.2" mass="0.5" diaginertia="0.002 0.002 0.0002"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>
"""
RIG = """format = "hand-session/1"
[hand]
name = "bench"
[rig]
model = "rig.xml"
[signals]
"""
HEAD = (
    RIG
    + """position = "joint:hinge:position"
torque = "actuator:motor:force"
"""
)
Motion = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # time [s], angle [rad], velocity, acceleration


def two_sines(random: np.random.Generator, t: np.ndarray, faster: float = 1.0) -> Motion:
    """A motion [rad] of a slow sine and a small faster one."""
    rate, size = 2 * np.pi * random.uniform([0.2, 0.6], [0.45, 1.2]), random.uniform([0.5, 0.15], [0.9, 0.3])
    rate = rate * faster
    phase = np.outer(rate, t) + random.uniform(0, 6, 2)[:, None]
    return t, size @ np.sin(phase), (size * rate) @ np.cos(phase), -(size * rate**2) @ np.sin(phase)


def balance(motion: Motion, mass: float = 0.5) -> np.ndarray:
    """Torque [N m] of the arm, as declared or with another mass [kg]."""
    _, q, v, a = motion
    return (0.002 + mass * 0.04) * a + mass * 0.2 * 9.81 * np.sin(q) + 0.02 * v + 0.05 * np.sign(v)


def recorded(
    folder: Path, arm: str, count: int, torque: Callable[[Motion], np.ndarray], noise: float, last: float = 1.0
) -> Path:
    """A session of `count` recordings, those after the fourth held out; torque [N m] of a motion, noise [N m]; last:
    times as fast the fourth of them."""
    random, tables = np.random.default_rng(4), []
    t = np.arange(0, 12, 0.004)
    for k in range(count):
        motion = two_sines(random, t, last if k == 3 else 1.0)
        q, noisy = motion[1], torque(motion) + noise * random.standard_normal(len(t))
        tables.append(np.stack([t, np.round(q / 4e-4) * 4e-4, noisy], 1))
    return written(folder, arm, HEAD, "torque", tables)


def written(folder: Path, model: str, head: str, effort: str, tables: Sequence[np.ndarray]) -> Path:
    """A session of recordings (n, k) of time, position and an effort of that name (or several columns, with commas between),
    those after the fourth held out."""
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(model)
    text = head
    for k, table in enumerate(tables):
        np.savetxt(
            folder / f"log/{k}.csv", table, delimiter=",", header=f"time,position,{effort}", comments="", fmt="%.8g"
        )
        text += f'[[trial]]\nkind = "motion"\nlog = "log/{k}.csv"\n' + ('purpose = "validate"\n' if k > 3 else "")
    (folder / "session.toml").write_text(text)
    return folder
