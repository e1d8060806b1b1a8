"""A motor-driven pendulum as a rig session, with another mass than declared, and an effect or none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rig_bench import HEAD

PENDULUM = """<mujoco model="rig">
  <compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
  <worldbody><body name="arm">
    <joint name="hinge" axis="0 -1 0" damping="0.02" frictionloss="0.05"/>
    <inertial pos="0 0 -0.2" mass="0.5" diaginertia="0.002 0.002 0.0001"/></body></worldbody>
  <actuator><motor name="motor" joint="hinge"/></actuator></mujoco>
"""
MASS, LEVER, INERTIA = 0.6, 0.2, 0.6 * 0.04 + 0.002


def planted(folder: Path, effect: str = "none", trials: int = 4, seconds: float = 12.0) -> Path:
    """A pendulum moved along sums of sinusoids; its torque by the true balance (mass 0.6, not 0.5), with an effect or
    none."""
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(PENDULUM)
    text, random = HEAD, np.random.default_rng(3)
    for k in range(trials):
        t = np.arange(0, seconds, 0.005)
        w = 2 * np.pi * np.array([0.31, 0.83]) * (1 + 0.13 * k)
        size, phase = np.array([0.7, 0.35]) * random.uniform(0.7, 1.3, 2), random.uniform(0, 6, 2)
        q, v, a = (
            sum(f(s, w_, t, p) for s, w_, p in zip(size, w, phase, strict=True))
            for f in (
                lambda s, w_, t, p: s * np.sin(w_ * t + p),
                lambda s, w_, t, p: s * w_ * np.cos(w_ * t + p),
                lambda s, w_, t, p: -s * w_**2 * np.sin(w_ * t + p),
            )
        )
        load = INERTIA * a + MASS * LEVER * 9.81 * np.sin(q)
        torque = load + 0.03 * v + 0.08 * np.sign(v)
        torque += {
            "stribeck": 0.06 * np.exp(-((v / 0.4) ** 2)) * np.sign(v),
            "none": 0 * t,
            "load": 0.25 * np.abs(load) * np.sign(v),
            "drag": 0.02 * v * np.abs(v),
            "offset": 0 * t + 0.15,
            "command": 0 * t,
            "dead": 0 * t,
            "unsigned": 0 * t,
        }[effect]
        torque = {"command": 0.5 * np.sin(2.1 * t), "dead": 0 * t + 0.3, "unsigned": np.abs(torque)}.get(effect, torque)
        noise = 0 if effect in ("command", "dead") else 0.01
        table = np.stack([t, np.round(q / 4e-4) * 4e-4, torque + noise * random.standard_normal(len(t))], 1)
        name = f"log/run_{k}.csv"
        np.savetxt(folder / name, table, delimiter=",", header="time,position,torque", comments="", fmt="%.9g")
        text += f'[[trial]]\nkind = "motion"\nlog = "{name}"\n' + ('purpose = "validate"\n' if k == trials - 1 else "")
    (folder / "session.toml").write_text(text)
    return folder
