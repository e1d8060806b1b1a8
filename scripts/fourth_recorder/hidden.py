"""What effects change outside the motor: the linkage, the log, the markers. None and 0 hide nothing."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MovingCentre:
    """A joint's centre (0 proximal, 1 distal) that travels `distance` [mm] over the range in a direction [rad] across
    its axis; bow: share of it aside, midway."""

    joint: int
    distance: float
    direction: float
    bow: float


@dataclass(frozen=True)
class Wobble:
    """A joint (0 proximal, 1 distal) whose segment tilts by up to `angle` [rad] with its angle's sine; waves: per rad;
    direction, phase [rad]."""

    joint: int
    angle: float
    direction: float
    waves: float
    phase: float


@dataclass(frozen=True)
class Touch:
    """An obstacle from `begin` to `end` [s] at a place [%]; give: what the distal joint loses [rad per %]."""

    place: float
    give: float
    begin: float
    end: float


@dataclass(frozen=True)
class LinkageFaults:
    """Between motor and segments. Angles in rad, places in %."""

    rest_jump: tuple[float, float] | None = None  # share of the trial when it comes, angle
    lost_angle: float = 0.0  # at 0 %, where the joint leaves the motor
    lost_below: float = 0.0
    lost_width: float = 1.0
    drive_play: float = 0.0  # half the gap
    drive_compliance: float = 0.0  # rad per raw
    linkage_play: float = 0.0  # half the gap
    linkage_compliance: float = 0.0  # rad per raw
    deadband: float = 0.0  # of the proximal joint before the distal one follows
    distal_limit: float = 0.0  # share of the full angle
    moving_centre: MovingCentre | None = None
    wobble: Wobble | None = None
    touch: Touch | None = None


@dataclass(frozen=True)
class Contact:
    """An obstacle at a place [%] with a stiffness [raw per %], there for a span (shares of the trial) of those trials
    that have it; give: what the distal joint loses [rad per %]."""

    place: float
    stiffness: float
    give: float
    span: tuple[float, float]
    trials: tuple[bool, ...]


@dataclass(frozen=True)
class LogFaults:
    """Drive and log during trials; where there are two or three figures, their order is in the comment."""

    contact: Contact | None = None
    reading_limit: float = 0.0  # [raw]
    current_delay: float = 0.0  # [s]
    dead: str | None = None  # position_reference, position_setpoint, current_dead or current_command
    skew: float = 1.0  # of the log's clock
    bursts: tuple[float, float, float] | None = None  # factor of the noise, length [s], share of the time
    gain_step: tuple[float, float] | None = None  # share of the trial when it comes, factor
    missed_counts: float = 0.0  # per fast move
    retuned: tuple[float, float] | None = None  # share of the trial when it comes, factor
    crosstalk: tuple[float, float] | None = None  # amplitude [raw], period [s]
    preload_jump: tuple[float, float] | None = None  # share of the trial when it comes, force [raw]
    offset_swing: tuple[float, float, float] | None = None  # amplitude [raw], period [s], phase [rad]


@dataclass(frozen=True)
class MarkerSlip:
    """One marker (0 to 2) of a segment (0, 1) shifted [mm] in the frame of the palm or the segment from a share of each
    trial on."""

    segment: int
    index: int
    begin: float
    shift: tuple[float, float, float]
    frame: str


@dataclass(frozen=True)
class SupportSlip:
    """The markers' support of a segment (0, 1) turned about an axis by an angle [rad] from a share of each trial on."""

    segment: int
    begin: float
    axis: tuple[float, float, float]
    angle: float


@dataclass(frozen=True)
class PalmSlip:
    """A marker of the palm (0 to 2) shifted [mm] from a share of each trial on."""

    index: int
    begin: float
    shift: tuple[float, float, float]


@dataclass(frozen=True)
class MarkerSwap:
    """Two of a finger's markers (0 to 5) exchanged for a share of each trial."""

    first: int
    second: int
    begin: float
    length: float


@dataclass(frozen=True)
class MarkerFaults:
    """What happens to markers in every trial of a finger."""

    slip: MarkerSlip | None = None
    support: SupportSlip | None = None
    palm: PalmSlip | None = None
    swap: MarkerSwap | None = None
    occlusion: tuple[float, float] | None = None  # shift [mm], share of the time
    scale_drift: float = 0.0  # share over a trial
