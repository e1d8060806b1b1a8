"""Give that grows with load, between what drives and what follows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import LOST_MOTION, Amplitude, Array, DriveState, Effect, Shape, figure
from .law import Followed, Law, Moment
from .path import lowpass

DRIVER, FOLLOWER = 0, 1  # even forms give at the driver's end, odd ones at the follower's
FORMS = range(10)
DAMPED, DRAGGED, STIFFENING = (2, 3, 8, 9), (4, 5, 8, 9), (6, 7)
# [s]: a damper that lets a give follow faster is none that a hand's motion shows, and one slower holds it still
LAG_S = 0.03, 0.6
PLAIN = 0.4  # probability of each of the two plain forms
# times the greatest load: a give that is stiff below that moves like a play, one that stiffens later is plain
STIFF = 0.25, 1.5
MOST_DRAG = 12.0  # times as much as to other load, at most, a give yields to drag: else a segment is only late


class Compliance(Effect):
    """The part behind stays back by compliance * load, at the driver's end (follower = map(driver - give)) or at its
    own. At once, or as a damper beside the spring lets it (Kelvin-Voigt: lag give' + give = compliance load), or with a
    compliance of its own for the load that grows with speed: how much of the drive's friction and of its drag passes
    through what gives depends on where they act. Or it stiffens, as tendons and cables do: compliance stiff tanh(load / stiff).

    The load is what the motor's current passes on. What of it depends on position alone is in the map already: the
    compliance is known from what friction and speed add.
    """

    family = LOST_MOTION

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """form 0: give at the driver's end, in its unit; form 1: at the end of what follows, in its unit; forms 2 and 3:
        the same, damped, with a time constant; forms 4 and 5: the same as the first, drag apart; forms 6 and 7: the
        same as the first, stiffening from a load on; forms 8 and 9: damped, drag apart."""
        forms = tuple(float(form) for form in FORMS) if all("drag" in s.extra for s in states) else ()
        most = max(
            (float(np.percentile(np.abs(s.extra["load"]), 99)) for s in states if "load" in s.extra), default=1.0
        )
        least, greatest = (share * max(most, 1e-9) for share in STIFF)
        return (
            Shape("form", "1", FORMS[0], FORMS[-1], forms),
            Shape("lag", "s", *LAG_S, (0.06, 0.15, 0.35), forms=DAMPED),
            Shape("stiff", "raw", least, greatest, (2 * least,), forms=STIFFENING),
        )

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Compliance, and what it is for drag where that is another, always yielding."""
        return ("compliance", "position/raw", 0.0, np.inf), ("drag_compliance", "position/raw", 0.0, np.inf)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Minus the load and nothing, or minus the load without drag, and minus drag, or what of them the give has
        followed, (n, 2); times the map's slope where the give is at the driver's end."""
        load, apart = state.extra["load"], np.zeros(len(state.time_s))
        if stiffens(shape):
            load = shape["stiff"] * np.tanh(load / shape["stiff"])
        if dragged(shape):
            load, apart = load - state.extra["drag"], state.extra["drag"]
        if damped(shape):
            load, apart = (lowpass(state.time_s, part, shape["lag"]) for part in (load, apart))
        return -np.stack([load, apart], axis=-1) * (state.slope if at_driver(shape) else np.ones(len(load)))[:, None]

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """The compliance and where it is, the time constant of what is damped, the compliance for drag where it is
        another, the load from which it stiffens."""
        known = {"form": shape["form"], "compliance": amplitude["compliance"]}
        if dragged(shape):
            known["drag_compliance"] = amplitude["drag_compliance"]
        if stiffens(shape):
            known["stiff"] = shape["stiff"]
        return {**known, "lag": shape["lag"]} if damped(shape) else known

    def possible(self, states: tuple[DriveState, ...], parameters: Mapping[str, float]) -> bool:
        """What yields to drag alone gives nothing: it is late."""
        return parameters.get("drag_compliance", 0.0) <= MOST_DRAG * parameters["compliance"]

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Most gives are plain."""
        plain = not (self.hurries(parameters) or stiffens(parameters))
        return math.log(len(FORMS) * (PLAIN if plain else (1 - 2 * PLAIN) / (len(FORMS) - 2)))

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Of what yields: the driver's or the follower's position."""
        return dict.fromkeys(("compliance", "drag_compliance"), "position/raw" if at_driver(shape) else "effort/raw")

    def further(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """What drag is, over the driver's speed, where it has a compliance of its own."""
        if "drag_compliance" not in parameters:
            return {}
        speed, drag = (np.concatenate(v) for v in ([s.velocity for s in states], [s.extra["drag"] for s in states]))
        unit = f"raw s/{states[0].position_unit}"
        return {"drag": {"value": float(speed @ drag / max(speed @ speed, 1e-12)), "unit": unit, "ci95": None}}

    def hides(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, float], theirs: Mapping[str, float]
    ) -> bool:
        """A play no wider than friction moves what yields to drag, were all of it to pass through what gives."""
        if not dragged(parameters) or "gap" not in theirs:
            return False
        rest, way = (
            np.concatenate(v)
            for v in zip(*((s.extra["load"] - s.extra["drag"], np.sign(s.velocity)) for s in states), strict=True)
        )
        friction = 0.5 * float(np.nanmean(rest[way > 0]) - np.nanmean(rest[way < 0]))
        return theirs["gap"] < 2 * parameters["drag_compliance"] * friction

    def hurries(self, parameters: Mapping[str, float]) -> bool:
        """What follows late, or yields to drag."""
        return damped(parameters) or dragged(parameters)

    def law(self, parameters: Mapping[str, float]) -> Law:
        """Minus compliance times load, through the map's slope where the give is at the driver's end."""
        compliance, there = parameters["compliance"], at_driver({"form": FOLLOWER, **parameters})
        followed = Followed(parameters["lag"]) if damped(parameters) else None
        other = (parameters["drag_compliance"] - compliance) * parameters["drag"] if dragged(parameters) else 0.0
        stiff = parameters["stiff"] if stiffens(parameters) else math.inf

        def departure(now: Moment) -> float:
            load = now.load if math.isinf(stiff) else stiff * math.tanh(now.load / stiff)
            give = compliance * load + other * now.velocity
            give = give if followed is None else followed(give, now.step_s)
            return -give * (now.slope if there else math.radians(1.0))

        return departure


def damped(parameters: Mapping[str, float]) -> bool:
    """Whether a give follows its load late."""
    return parameters.get("form", FOLLOWER) in DAMPED


def dragged(parameters: Mapping[str, float]) -> bool:
    """Whether a give yields to drag otherwise than to other load."""
    return parameters.get("form", FOLLOWER) in DRAGGED


def stiffens(parameters: Mapping[str, float]) -> bool:
    """Whether a give yields less to more load."""
    return parameters.get("form", FOLLOWER) in STIFFENING


def besides(parameters: Mapping[str, float]) -> str:
    """What a sentence about a give says of time, drag or load; nothing of a plain one."""
    if stiffens(parameters):
        return f", stiffening from {figure(parameters['stiff'])} raw on"
    drag = f", and by {figure(100 * parameters['drag_compliance'])} where speed makes it" if dragged(parameters) else ""
    return drag + (f", {1e3 * parameters['lag']:.0f} ms late" if damped(parameters) else "")


def at_driver(parameters: Mapping[str, float]) -> bool:
    """Whether the give is at the driver's end."""
    return parameters["form"] % 2 == 0
