"""Gravity load: weight of finger or support, changing with the pose of the hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure
from .law import Law, Moment

ONE_POSE, OWN_POSES = 0.0, 1.0  # forms: of the recordings that show none
LIFTED = 2.0  # of the largest effort, at most, is a weight: in other poses friction and spring may hold some of it
NEAR = 0.2  # share by which the angle that matters may differ: the map to the joint is no line


class GravityLoad(Effect):
    """Torque of a weight at a constant lever in the plane of the finger, turned by the joint angle."""

    name = "gravity_load"

    def __init__(self, unseen: int = 1) -> None:
        """unseen: of the recordings, which show no pose."""
        self.unseen = unseen

    def among(self, states: tuple[DriveState, ...]) -> GravityLoad:
        """With a pose for each of these recordings that shows none."""
        return GravityLoad(max((1 + n for s in states if (n := _unseen(s)) is not None), default=1))

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Angle swept over the range of positions, [rad], between those of the first joint and of all as the markers
        show them; with a recorded pose only. form 0: in all recordings that show no pose it was the same; form 1: in
        each another."""
        if not any("gravity_along" in s.extra for s in states):
            return ()
        forms = (Shape("form", "1", ONE_POSE, OWN_POSES, (ONE_POSE, OWN_POSES)),) if self.unseen > 1 else ()
        seen = next((s.extra["sweep"][0] for s in states if "sweep" in s.extra and len(s.time_s)), None)
        if seen is not None:
            first, last = sorted(float(angle) for angle in seen)
            starts = tuple(np.unique([first, 0.5 * (first + last), last]).tolist())
            return (*forms, Shape("sweep", "rad", (1 - NEAR) * first, (1 + NEAR) * last, starts))
        return (*forms, Shape("sweep", "rad", 0.5, 2.5, (0.8, 1.4, 2.0)))

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Weight times lever along the open finger and across it; and what it does in the poses of recordings that show
        none."""
        unseen = (f"unseen_{part}{i or ''}" for i in range(self.unseen) for part in ("cosine", "sine"))
        return tuple((name, "effort", -np.inf, np.inf) for name in ("along", "across", *unseen))

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Torque of a unit weight on the finger's line and across it, in parts of 9.81 m/s^2, and cosine and sine of
        the angle where the pose was not recorded, (n, 2 + 2 unseen); none where no recording has a pose."""
        out = np.zeros((len(state.time_s), 2 + 2 * self.unseen))
        unseen = _unseen(state)
        if not shape or unseen is None and "gravity_along" not in state.extra:
            return out
        angle = shape["sweep"] * state.position / 100.0
        cosine, sine = np.cos(angle), np.sin(angle)
        if unseen is not None:
            own = 2 + 2 * unseen if shape.get("form") == OWN_POSES else 2
            out[:, own], out[:, own + 1] = cosine, sine
            return out
        along, across = state.extra["gravity_along"] / 9.81, state.extra["gravity_across"] / 9.81
        out[:, 0], out[:, 1] = across * cosine - along * sine, along * cosine + across * sine
        return out

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """The weight, and the largest load that it can be (which is known better than either part); not what it did in a
        pose that nobody knows."""
        along, across = amplitude["along"], amplitude["across"]
        figures = {"along": along, "across": across, "largest": math.hypot(along, across)}
        return {**{k: v for k, v in shape.items() if k != "form"}, **figures}

    def possible(self, states: tuple[DriveState, ...], parameters: Mapping[str, float]) -> bool:
        """Whether the drive could lift the weight in any pose, with what it was seen to give."""
        most = max((float(np.max(np.abs(s.effort[np.isfinite(s.effort)]), initial=0.0)) for s in states), default=0.0)
        return parameters["largest"] <= LIFTED * most

    def units(self, shape: Mapping[str, float]) -> dict[str, str]:
        """Of the largest load."""
        return {"largest": "effort"}

    def told_by(self, state: DriveState) -> bool:
        """One in which the pose of the hand was recorded."""
        return "pose_seen" in state.extra

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The largest load that the weight can be."""
        return (
            f"weight loads the motor with up to {figure(parameters['largest'])} raw, changing with the pose of the hand and "
            "the angle of the finger"
        )

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Gravity in the finger's plane, turned with the finger."""
        along, across, sweep = (parameters[k] for k in ("along", "across", "sweep"))

        def load(now: Moment) -> float:
            angle = sweep * now.position / 100.0
            x, y = now.gravity_along / 9.81, now.gravity_across / 9.81
            return along * (y * math.cos(angle) - x * math.sin(angle)) + across * (
                x * math.cos(angle) + y * math.sin(angle)
            )

        return load


def _unseen(state: DriveState) -> int | None:
    """The number of a recording among those that show no pose; None of one that shows its own, or is not asked."""
    number = state.extra.get("pose_unseen")
    return None if number is None else int(number.max(initial=0))


EFFECT = GravityLoad()
