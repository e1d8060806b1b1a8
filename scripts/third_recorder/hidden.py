"""What effects put on a finger or a session besides the parameters of motor and linkage."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .geometry import Array


@dataclass
class Clipping:
    """A current cut off at a level [raw], in the drive or in its reading alone, for a share of the motion."""

    where: str
    share: float
    level: float | None = None


@dataclass(frozen=True)
class Sine:
    """amplitude [raw], rate [Hz], phase [rad]."""

    amplitude: float
    hz: float
    phase: float = 0.0


@dataclass(frozen=True)
class Warming:
    """Share by which the current per force has risen once warm; time constant [s]."""

    rise: float
    time_s: float


@dataclass(frozen=True)
class Bend:
    """Turn of the palm about an axis per raw of current [rad]."""

    axis: Array
    rad_per_raw: float


@dataclass(frozen=True)
class Ringing:
    """A marker support on a spring: peak [mm], rate [Hz], damping ratio, segment."""

    peak_mm: float
    hz: float
    damping: float
    joint: int


@dataclass
class FingerFaults:
    """What acts on a finger, or on what is written of it; None and 0: nothing does."""

    touched_share: float | None = None  # of a trial during which an obstacle is there
    lift: float | None = None  # [%] a hand pushes the finger beyond its drive
    clipping: Clipping | None = None
    current_delay_s: float = 0.0
    faked: str | None = None  # which column is not what it says
    current_gain: Warming | None = None
    palm_bend: Bend | None = None
    wander: Sine | None = None
    tremor: Sine | None = None
    ringing: Ringing | None = None


@dataclass
class Slip:
    """A shift [mm] and turn [rad] of a marker, a support or a marker on the palm, for good, at a fraction of the first
    flexion of a finger."""

    what: str  # "marker", "support" or "palm"
    finger: str
    fraction: float
    shift: Array
    joint: int = 0
    marker: int = 0
    turn: Array = field(default_factory=lambda: np.zeros(3))
    session_s: float = np.inf  # when it happens, known once the trials are


@dataclass(frozen=True)
class Swap:
    """Labels of two markers, each (segment, index), exchanged for spells of (fraction of the trial, seconds)."""

    finger: str
    first: tuple[int, int]
    second: tuple[int, int]
    spells: list[tuple[float, float]]


@dataclass(frozen=True)
class Bursts:
    """Noise on the current for a while, again and again: spread [raw], length and mean pause [s]."""

    finger: str
    spread: float
    length_s: float
    pause_s: float


@dataclass(frozen=True)
class Lens:
    """A wrong lens model of the cameras: centre away from the hand, displacement at 100 mm [mm], form."""

    centre: Array
    size: float
    form: int


@dataclass
class SessionFaults:
    """What acts on a whole session."""

    slips: list[Slip] = field(default_factory=list)
    swaps: list[Swap] = field(default_factory=list)
    bursts: Bursts | None = None
    lens: Lens | None = None
    clock_jump_s: float = 0.0
