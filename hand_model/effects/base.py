"""What an effect is: the one thing that a contributor adds to teach the tool new physics, one file each.

A module in this folder that defines `EFFECT = SomeEffect()` is found by `effects.catalogue()`; no other edit is needed.
The same interface serves three balances, told apart by `station`:

- "drive": effort (current, torque) = declared(position, velocity, acceleration) + effect columns;
- "encoder": proximal (or downstream) angle = polynomial of the encoder (upstream) position + effect columns;
- "linkage": distal angle = polynomial of the proximal angle + effect columns.

"marker" and "recording" effects act on marker trajectories or clocks and bring functions of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from .law import Law

FRICTION = "coulomb"  # the declared column whose sign friction has
LOST_MOTION = "lost motion"  # family of plays and of what gives
UNSEEN_DELAY, SURE_DELAY = 0.75, 4.0  # sample intervals, and standard deviations, from which a delay is told

Array = NDArray[np.float64]
Amplitude = tuple[str, str, float, float]


@dataclass(frozen=True)
class DriveState:
    """One balance (a motor of a hand, a joint of a rig, an angle against an angle) during one trial, as an effect sees
    it.

    time_s: (n,) [s]. position, velocity, acceleration: (n,) in the drive's unit ([%], [rad] or [m], and per second).
    effort: (n,) measured left side, raw or SI, nan where it is not to be compared. declared: (n, k) columns of the
    declared model, declared_names: their names ("inertia", "viscous", "coulomb", "spring", "preload", ...).
    extra: further channels by name, (n,) each: "elapsed" [s] since the first sample of the session, "load", "setpoint",
    "speed" (commanded), "temperature", "supply", "gravity_along|across" in the finger's plane, "sweep" (n, 2)
    [rad] that its first joint and all turn through over the range, "sigma" (standard
    deviation, in effort units, of what the state estimate cannot know, beside the noise).
    """

    trial: str
    drive: str
    time_s: Array
    position: Array
    velocity: Array
    acceleration: Array
    effort: Array
    declared: Array
    position_unit: str = "%"
    effort_unit: str = "raw"
    extra: Mapping[str, Array] = field(default_factory=dict)
    declared_names: tuple[str, ...] = ()
    validate: bool = False

    @property
    def direction(self) -> Array:
        """Friction's direction (n,) in [-1, 1]: the declared Coulomb column where there is one, else sign(velocity)."""
        if FRICTION in self.declared_names:
            return self.declared[:, self.declared_names.index(FRICTION)]
        return np.sign(self.velocity)

    @property
    def friction_position(self) -> Array:
        """Position (n,) to which the present friction belongs: bristles lag behind by their length, "give" in
        `extra`."""
        return self.position - self.direction * self.extra.get("give", np.zeros(len(self.position)))

    @property
    def slope(self) -> Array:
        """Slope (n,) of the map from position to effort, "slope" in `extra`; one where nothing is known."""
        return self.extra.get("slope", np.ones(len(self.position)))

    @property
    def elapsed_s(self) -> Array:
        """Time [s] since the session's first sample (or the trial's, where nothing else is known)."""
        return self.extra.get("elapsed", self.time_s - self.time_s[0])


@dataclass(frozen=True)
class Shape:
    """A nonlinear parameter of an effect: its unit, bounds, and the starting values that a multi-start fit tries. size:
    it says how much of the effect there is, as an amplitude does. edge: what it moves over matters at times only, so
    that its likelihood has steps and is searched all along. forms: those in which it matters, all where none is told."""

    name: str
    unit: str
    low: float
    high: float
    starts: tuple[float, ...]
    size: bool = False
    edge: bool = False
    forms: tuple[float, ...] = ()

    def matters(self, shape: Mapping[str, float]) -> bool:
        """Whether it does in the form that a shape has."""
        return not self.forms or shape.get("form") in self.forms

    def wider(self, value: float) -> float:
        """Sign of the way from a value to the end of the range that is farther."""
        return 1.0 if self.high - value > value - self.low else -1.0


