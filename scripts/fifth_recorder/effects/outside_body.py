"""Things that no row of the table describes: in the finger, its markers and the clocks. Angles rad, lengths m."""

import numpy as np

from fifth_recorder.effects.option import Context, Draw, Option
from fifth_recorder.plan import Frames, Motion, Plan, Rows, Signals, Trial


def tooth_skip(rng: np.random.Generator, _: Context) -> Option:
    """The gear skips a tooth once: from then on the finger stands elsewhere for the same counts."""
    angle, share, first = rng.choice([-1, 1]) * rng.uniform(0.015, 0.035), rng.uniform(0.3, 0.7), int(rng.integers(2))

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            moved = (
                np.where(motion.t > share * motion.trial.end, 1.0, 0.0)
                if motion.trial.index == first
                else float(motion.trial.index > first)
            )
            motion.q1 = motion.q1 + strength * angle * moved

        plan.proximal.append(hook)
        return {"rad": angle * strength, "at_share": share}

    return Option("once", apply, joint="proximal")


def tendon_stretches(rng: np.random.Generator, _: Context) -> Option:
    """A tendon gets longer with every full stroke and does not recover."""
    angle = rng.uniform(0.004, 0.008)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(motion.s)))]) / 2.0
            motion.q1 = motion.q1 - strength * angle * way

        plan.proximal.append(hook)
        return {"rad_per_cycle": angle * strength}

    return Option("per_stroke", apply, joint="proximal")


def lost_counts(rng: np.random.Generator, _: Context) -> Option:
    """The encoder loses counts at some moments, all in one direction."""
    size, shares = rng.uniform(0.8, 1.6), np.sort(rng.uniform(0.2, 0.9, 2))

    def apply(plan: Plan, strength: float) -> dict:
        def hook(signals: Signals) -> None:
            signals.x = signals.x - strength * size * sum(signals.t > q * signals.t[-1] for q in shares)

        plan.signals.append(hook)
        return {"percent_of_range": size * strength, "at_share": shares.tolist()}

    return Option("two_losses", apply)


def stale_position(rng: np.random.Generator, _: Context) -> Option:
    """A part of the rows repeats the position of the row before."""
    share = rng.uniform(0.25, 0.5)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(rows: Rows) -> None:
            old = rows.trial.rng(51).random(len(rows.time)) < min(share * strength, 0.9)
            fresh = np.maximum.accumulate(np.where(old, 0, np.arange(len(old))))
            rows.position = rows.position[fresh]

        plan.rows.append(hook)
        return {"share": min(share * strength, 0.9)}

    return Option("stale", apply)


def clock_steps(rng: np.random.Generator, _: Context) -> Option:
    """The log's clock is set forward once in every trial."""
    step, share = rng.choice([-1, 1]) * rng.uniform(0.04, 0.1), rng.uniform(0.3, 0.7)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(rows: Rows) -> None:
            moved = rows.time + strength * step * (rows.time > share * rows.trial.end)
            for i in range(1, len(moved)):  # a log's times never fall
                moved[i] = max(moved[i], moved[i - 1] + 1e-3)
            rows.time = moved

        plan.rows.append(hook)
        return {"seconds": step * strength, "at_share": share}

    return Option("step", apply)


def dropped_frames(rng: np.random.Generator, _: Context) -> Option:
    """The cameras lose frames and nobody leaves a gap for them: the file's time runs short."""
    each, times = rng.uniform(0.02, 0.06), int(rng.integers(2, 5))

    def apply(plan: Plan, strength: float) -> dict:
        def hook(trial: Trial, t: np.ndarray) -> np.ndarray:
            shares = np.sort(trial.rng(52).uniform(0.15, 0.85, times))
            late = sum((t > q * trial.end).astype(float) for q in shares) * each * strength
            return t + np.round(late * plan.lab.mocap_rate) / plan.lab.mocap_rate

        plan.frames.append(hook)
        return {"seconds": each * strength, "times": times}

    return Option("no_gap_left", apply, motor=False)


