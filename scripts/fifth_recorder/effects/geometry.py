"""Joints that are not hinges, and an encoder that is not even. Angles rad, lengths m."""

import numpy as np

from fifth_recorder.effects.option import Context, Draw, Option, log_uniform, pick
from fifth_recorder.plan import Motion, Plan, Signals

JOINTS = ("proximal", "distal")


def _joint(rng: np.random.Generator) -> int:
    return int(rng.integers(2))


def joint_wobble(rng: np.random.Generator, ctx: Context) -> Option:
    """A second, smaller rotation about another axis of a joint."""
    form, _ = pick(rng, ("sine", "with_square", "locked_to_other_joint"))
    joint, size = _joint(rng), rng.uniform(0.02, 0.05)
    turns, phase = rng.uniform(0.8, 1.8), rng.uniform(0, 2 * np.pi)
    axis = np.cross(ctx.finger.axes[joint], rng.normal(size=3))
    axis /= np.linalg.norm(axis)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            own = (motion.q1 / ctx.finger.full[0], motion.q2 / ctx.finger.full[1])
            s = own[1 - joint] if form.startswith("locked") else own[joint]
            w = np.sin(2 * np.pi * turns * s + phase)
            if form == "with_square":
                w = 0.6 * w + 0.8 * (2 * s - 1.0) ** 2
            motion.wobble.append((joint, axis, strength * size * w))

        plan.pose.append(hook)
        return {"rad": size * strength, "turns": turns, "phase": phase, "axis": axis.tolist()}

    return Option(form, apply, joint=JOINTS[joint], motor=False)


def moving_centre(rng: np.random.Generator, ctx: Context) -> Option:
    """A centre of rotation that travels with the angle."""
    form, _ = pick(rng, ("straight", "arc", "cam"))
    joint, travel, turns = _joint(rng), rng.uniform(0.0012, 0.0035), rng.uniform(0.7, 1.3)
    axis = ctx.finger.axes[joint]
    first = np.cross(axis, rng.normal(size=3))
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            s = (motion.q1 / ctx.finger.full[0] if joint == 0 else motion.q2 / ctx.finger.full[1])[:, None]
            if form == "straight":
                way = s * first
            elif form == "arc":
                way = 0.5 * np.sin(3.4 * s) * first + 0.5 * (1 - np.cos(3.4 * s)) * second
            else:
                way = 0.5 * (1 - np.cos(2 * np.pi * turns * s)) * first + 0.3 * np.sin(2 * np.pi * turns * s) * second
            motion.shift[joint] = motion.shift[joint] + strength * travel * way

        plan.pose.append(hook)
        return {"travel_m": travel * strength, "direction": first.tolist(), "turns": turns}

    return Option(form, apply, joint=JOINTS[joint], motor=False)


def encoder_periodic(rng: np.random.Generator, _: Context) -> Option:
    """Encoder error periodic in counts."""
    form, number = pick(rng, ("one_harmonic", "two_harmonics"))
    size, period, phase = log_uniform(rng, 0.5, 1.4), log_uniform(rng, 5, 22), rng.uniform(0, 2 * np.pi)

    def apply(plan: Plan, strength: float) -> dict:
        low, high = plan.finger.counts

        def hook(signals: Signals) -> None:
            q = 2 * np.pi * (signals.x + 100.0 * low / (high - low)) / period + phase
            w = np.sin(q) + (0.5 * np.sin(2 * q + 0.7) if number else 0.0)
            signals.x = signals.x + size * strength * w

        plan.signals.append(hook)
        scale = (high - low) / 100.0
        return {"counts": size * strength * scale, "period_counts": period * scale, "phase": phase}

    return Option(form, apply)


GEOMETRY: dict[str, Draw] = {
    "joint_wobble": joint_wobble,
    "moving_centre": moving_centre,
    "encoder_periodic_error": encoder_periodic,
}