@runtime_checkable
class DriveEffect(Protocol):
    """An effect in the balance effort = declared + columns(state, shape) @ amplitude."""

    name: str
    station: str  # "drive", "encoder" or "linkage"

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """Nonlinear parameters, with bounds and starts from the recorded range."""
        ...

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """Columns (n, j), linear in their amplitudes, whose sum is the effort that the effect adds."""
        ...

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """Name, unit, lower and upper bound of each amplitude (j of them); bounds carry the sign that physics
        allows."""
        ...

    def statement(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """One sentence for the report."""
        ...

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """Write the effect into an MJCF tree (lxml); the element's path, or None where only the passive callback
        can."""
        ...


class Effect:
    """Defaults that an effect's class inherits: no shapes, one free amplitude, nothing native in MJCF.

    Besides `columns`, an effect may change what is already there: `declared` (presliding replaces the Coulomb column),
    `warp` (a delay shifts every column), `clip` (a saturated channel bends the prediction).
    """

    name: ClassVar[str]
    station: ClassVar[str] = "drive"
    replaces: ClassVar[str | None] = None  # name of the declared column that `declared` changes
    warps: ClassVar[bool] = False
    # its columns are of what is asked of a drive, "required" in `extra`, which it changes itself
    asks: ClassVar[bool] = False
    clips: ClassVar[bool] = False
    rubs: ClassVar[bool] = False  # its columns carry friction's direction, which bristles turn over
    # declared column without which the effect is none (a ratio to a friction of zero)
    needs: ClassVar[str | None] = None
    of_the_hand: ClassVar[bool] = True  # False of what only one recording had, such as an obstacle
    # channel that is wrong, where it is another than the one in which the effect shows
    signal: ClassVar[str | None] = None
    # of the recording, not of the machine: the machine is compared with what is left without it
    recorded: ClassVar[bool] = False
    # moved by a force that no recording holds: a replay is given what it moved
    forced: ClassVar[bool] = False
    # seen as a level that changes slowly or with the recording, as a zero that wanders is
    drifting: ClassVar[bool] = False
    unwritten: ClassVar[str | None] = None  # why no file can hold it or no replay show it, where that is so
    # effects of one family move alike: a small one beside a large one may be its form
    family: ClassVar[str | None] = None
    listed: ClassVar[bool] = True  # False of an outsider: no row of the table of effects, told as unexplained
    held: ClassVar[int] = 0  # of its amplitudes, the last ones, whose columns act in validation recordings alone
    repeats: ClassVar[bool] = False  # may be named more than once in one balance, with other shapes

    def __eq__(self, other: object) -> bool:
        """Effects of one class are one, in whichever process they are."""
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash(type(self))

    def shapes(self, states: tuple[DriveState, ...]) -> tuple[Shape, ...]:
        """No nonlinear parameter."""
        return ()

    def grid(self, states: tuple[DriveState, ...]) -> list[dict[str, float]]:
        """Starting shapes: the product of each shape's starts, one start of what does not matter."""
        points, shapes = list[dict[str, float]]([{}]), self.shapes(states)
        for shape in shapes:
            points = [{**point, shape.name: value} for point in points for value in shape.starts]
        return [p for p in points if all(s.matters(p) or p[s.name] == s.starts[0] for s in shapes)]

    def amplitudes(self) -> tuple[Amplitude, ...]:
        """One amplitude of either sign, in effort units."""
        return (("amplitude", "effort", -np.inf, np.inf),)

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """No column."""
        return np.zeros((len(state.time_s), 0))

    def acts(self, state: DriveState, shape: Mapping[str, float]) -> bool:
        """Whether its columns may be other than zero along a recording: in any."""
        return True

    def declared(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """The declared columns as they are."""
        return state.declared

    def warp(self, state: DriveState, columns: Array, shape: Mapping[str, float]) -> Array:
        """All columns as they are."""
        return columns

    def apart(self) -> Effect:
        """The effect, where it may be of one recording or of several as one, as that of one alone; itself."""
        return self

    def among(self, states: tuple[DriveState, ...]) -> Effect:
        """The effect with as many amplitudes as these recordings ask for; itself."""
        return self

    def told_by(self, state: DriveState) -> bool:
        """Whether a recording says what the effect depends on, so that it can bear the effect out: every one."""
        return True

    def clip(self, prediction: Array, shape: Mapping[str, float]) -> Array:
        """The prediction as it is."""
        return prediction

    def parameters(
        self, shape: Mapping[str, float], amplitude: Mapping[str, float], declared: Mapping[str, float]
    ) -> dict[str, float]:
        """Parameters by their textbook names, from shapes, amplitudes and declared coefficients."""
        return {**shape, **amplitude}

    def told(self, shape: Mapping[str, float]) -> dict[str, float]:
        """What of a shape is said of its form, where what `shapes` names is not all; the whole shape."""
        return dict(shape)

    def units(self, shape: Mapping[str, float]) -> Mapping[str, str]:
        """Units of what `parameters` makes of shapes and amplitudes, with "effort" and "position" for those of the
        state."""
        return {}

    def told_otherwise(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> bool:
        """Whether something else than the balance of `states` says the same for sure."""
        return False

    def possible(self, states: tuple[DriveState, ...], parameters: Mapping[str, float]) -> bool:
        """Whether a machine with these parameters could have moved as it did: any can."""
        return True

    def hides(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, float], theirs: Mapping[str, float]
    ) -> bool:
        """Whether what another of its family, with parameters of its own, does beside it may be a part of what it does
        itself: it never is."""
        return False

    def log_prior(self, parameters: Mapping[str, float]) -> float:
        """Log density of the parameters over that of ordinary ones: negative where machines rarely are like that."""
        return 0.0

    def derived(self, states: tuple[DriveState, ...], parameters: Mapping[str, float]) -> dict[str, float]:
        """What follows from these parameters and the recorded range, beside them and with an interval of its own;
        nothing."""
        return {}

    def further(
        self, states: tuple[DriveState, ...], parameters: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """Further parameters (value, unit, ci95) that follow from the fitted ones and the recorded range; none."""
        return {}

    def region(self, states: tuple[DriveState, ...], shape: Mapping[str, float]) -> dict[str, Any] | None:
        """The part of state in which the effect acts, as `where.region` of a finding; None where it acts everywhere."""
        return None

    def statement(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The place and the effect's sentence; the name and the figures there are, where one that it needs is missing
        or not finite."""
        known = {key: float(v) for key, v in parameters.items() if isinstance(v, Real) and math.isfinite(v)}
        of_motor = self.station in ("drive", "command", "motors")
        place = (of_motor and where.get("actuator")) or where.get("finger") or where.get("actuator")
        try:
            return f"{place}: {self.sentence(where, known)}."
        except KeyError:
            listed = ", ".join(f"{key} {figure(v)}" for key, v in known.items())
            return f"{place}: " + f"{self.name}{f' ({listed})' if listed else ''}.".replace("_", " ")

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """What was left out, in plain words with figures and units, without place and full stop. parameters: the finite
        ones.

        Raises KeyError where a figure that it needs is missing: `statement` then falls back to a list.
        """
        raise KeyError(self.name)

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """Not native: the passive-force callback applies it, where there is a law."""
        return None

    def reading(self, effort: Array, time_s: Array, velocity: Array, parameters: Mapping[str, float]) -> Array:
        """What a channel shows of the drive's effort (n,) [raw] at a velocity (n,) [%/s]: as it is, unless the effect is
        in the reading and no sensor holds it."""
        return effort

    def hurries(self, parameters: Mapping[str, float]) -> bool:
        """Whether what it does to a follower depends on time or speed, and no slower replay shows it."""
        return False

    def started(self, state: DriveState, parameters: Mapping[str, float]) -> dict[str, float]:
        """Parameters that only a recording knows: what went before it. None here."""
        return {}

    def law(self, parameters: Mapping[str, float]) -> Law | None:
        """What the passive-force callback applies (`hand_model.effects_on`); None where MJCF holds it, or nothing
        can."""
        return None


def figure(value: float) -> str:
    """A number for a sentence: three significant digits, whole from a hundred on."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def rounded(x: Array, corner: float) -> Array:
    """max(0, x) with a corner of that width: corner ln(1 + exp(x / corner))."""
    return corner * np.logaddexp(0.0, x / corner)


def sample_interval(states: Sequence[DriveState]) -> float:
    """Median time [s] between neighbouring samples of all states."""
    return float(np.median(np.concatenate([np.diff(s.time_s) for s in states])))


def least_delay(states: Sequence[DriveState]) -> float:
    """Least delay [s] of a channel that these recordings tell: three quarters of a sample interval, or what is known
    better of the current's lateness ("late" in `extra`: value and standard deviation)."""
    late = states[0].extra.get("late")
    least = UNSEEN_DELAY * sample_interval(states)
    return least if late is None else min(least, SURE_DELAY * float(late[1]))


def position_range(states: tuple[DriveState, ...]) -> tuple[float, float]:
    """Lowest and highest position over all states where the effort is compared, ends trimmed by 0.5 %."""
    values = np.concatenate([s.position[np.isfinite(s.effort)] for s in states])
    if not len(values):
        return 0.0, 1.0
    low, high = np.percentile(values, [0.5, 99.5])
    return float(low), float(max(high, low + 1e-12))


def speed_range(states: tuple[DriveState, ...]) -> tuple[float, float]:
    """5th and 99th percentile of |velocity| where the effort is compared."""
    values = np.concatenate([np.abs(s.velocity[np.isfinite(s.effort)]) for s in states])
    if not len(values):
        return 0.0, 1.0
    low, high = np.percentile(values, [5, 99])
    return float(low), float(max(high, 1e-12))
