"""What an effect of a balance does while MuJoCo steps: effort and dry friction at the present state of its joint."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import DriveState, effect

Array = NDArray[np.float64]
# Effects that depend on the present state alone; of those, the frictions.
FRICTION = frozenset({"stribeck_friction", "position_dependent_friction"})
# Variants of friction by load: by what the joint carries where nothing else is said.
MOTOR, GEAR, TURNING = "motor side", "both sides of the gear", "turning round over a distance"
LOW, MOTOR_LOW, GEAR_LOW = "low speed", f"{MOTOR}, low speed", f"{GEAR}, low speed"
ALL_TURNING = f"{TURNING}, with what does not grow with it"
# At every speed, and more of it below a Stribeck speed (M5 of the ladder of Duclusaud et al. 2024).
MORE, MOTOR_MORE, GEAR_MORE = (f"{side}more at low speed" for side in ("", f"{MOTOR}, ", f"{GEAR}, "))
BRISTLES = "bristles that hold more while it is slow"
# Of recordings that declare Coulomb levels of their own.
BY_LEVEL = "a level for each that trials declare"
BRISTLES_BY_LEVEL = f"{BRISTLES}, in proportion to the levels that trials declare"
# of a spring where none is declared: its stiffness, and what it gives at the joint's zero
LINE, PRELOAD = "linear_stiffness", "preload"
UNDECLARED, PRELOADED = "no spring is declared", "no spring is declared, at rest anywhere"
OF_STATE = FRICTION | {"nonlinear_spring", "end_stop_contact", "detent_load", "torque_ripple"}


@dataclass(frozen=True)
class Now:
    """One instant of a joint. position [rad or m], velocity [per s]; load: what the joint carries [N m or N]; drive:
    what its own drive puts in; bias: the load without what acceleration asks for; time_s: since the recording began."""

    position: float
    velocity: float
    load: float
    drive: float
    bias: float = 0.0
    time_s: float = 0.0


# (effort against the motion that the drive must give besides, bound of further dry friction), both [N m or N].
Law = Callable[[Now], tuple[float, float]]


def law(record: Mapping[str, Any]) -> Law | None:
    """The law of a record {"effect", "variant", "shape", "amplitude"} of a file; None where it has none in open
    loop."""
    name, variant = record["effect"], record.get("variant", "")
    shape, size = record.get("shape", {}), tuple(record.get("amplitude", {}).values())
    if variant == ALL_TURNING:
        return _Stop(shape, size[0], by_load=True, base=size[1])
    if variant == BRISTLES:
        return _Bristles(shape, size[0])
    if variant == TURNING:
        return _Stop(shape, size[0], by_load=name == "load_dependent_friction")
    if name == "thermal_friction_drift":
        return Warming(shape, record.get("amplitude", {}))
    if name == "load_dependent_friction":
        return _by_load(variant, shape, *size)
    if variant in (BY_LEVEL, BRISTLES_BY_LEVEL):
        return None  # a trial's own level is not known here
    if name == "elastoplastic_hysteresis":
        return _Stop(shape, size[0])
    simple: dict[str, Law] = {
        "asymmetric_friction": lambda n: (size[0], 0.0),
        "asymmetric_viscous_friction": lambda n: (size[0] * abs(n.velocity), 0.0),
        "quadratic_damping": lambda n: (size[0] * n.velocity * abs(n.velocity), 0.0),
        # the channel was read at another instant: the control is shifted
        "current_channel_delay": lambda n: (0.0, 0.0),
        "command_delay": lambda n: (0.0, 0.0),
    }
    return _of_state(record) if name in OF_STATE else simple.get(name)


def _of_state(record: Mapping[str, Any]) -> Law:
    """The catalogue's own columns at one sample; friction as the bound that it is while the joint moves forwards."""
    named, shape = effect(record["effect"]), record.get("shape", {})
    size = np.array([record["amplitude"][a[0]] for a in named.amplitudes()])
    one, friction = np.ones(1), record["effect"] in FRICTION
    line, preload = (record["amplitude"].get(name, 0.0) for name in (LINE, PRELOAD))

    def act(now: Now) -> tuple[float, float]:
        state = DriveState(
            "",
            "",
            0 * one,
            now.position * one,
            now.velocity * one,
            0 * one,
            np.nan * one,
            one[:, None],
            declared_names=("coulomb",),
        )
        value = float((named.columns(state, shape) @ size)[0])
        return (0.0, value) if friction else (value + preload + line * now.position, 0.0)

    return act


