"""Drive sag: the drive delivers less per command as it is loaded (supply, bus current limit, back-EMF)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .base import Amplitude, Array, DriveState, Effect, Shape, figure
from .law import Followed, Law, Moment
from .path import lowpass

ASKED, FAST = 100.0, 100.0  # [raw], [%/s]
LATE, AT_SPEED = 2.0, 3.0  # forms
LAG_S = 0.03, 5.0
LEAST_RISE = 0.1  # effort delivered per further current, however much is asked for already
MOST = 1 - LEAST_RISE  # share that may be lost
ROUNDS = 12


class DriveSag(Effect):
    """Of a drive that follows its command in speed: steady speed = commanded speed (1 - sag * load), the load being the
    current in the direction of motion. Of one whose current is what its controller asks for: effort = current (1 -
    share lost), which grows with the current (form 0), with its square (form 1), where a supply gives way by and by with
    what was asked for over the last `lag` (form 2: first order), or, by back-EMF, with the speed (form 3).
    """

    name = "drive_sag"
    asks = True

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Share of the effort that is lost where 100 raw are asked for, or at 100 %/s, never negative."""
        return (("torque_loss", "1", 0.0, np.inf),)

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """form 0: the share that is lost grows with the current; 1: with its square; 2: with its low pass; 3: with the
        speed."""
        return (
            Shape("form", "1", 0.0, AT_SPEED, (0.0, 1.0, LATE, AT_SPEED)),
            Shape("lag", "s", *LAG_S, (0.1, 0.3, 1.0), forms=(LATE,)),
        )

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The effort that gets lost, (n, 1); what is asked for is "required" in `extra`."""
        asked = state.extra["required"]
        if shape["form"] == LATE:
            return (asked * lowpass(state.time_s, np.abs(asked), shape["lag"]) / ASKED)[:, None]
        if shape["form"] == AT_SPEED:
            return (asked * np.abs(state.velocity) / FAST)[:, None]
        return (asked * (np.abs(asked) / ASKED) ** (1 + shape["form"]))[:, None]

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """None where it is not known what the motion requires."""
        return super().grid(states) if all("required" in s.extra for s in states) else []

    def possible(self, states: tuple[DriveState, ...], parameters: Mapping[str, float]) -> bool:
        """Whether the drive still had more to give where most was asked of it: no controller holds a speed beyond. What
        was asked goes without the readings' noise where it is known. A supply that gives way by and by bears any peak
        that is short enough."""
        if _at_speed(parameters):
            return bool(
                parameters["torque_loss"] * max(float(np.max(np.abs(s.velocity))) for s in states) < MOST * FAST
            )
        asked = [np.abs(s.extra.get("required", s.effort)[np.isfinite(s.effort)]) for s in states]
        most = max((float(np.nanquantile(a, 0.99)) for a in asked if len(a)), default=0.0)
        return bool(_is_late(parameters) or _rise(most, parameters) > LEAST_RISE)

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Speed, or effort, lost per load."""
        if _at_speed(parameters):
            return (
                "the motor delivers less per current the faster it runs: "
                f"{figure(100 * parameters['torque_loss'])} % are lost at 100 %/s"
            )
        if "torque_loss" in parameters:
            late = f" (by and by, within {figure(parameters.get('lag', 0.0))} s)"
            square = {0: "", 1: " (with its square)", LATE: late}[parameters.get("form", 0)]
            return (
                f"the motor delivers less per current as it is loaded{square}: "
                f"{figure(100 * parameters['torque_loss'])} % are lost at 100 raw"
            )
        return (
            f"the motor loses {1e4 * parameters['sag']:.1f} % of its speed for every 100 raw of "
            "current that its load takes"
        )

    def law(self, parameters: Mapping[str, float]) -> Law | None:
        """What is lost of the effort; a loss of speed is no force: the command must be slowed by whoever gives it."""
        if "torque_loss" not in parameters:
            return None
        if _at_speed(parameters):
            loss = parameters["torque_loss"]
            return lambda now: now.load * min(loss * abs(now.velocity) / FAST, MOST)
        return _late(parameters) if _is_late(parameters) else lambda now: now.load * _lost(abs(now.load), parameters)

    def reading(self, effort: Array, time_s: Array, velocity: Array, parameters: Mapping[str, float]) -> Array:
        """The current that is asked for where this effort is needed."""
        if "torque_loss" not in parameters:
            return effort
        if _is_late(parameters):
            return _asked_late(effort, time_s, parameters)
        if _at_speed(parameters):
            return effort / (1 - np.minimum(parameters["torque_loss"] * np.abs(velocity) / FAST, MOST))
        asked = np.abs(effort)
        for _ in range(ROUNDS):  # Newton on a concave rise: from the left, and never beyond
            lost = asked * _lost(asked, parameters)
            asked = asked + (np.abs(effort) - asked + lost) / _rise(asked, parameters)
        return np.sign(effort) * asked


def _is_late(parameters: Mapping[str, float]) -> bool:
    return parameters.get("form") == LATE


def _at_speed(parameters: Mapping[str, float]) -> bool:
    return parameters.get("form") == AT_SPEED


def _late(parameters: Mapping[str, float]) -> Law:
    """What is lost step by step where the supply gives way by and by."""
    followed = Followed(parameters["lag"])

    def lost(now: Moment) -> float:
        asked = followed(abs(now.load), now.step_s)
        return now.load * min(parameters["torque_loss"] * asked / ASKED, MOST)

    return lost


def _asked_late(effort: Array, time_s: Array, parameters: Mapping[str, float]) -> Array:
    """The current (n,) asked for where this effort is needed and the supply gives way by and by: the share lost is that
    of the low pass, which is found from what is asked for in turn."""
    asked = effort
    for _ in range(ROUNDS):
        share = parameters["torque_loss"] * lowpass(time_s, np.abs(asked), parameters["lag"]) / ASKED
        asked = effort / (1 - np.minimum(share, MOST))
    return asked


def _bend(parameters: Mapping[str, float]) -> float:
    """Current [raw] from which on more of it brings next to nothing."""
    power = 1 + parameters.get("form", 0.0)
    return float(ASKED * (MOST / ((1 + power) * max(parameters["torque_loss"], 1e-9))) ** (1 / power))


def _rise(asked: Any, parameters: Mapping[str, float]) -> Any:
    """Effort delivered per further current, where a current of that size [raw] is asked for."""
    power = 1 + parameters.get("form", 0.0)
    return np.maximum(1 - (1 + power) * parameters["torque_loss"] * (asked / ASKED) ** power, LEAST_RISE)


def _lost(asked: Any, parameters: Mapping[str, float]) -> Any:
    """Share of the effort that is lost, where a current of that size [raw] is asked for; what is delivered never
    falls."""
    power, within = 1 + parameters.get("form", 0.0), np.minimum(asked, _bend(parameters))
    delivered = within * (1 - parameters["torque_loss"] * (within / ASKED) ** power) + LEAST_RISE * (asked - within)
    return 1 - delivered / np.maximum(asked, 1e-9)


EFFECT = DriveSag()