def soft_tissue(rng: np.random.Generator, ctx: Context) -> Option:
    """The glove under the markers moves with flexion: one marker slides on its segment to and fro."""
    joint, marker = int(rng.integers(2)), int(rng.integers(3))
    way = rng.normal(size=3)
    way *= rng.uniform(0.001, 0.002) / np.linalg.norm(way)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(frames: Frames) -> None:
            s = frames.q1 / ctx.finger.full[0]
            frames.points[:, 3 + 3 * joint + marker] += (
                strength * s[:, None] * ((frames.turn1, frames.turn2)[joint] @ way)
            )

        plan.markers.append(hook)
        return {"vector_m": (way * strength).tolist()}

    return Option(
        "with_flexion",
        apply,
        joint=("proximal", "distal")[joint],
        marker=ctx.finger.labels[3 * joint + marker],
        motor=False,
    )


def palm_flexes(rng: np.random.Generator, _: Context) -> Option:
    """The palm itself gives under the finger's load, and a palm marker with it."""
    marker, way = int(rng.integers(3)), rng.normal(size=3)
    way *= rng.uniform(0.0008, 0.0016) / np.linalg.norm(way)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(frames: Frames) -> None:
            frames.points[:, marker] += strength * frames.load[:, None] / 30.0 * way

        plan.markers.append(hook)
        return {"m_per_30_raw": (way * strength).tolist()}

    return Option("with_load", apply, marker=("PO", "PM", "PL")[marker], motor=False)


def merged_markers(rng: np.random.Generator, ctx: Context) -> Option:
    """Two markers run into one for the cameras while the finger is bent: both are seen between the two."""
    joint, pair = int(rng.integers(2)), rng.choice(3, 2, replace=False)
    at = rng.uniform(0.55, 0.8)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(frames: Frames) -> None:
            i = 3 + 3 * joint + pair
            bent = (frames.q1 > at * ctx.finger.full[0])[:, None, None]
            middle = frames.points[:, i].mean(1, keepdims=True)
            frames.points[:, i] += min(0.12 * strength, 1.0) * bent * (middle - frames.points[:, i])

        plan.world.append(hook)
        return {
            "share": min(0.12 * strength, 1.0),
            "above_share": at,
            "other_marker": ctx.finger.labels[3 * joint + pair[1]],
        }

    return Option(
        "drawn_together",
        apply,
        joint=("proximal", "distal")[joint],
        marker=ctx.finger.labels[3 * joint + pair[0]],
        motor=False,
    )


def reflections(rng: np.random.Generator, ctx: Context) -> Option:
    """One marker glitters: it jumps by a millimetre or two in short spells."""
    which, size, every = int(rng.integers(6)), rng.uniform(0.0008, 0.002), rng.uniform(1.0, 3.0)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(frames: Frames) -> None:
            r = frames.trial.rng(53)
            for at in r.uniform(0, frames.t[-1], r.poisson(frames.t[-1] / every)):
                span = np.flatnonzero((frames.t >= at) & (frames.t < at + 0.3))
                frames.points[span, 3 + which] += strength * size * r.normal(0, 1, (len(span), 3))

        plan.world.append(hook)
        return {"m": size * strength, "every_s": every}

    return Option("spells", apply, marker=ctx.finger.labels[which], motor=False)


def finger_tremor(rng: np.random.Generator, _: Context) -> Option:
    """The finger shakes on its joint at some hertz while the encoder stands still."""
    f, size = rng.uniform(5, 11), rng.uniform(0.008, 0.016)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            motion.q1 = motion.q1 + strength * size * np.sin(2 * np.pi * f * motion.t)

        plan.proximal.append(hook)
        return {"rad": size * strength, "hz": f}

    return Option("shakes", apply, joint="proximal")


OUTSIDE_BODY: dict[str, Draw] = {
    "tooth_skip": tooth_skip,
    "tendon_stretches": tendon_stretches,
    "lost_encoder_counts": lost_counts,
    "stale_position": stale_position,
    "clock_steps": clock_steps,
    "dropped_mocap_frames": dropped_frames,
    "soft_tissue_motion": soft_tissue,
    "palm_flexes": palm_flexes,
    "merged_markers": merged_markers,
    "reflection_spells": reflections,
    "finger_tremor": finger_tremor,
}