def _by_load(variant: str, shape: Mapping[str, float], size: float, slow: float = 0.0) -> Law:
    if variant == "with speed":
        return lambda n: (size * n.velocity * abs(n.load), 0.0)
    side = _SIDES.get(variant, _SIDES[LOW])
    if variant in (LOW, MOTOR_LOW, GEAR_LOW):
        size, slow = 0.0, size
    if slow:
        return lambda n: (0.0, side(n) * (size + slow * math.exp(-((n.velocity / shape["stribeck_speed"]) ** 2))))
    return lambda n: (0.0, size * side(n))


def _joint(now: Now) -> float:
    return abs(now.load)


def _motor(now: Now) -> float:
    return abs(now.drive)


def _gear(now: Now) -> float:
    return 0.5 * abs(now.drive + now.bias)


_SIDES = {
    LOW: _joint,
    MORE: _joint,
    MOTOR: _motor,
    MOTOR_LOW: _motor,
    MOTOR_MORE: _motor,
    GEAR: _gear,
    GEAR_LOW: _gear,
    GEAR_MORE: _gear,
}


class _Stop:
    """Stop operator (form 0) or exponential build-up (form 1) along the path, step by step; by_load: times the load,
    and a base besides; slower than a Stribeck speed where the shape has one."""

    def __init__(self, shape: Mapping[str, float], size: float, by_load: bool = False, base: float = 0.0) -> None:
        self.base = base
        self.reach, self.abrupt, self.size, self.by_load = (
            max(shape["reach"], 1e-12),
            shape["form"] < 0.5,
            size,
            by_load,
        )
        self.slow, self.state, self.last = shape.get("stribeck_speed", math.inf), 0.0, math.nan

    def __call__(self, now: Now) -> tuple[float, float]:
        """Effort of the present state, no further friction."""
        moved = 0.0 if math.isnan(self.last) else now.position - self.last
        self.last = now.position
        if self.abrupt:
            self.state = min(max(self.state + moved / self.reach, -1.0), 1.0)
        else:
            self.state = _built_up(self.state, moved, self.reach)
        by = math.exp(-((now.velocity / self.slow) ** 2)) * (abs(now.load) if self.by_load else 1.0)
        return (self.base + self.size * by) * self.state, 0.0


class _Bristles:
    """What bristles that hold more while the joint is slow hold beyond those that do not (`effects.path.lugre`, `dahl`),
    step by step."""

    def __init__(self, shape: Mapping[str, float], size: float) -> None:
        self.reach, self.slow, self.ratio = max(shape["reach"], 1e-12), shape["stribeck_speed"], shape["static_ratio"]
        self.size, self.more, self.plain, self.last = size / self.ratio, 0.0, 0.0, math.nan

    def __call__(self, now: Now) -> tuple[float, float]:
        """Effort of the present state, no further friction."""
        moved = 0.0 if math.isnan(self.last) else now.position - self.last
        self.last = now.position
        level = 1.0 + self.ratio * math.exp(-((now.velocity / self.slow) ** 2))
        self.more = _built_up(self.more, moved, self.reach, level)
        self.plain = _built_up(self.plain, moved, self.reach)
        return self.size * (self.more - self.plain), 0.0


def _built_up(state: float, moved: float, reach: float, level: float = 1.0) -> float:
    """State of bristles that hold `level` while they slide, after a way moved [rad or m] with a reach."""
    if not moved:
        return state
    holds = math.copysign(level, moved)
    return holds + (state - holds) * math.exp(-abs(moved) / (reach * level))


class Warming:
    """Friction that is more while a joint is cold: dry, and by speed. shape: what its warming goes by; until `follow` says
    how warm it is, it is cold."""

    def __init__(self, shape: Mapping[str, float], size: Mapping[str, float]) -> None:
        self.shape, self.dry, self.drag = shape, size.get("cold_excess", 0.0), size.get("cold_viscous", 0.0)
        self.time_s, self.left = np.zeros(1), np.ones(1)

    def follow(self, time_s: Array, left: Array) -> None:
        """What is still to come (n,) of the change at times (n,) [s] of a recording."""
        self.time_s, self.left = time_s, left

    def __call__(self, now: Now) -> tuple[float, float]:
        """Drag against the motion, and the bound of what rubs dry."""
        left = float(np.interp(now.time_s, self.time_s, self.left))
        return left * self.drag * now.velocity, left * self.dry
