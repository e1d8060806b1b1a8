"""Keyframes, and ten seconds of random control."""

from __future__ import annotations

import numpy as np

from ..description import Description, Model
from ..engines import mujoco as engine
from ..engines.ours import load
from .finding import Finding

RANDOM_S = 10.0
HOLD_S = 0.25
EXACT = 1e-12  # rad


def keyframes(description: Description, model: Model) -> Finding:
    """`open` and `close` are there, and every keyframe satisfies every equality and every limit."""
    mj = engine.load(model.mjcf).mj
    names = [mj.key(i).name for i in range(mj.nkey)]
    problems = [f'no keyframe "{name}"' for name in ("open", "close") if name not in names]
    worst = 0.0
    for i, name in enumerate(names):
        qpos = mj.key_qpos[i]
        gap = float(np.abs(engine.on_linkages(mj, qpos) - qpos).max())
        worst = max(worst, gap)
        if gap > EXACT:
            problems.append(f'"{name}" misses an equality by {np.degrees(gap):.2g} deg')
        for j in range(mj.njnt):
            low, high = mj.jnt_range[j]
            if mj.jnt_limited[j] and not low - EXACT <= qpos[mj.jnt_qposadr[j]] <= high + EXACT:
                problems.append(f'"{name}" puts "{mj.joint(j).name}" outside its limits')
    said = "; ".join(problems[:5]) or f"{', '.join(names)}: on every equality to {worst:.1g} rad, within every limit"
    return Finding(f"keyframes: {model.stem}", not problems, worst, said)


def contact_free(description: Description, model: Model) -> Finding:
    """Nothing touches at rest or at any keyframe."""
    import mujoco

    mj = engine.load(model.mjcf).mj
    data = mujoco.MjData(mj)
    problems = []
    for i in range(-1, mj.nkey):
        mujoco.mj_resetData(mj, data) if i < 0 else mujoco.mj_resetDataKeyframe(mj, data, i)
        mujoco.mj_forward(mj, data)
        for contact in data.contact:
            one, two = (mj.body(mj.geom_bodyid[g]).name for g in contact.geom)
            problems.append(f'"{one}" touches "{two}" at {mj.key(i).name if i >= 0 else "rest"}')
    said = "; ".join(problems[:5]) or f"nothing touches at rest or at {mj.nkey} keyframes"
    return Finding(f"contact: {model.stem}", not problems, float(len(problems)), said)


def quiet(description: Description, model: Model) -> Finding:
    """Ten seconds of random controls (each held for a quarter of a second) raise no warning and leave no joint far
    outside its range."""
    import mujoco

    mj = engine.load(model.mjcf).mj
    data, random = mujoco.MjData(mj), np.random.default_rng(0)
    if mj.nkey:
        mujoco.mj_resetDataKeyframe(mj, data, 0)
    low, high = mj.actuator_ctrlrange.T if mj.nu else (np.zeros(0), np.zeros(0))
    beyond, hold = 0.0, max(1, round(HOLD_S / mj.opt.timestep))
    own = {mj.joint(name).id for name in load(model.mjcf).joints}  # a motor's own joint is in other units
    limited = np.array([j for j in range(mj.njnt) if mj.jnt_limited[j] and j in own], int)
    with engine.divergence():
        for step in range(round(RANDOM_S / mj.opt.timestep)):
            if step % hold == 0:
                data.ctrl[:] = random.uniform(low, high)
            mujoco.mj_step(mj, data)
            angle = data.qpos[mj.jnt_qposadr[limited]]
            out = np.maximum(mj.jnt_range[limited, 0] - angle, angle - mj.jnt_range[limited, 1])
            beyond = max(beyond, float(out.max(initial=0.0)))
    warnings = engine.raised(data)
    passed = bool(not warnings and beyond < 0.2 and np.isfinite(data.qpos).all())
    said = (
        f"{RANDOM_S:.0f} s of random control: {', '.join(warnings) or 'no warning'}, "
        f"at most {np.degrees(beyond):.2g} deg beyond a limit"
    )
    return Finding(f"quiet: {model.stem}", passed, float(np.degrees(beyond)), said)
