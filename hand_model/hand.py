"""The learned hand and its file (`.hand`): plain JSON, readable without this package.

Everything is expressed in the palm frame: the repeatable, landmark-based frame. Axes, centres, markers and tips are
those of the open hand at rest, where every joint angle is zero.
"""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import HandFileError, did_you_mean

Array = NDArray[np.float64]

FORMAT = "hand-model/1"


@dataclass(frozen=True)
class Estimate:
    """A fitted number. value and ci95 (low, high) in `unit`; origin says where it comes from."""

    value: float
    ci95: tuple[float, float] | None
    unit: str
    origin: str


@dataclass(frozen=True)
class ExtraJoint:
    """A joint that an angle moves. kind: "hinge" (through the centre) or "slide". axis_palm: (3,) unit, at rest.

    coefficients: (2 to 5,) of its coordinate [rad or m] over powers of that angle [rad]; the first is zero, so that
    rest stays rest.
    """

    kind: str
    axis_palm: Array
    coefficients: Array


@dataclass(frozen=True)
class Course:
    """What the joint of a segment does beside turning about its hinge: extra joints in step with its angle, slides
    first.

    turning: whether their axes turn with the segment that the joint carries (else they stay with the one before it).
    """

    joints: tuple[ExtraJoint, ...]
    turning: bool


@dataclass(frozen=True)
class Joint:
    """A hinge and the segment that it carries (both under the segment's name).

    axis_palm: (3,) unit, flexion positive. centre_palm: (3,) [m]. covariance: (6, 6) of (axis [-], centre [m]).
    range_rad: recorded (min, max) [rad]. markers_palm: label -> (3,) [m]. tip_palm: (3,) [m] on the last segment.
    degenerate: the recorded arc does not determine axis or centre; the covariance says how little. course: where it is
    no plain hinge.
    """

    name: str
    axis_palm: Array
    centre_palm: Array
    covariance: Array
    range_rad: tuple[float, float]
    markers_palm: Mapping[str, Array]
    tip_palm: Array | None = None
    degenerate: bool = False
    course: Course | None = field(default=None, metadata={"if_known": True})


@dataclass(frozen=True)
class EncoderMap:
    """Encoder counts to joint angle: angle_rad = sum_i coefficients[i] u^i, u = (counts - counts_open) / (counts_close
    - counts_open).

    rmse_rad: order (as text) -> in-sample RMSE [rad], as the thesis reports it; rmse_held_out_rad: the same on held-out
    cycles.
    """

    counts_open: float
    counts_close: float
    coefficients: Array
    rmse_rad: Mapping[str, float]
    rmse_held_out_rad: Mapping[str, float]

    def angle_rad(self, counts: Array) -> Array:
        """Joint angle [rad] of encoder counts (n,)."""
        u = (np.asarray(counts, float) - self.counts_open) / (self.counts_close - self.counts_open)
        return np.polynomial.polynomial.polyval(u, self.coefficients)


@dataclass(frozen=True)
class Coupling:
    """A linkage: follower angle = sum_i coefficients[i] driver^i [rad], monotonic over the driver's range. rmse_rad as
    in EncoderMap."""

    driver: str
    follower: str
    coefficients: Array
    rmse_rad: Mapping[str, float]
    rmse_held_out_rad: Mapping[str, float]

    def follower_rad(self, driver_rad: Array) -> Array:
        """Follower angle [rad] of driver angles (n,) [rad]."""
        return np.polynomial.polynomial.polyval(np.asarray(driver_rad, float), self.coefficients)


@dataclass(frozen=True)
class Finger:
    """A finger: joints from the palm outwards, one encoder map per joint (none without a log), one coupling per further
    joint."""

    name: str
    actuator: str | None
    joints: tuple[Joint, ...]
    encoder_maps: tuple[EncoderMap, ...] = ()
    couplings: tuple[Coupling, ...] = ()


@dataclass(frozen=True)
class Motor:
    """A motor in the hand's raw units: position in percent between counts_open (0) and counts_close (100), current raw.

    current = inertia a + viscous v + coulomb sign(v) + stiffness p + preload, with p [%], v [%/s], a [%/s^2].
    parameters: these five names -> Estimate. current_noise_raw: standard deviation of one current sample.
    """

    actuator: str
    counts_open: float
    counts_close: float
    parameters: Mapping[str, Estimate]
    current_noise_raw: float
    trials: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effect:
    """One effect beyond the declared model, as found by a diagnosis: name of the vocabulary, place, parameters."""

    effect: str
    where: Mapping[str, Any]
    parameters: Mapping[str, Estimate]


@dataclass(frozen=True)
class Hand:
    """A learned hand. palm_markers_palm, landmarks_palm: name -> (3,) [m]. noise_m: marker noise per coordinate [m].

    provenance: file relative to the session -> SHA-256. notes: what a user must know, one sentence each.
    """

    name: str
    side: str
    palm_markers_palm: Mapping[str, Array]
    landmarks_palm: Mapping[str, Array]
    fingers: tuple[Finger, ...]
    noise_m: float
    provenance: Mapping[str, str]
    motors: tuple[Motor, ...] = ()
    effects: tuple[Effect, ...] = ()
    notes: tuple[str, ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)

    def finger(self, name: str) -> Finger:
        """The finger of that name; raises HandFileError with a near name."""
        for finger in self.fingers:
            if finger.name == name:
                return finger
        raise HandFileError(
            f'hand "{self.name}" has no finger "{name}"; {did_you_mean(name, [f.name for f in self.fingers])}'
        )

    def save(self, path: str | Path) -> None:
        """Write the hand as JSON with all digits; the same hand gives the same bytes."""
        text = json.dumps({"format": FORMAT, **_encode(self)}, indent=1, allow_nan=False)
        Path(path).write_text(text + "\n")


def load_hand(path: str | Path) -> Hand:
    """Read a `.hand` file, or a compiled folder's; raises HandFileError where it is missing, foreign or incomplete."""
    file = Path(path) / "hand.json" if Path(path).is_dir() else Path(path)
    if not file.is_file():
        raise HandFileError(
            f"{file}: no such file; a .hand file, from identify, or a compiled folder with its hand.json is needed"
        )
    try:
        table = json.loads(file.read_text())
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise HandFileError(f"{file}: not a .hand file ({error})") from None
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        raise HandFileError(f'{file}: not a .hand file of format "{FORMAT}"')
    try:
        return _decode(Hand, table)
    except (KeyError, TypeError, ValueError) as error:
        raise HandFileError(f"{file}: incomplete or damaged ({error})") from None


def _encode(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        known = [
            f for f in dataclasses.fields(value) if not f.metadata.get("if_known") or getattr(value, f.name) is not None
        ]
        return {f.name: _encode(getattr(value, f.name)) for f in known}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(k): _encode(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [_encode(v) for v in value]
    return value


def _decode(kind: Any, value: Any) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return None if value is None else _decode(next(a for a in arguments if a is not type(None)), value)
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        return kind(
            **{f.name: _decode(hints[f.name], value[f.name]) for f in dataclasses.fields(kind) if f.name in value}
        )
    if origin is np.ndarray or kind is np.ndarray:
        return np.array(value, float)
    if origin is tuple:
        inner = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
        return tuple(_decode(k, v) for k, v in zip(inner, value, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return {k: _decode(arguments[1], v) for k, v in value.items()}
    return value
