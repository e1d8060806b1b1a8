"""Effects between the encoder and the markers."""

import numpy as np
from scipy.spatial.transform import Rotation

from .effect import JOINTS, Effect, Law, Settings, spread
from .kinematics import play
from .plan import Plan
from .stepper import Run

Rng = np.random.Generator


def _drive_play(give: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        width = s * spread(rng, 0.8, 2.4)
        plan.finger_steps.append(lambda x, _: play(x, width, give))
        return {"play": width, "give": give}

    return law


def _series(power: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        size, share = s * spread(rng, 0.9, 2.8), rng.uniform(0.5, 1.0)

        def step(x: np.ndarray, run: Run) -> np.ndarray:
            load = (plan.scalar("k") * x + plan.scalar("tau0") + share * run.friction) / 50
            return x - size * np.sign(load) * np.abs(load) ** power

        plan.finger_steps.append(step)
        return {"give_at_50": size, "friction_share": share, "power": power}

    return law


def _linkage_play(plan: Plan, s: float, rng: Rng) -> Settings:
    width = s * spread(rng, 0.012, 0.035)
    plan.distal_steps.append(lambda x, _: play(x, width))
    return {"linkage_play": width}


def _linkage_play_before(plan: Plan, s: float, rng: Rng) -> Settings:
    width = s * spread(rng, 0.012, 0.035)
    plan.proximal_steps.append(lambda x, _: play(x, width))
    return {"linkage_play_input": width}


def _linkage_give(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * spread(rng, 0.02, 0.055)
    plan.distal_steps.append(lambda x, run: x - size * (0.5 * run.friction + plan.scalar("k") * run.position) / 40)
    return {"give_at_40": size}


def _linkage_give_drive(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * spread(rng, 0.015, 0.04)
    plan.distal_steps.append(lambda x, run: x - size * run.current / 70)
    return {"give_at_70": size, "load": "drive"}


def _deadband(soft: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        width = s * spread(rng, 0.1, 0.28)

        def step(x: np.ndarray, _: object) -> np.ndarray:
            full = plan.finger.angle_full[0]
            over = x / full - width
            over = np.clip(over, 0, None) if soft <= 0 else soft * np.logaddexp(0, over / soft)
            return full * over / (1 - width)

        plan.proximal_steps.append(step)
        return {"deadband": width, "softness": soft}

    return law


def _distal_stop(soft: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        at = plan.finger.angle_full[1] * (1 - s * spread(rng, 0.07, 0.2))

        def step(x: np.ndarray, _: object) -> np.ndarray:
            return np.minimum(x, at) if soft <= 0 else at - soft * np.logaddexp(0, (at - x) / soft)

        plan.distal_steps.append(step)
        return {"stops_at": at, "softness": soft}

    return law


def _wobble(plan: Plan, s: float, rng: Rng) -> Settings:
    joint, size, turns = int(rng.integers(2)), s * spread(rng, 0.012, 0.035), rng.uniform(0.8, 2.0)
    phase = rng.uniform(0, 2 * np.pi)
    full = plan.finger.angle_full[joint]
    plan.wobbles.append((joint, lambda angle, _: size * np.sin(2 * np.pi * turns * angle / full + phase)))
    return {"joint": JOINTS[joint], "rad": size, "turns": turns}


def _wobble_by_load(plan: Plan, s: float, rng: Rng) -> Settings:
    joint, size = int(rng.integers(2)), s * spread(rng, 0.012, 0.03)
    plan.wobbles.append((joint, lambda _, run: size * run.friction / plan.finger.motor["Fc"]))
    return {"joint": JOINTS[joint], "rad": size, "follows": "load"}


def _rolling(shape: str) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        joint = int(rng.integers(2))
        way = Rotation.from_rotvec(rng.uniform(0, 2 * np.pi) * plan.finger.axes[joint]).apply([1.0, 0.0, 0.0])
        size = s * (spread(rng, 4.0, 10.0) if shape == "rolling" else spread(rng, 0.7, 1.8))
        travel = (lambda r: r**2) if shape == "rolling" else (lambda r: np.sin(2 * np.pi * r))
        plan.shifts.append((joint, lambda r: size * travel(r)[:, None] * way))
        return {"joint": JOINTS[joint], "mm": size, "shape": shape}

    return law


EFFECTS = (
    Effect("drive_backlash", "markers", "proximal", (_drive_play(0.0), _drive_play(0.8))),
    Effect("series_elasticity", "markers", "proximal", (_series(1.0), _series(1.6))),
    Effect("linkage_backlash", "markers", "distal", (_linkage_play, _linkage_play_before)),
    Effect("linkage_compliance", "markers", "distal", (_linkage_give, _linkage_give_drive)),
    Effect("coupling_deadband", "markers", "distal", (_deadband(0.0), _deadband(0.015))),
    Effect("distal_stop", "markers", "distal", (_distal_stop(0.0), _distal_stop(0.02))),
    Effect("joint_wobble", "markers", "proximal", (_wobble, _wobble_by_load)),
    Effect("moving_centre", "markers", "proximal", (_rolling("rolling"), _rolling("cam"))),
)
