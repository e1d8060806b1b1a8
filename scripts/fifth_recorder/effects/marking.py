"""Markers that move where they are stuck, or change names. Lengths m, angles rad."""

from collections.abc import Callable

import numpy as np

from fifth_recorder.effects.option import Context, Draw, Option, pick
from fifth_recorder.plan import Frames, Plan
from fifth_recorder.simulate import turn

JOINTS = ("proximal", "distal")
PALM = ("PO", "PM", "PL")


def _since(t: np.ndarray, share: float, within: float) -> np.ndarray:
    """0 before, 1 after the moment at `share` of the trial, rising within some seconds."""
    begin = share * t[-1]
    return (t >= begin).astype(float) if within <= 0 else np.clip((t - begin) / within, 0.0, 1.0)


def _vector(rng: np.random.Generator, low: float, high: float) -> np.ndarray:
    way = rng.normal(size=3)
    return way / np.linalg.norm(way) * rng.uniform(low, high)


def _both_runs(rng: np.random.Generator) -> Callable[[Frames], tuple[bool, bool]]:
    """(whether it has moved before this trial, whether it moves in it): in each trial anew, or once and for all."""
    once = rng.random() < 0.4

    def when(frames: Frames) -> tuple[bool, bool]:
        return once and frames.trial.index > 0, not once or frames.trial.index == 0

    return when


def _course(frames: Frames, when: Callable, share: float, within: float) -> np.ndarray:
    before, now = when(frames)
    if before:
        return np.ones(len(frames.t))
    return _since(frames.t, share, within) if now else np.zeros(len(frames.t))


def marker_slip(rng: np.random.Generator, ctx: Context) -> Option:
    """One marker of a segment moves and stays."""
    form, _ = pick(rng, ("palm_frame_sudden", "segment_frame_sudden", "segment_frame_within_a_second"))
    joint, marker, share = int(rng.integers(2)), int(rng.integers(3)), rng.uniform(0.25, 0.7)
    within, way, when = (1.0 if form.endswith("second") else 0.0), _vector(rng, 0.0008, 0.002), _both_runs(rng)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(frames: Frames) -> None:
            step = np.broadcast_to(way, (len(frames.t), 3))
            if form.startswith("segment"):
                step = (frames.turn1, frames.turn2)[joint] @ way
            frames.points[:, 3 + 3 * joint + marker] += strength * _course(frames, when, share, within)[:, None] * step

        plan.markers.append(hook)
        return {"vector_m": (way * strength).tolist(), "at_share": share}

    return Option(form, apply, joint=JOINTS[joint], marker=ctx.finger.labels[3 * joint + marker], motor=False)


def support_slip(rng: np.random.Generator, _: Context) -> Option:
    """A whole marker support turns on its segment."""
    form, _ = pick(rng, ("sudden", "within_two_seconds", "about_the_finger"))
    joint, share, angle, when = int(rng.integers(2)), rng.uniform(0.25, 0.7), rng.uniform(0.02, 0.06), _both_runs(rng)
    within = rng.uniform(0.6, 2.0) if form == "within_two_seconds" else 0.2
    axis = rng.normal(size=3) if form != "about_the_finger" else np.array([1.0, 0.0, 0.0]) + rng.normal(0, 0.2, 3)
    axis /= np.linalg.norm(axis)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(frames: Frames) -> None:
            three = frames.points[:, 3 + 3 * joint : 6 + 3 * joint]
            r = (frames.turn1, frames.turn2)[joint]
            w = r @ turn(axis, strength * angle * _course(frames, when, share, within)) @ r.transpose(0, 2, 1)
            foot = three.mean(1, keepdims=True) - 0.015 * r[:, None, :, 2]  # where the support stands
            frames.points[:, 3 + 3 * joint : 6 + 3 * joint] = foot + np.einsum("tij,tnj->tni", w, three - foot)

        plan.markers.append(hook)
        return {"rad": angle * strength, "axis": axis.tolist(), "at_share": share}

    return Option(form, apply, joint=JOINTS[joint], motor=False)


def palm_marker_slip(rng: np.random.Generator, _: Context) -> Option:
    """A palm marker moves and stays."""
    form, _ = pick(rng, ("sudden", "within_a_second"))
    marker, share, way, when = (
        int(rng.integers(3)),
        rng.uniform(0.25, 0.7),
        _vector(rng, 0.0008, 0.002),
        _both_runs(rng),
    )

    def apply(plan: Plan, strength: float) -> dict:
        def hook(frames: Frames) -> None:
            course = _course(frames, when, share, 0.0 if form == "sudden" else 1.0)
            frames.points[:, marker] += strength * course[:, None] * way

        plan.markers.append(hook)
        return {"vector_m": (way * strength).tolist(), "at_share": share}

    return Option(form, apply, marker=PALM[marker], motor=False)


def marker_swap(rng: np.random.Generator, ctx: Context) -> Option:
    """Two labels are exchanged for a while. The strength multiplies the time."""
    form, _ = pick(rng, ("same_segment", "across_segments", "several_times"))
    joint = int(rng.integers(2))
    one, two = rng.choice(3, 2, replace=False)
    first, second = (3 + one, 6 + two) if form == "across_segments" else (3 + 3 * joint + one, 3 + 3 * joint + two)
    times, length = (3 if form == "several_times" else 1), rng.uniform(0.4, 2.0)
    begins = np.sort(rng.uniform(0.15, 0.85, times))

    def apply(plan: Plan, strength: float) -> dict:
        def hook(frames: Frames) -> None:
            for begin in begins:
                span = (frames.t >= begin * frames.t[-1]) & (frames.t < begin * frames.t[-1] + length * strength)
                frames.points[np.ix_(span, [first, second])] = frames.points[np.ix_(span, [second, first])]

        plan.world.append(hook)
        return {
            "other_marker": ctx.finger.labels[second - 3],
            "seconds": length * strength,
            "at_share": begins.tolist(),
        }

    return Option(
        form,
        apply,
        joint=None if form == "across_segments" else JOINTS[joint],
        marker=ctx.finger.labels[first - 3],
        motor=False,
        capped=False,
    )


MARKING: dict[str, Draw] = {
    "marker_slip": marker_slip,
    "support_slip": support_slip,
    "palm_marker_slip": palm_marker_slip,
    "marker_swap": marker_swap,
}
