"""What is done to one finger's recordings: a healthy motor plus hooks, by the stage at which they act."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field

import numpy as np

from fifth_recorder.dynamics import Dynamics
from fifth_recorder.finger import Finger
from fifth_recorder.lab import Lab
from fifth_recorder.strokes import Move


@dataclass
class Trial:
    """One recording of one finger."""

    kind: str
    name: str  # file stem
    finger: str
    moves: list[Move]
    end: float  # s
    at: float  # s of session time at which it starts
    validate: bool
    seed: int
    index: int  # among the finger's trials
    pose: np.ndarray  # (3, 3) palm frame in the world

    def rng(self, purpose: int) -> np.random.Generator:
        """Random numbers of this trial alone, the same each time it is recorded."""
        return np.random.default_rng([self.seed, purpose])


@dataclass
class Motion:
    """What the finger does, on the DT grid: t s; s share of range; angles rad; loads raw; offsets m in the palm."""

    trial: Trial
    t: np.ndarray
    v: np.ndarray  # %/s
    load: np.ndarray  # transmitted to the finger
    contact: np.ndarray
    s: np.ndarray
    q1: np.ndarray
    link: np.ndarray  # proximal angle as the linkage feels it
    q2: np.ndarray
    shift: list[np.ndarray] = field(default_factory=list)  # of each joint's centre
    wobble: list[tuple[int, np.ndarray, np.ndarray]] = field(default_factory=list)  # joint, axis, angle


@dataclass
class Signals:
    """What the drive could log, on the DT grid: x % of range, u raw, setpoint %."""

    trial: Trial
    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    v: np.ndarray
    setpoint: np.ndarray
    xref: np.ndarray
    extra: dict[str, np.ndarray] = field(default_factory=dict)
    late: float = 0.0  # s by which x is older than it claims


@dataclass
class Rows:
    """What the log says, one value per row; `time` on the log's clock before its offset, s."""

    trial: Trial
    time: np.ndarray
    position: np.ndarray  # counts
    current: np.ndarray  # raw
    setpoint: np.ndarray
    speed: np.ndarray
    noisy: bool


@dataclass
class Frames:
    """Marker positions (frames, markers, 3), m; palm frame at stage `markers`, world at stage `world`."""

    trial: Trial
    t: np.ndarray
    points: np.ndarray  # palm 0-2, proximal 3-5, distal 6-8
    q1: np.ndarray
    turn1: np.ndarray  # (frames, 3, 3) of the proximal segment
    turn2: np.ndarray
    load: np.ndarray


@dataclass
class Plan:
    """A finger, its motor and everything hidden in its recordings."""

    finger: Finger
    lab: Lab
    dyn: Dynamics
    per_trial: list[Callable] = field(default_factory=list)  # (Dynamics, Trial)
    drive: list[Callable] = field(default_factory=list)  # (Drive, Trial, t)
    delay: list[Callable] = field(default_factory=list)  # (Trial) -> s per move
    input: list[Callable] = field(default_factory=list)  # (Motion): s
    proximal: list[Callable] = field(default_factory=list)  # (Motion): q1
    link: list[Callable] = field(default_factory=list)  # (Motion): link
    distal: list[Callable] = field(default_factory=list)  # (Motion): q2
    pose: list[Callable] = field(default_factory=list)  # (Motion): shift, wobble
    markers: list[Callable] = field(default_factory=list)  # (Frames)
    world: list[Callable] = field(default_factory=list)  # (Frames)
    frames: list[Callable] = field(default_factory=list)  # (Trial, capture times) -> times really shown
    signals: list[Callable] = field(default_factory=list)  # (Signals)
    rows: list[Callable] = field(default_factory=list)  # (Rows)

    def acts_on_motor(self) -> bool:
        """Whether the motor moves or draws otherwise than the healthy one."""
        return bool(self.per_trial or self.drive or self.delay) or self.dyn != self.finger.motor

    def acts_on_body(self) -> bool:
        """Whether finger, markers or clocks do otherwise than the healthy ones at the same motor position."""
        return any(
            (
                self.input,
                self.proximal,
                self.link,
                self.distal,
                self.pose,
                self.markers,
                self.world,
                self.frames,
                self.signals,
                self.rows,
            )
        )


def healthy(finger: Finger, lab: Lab) -> Plan:
    """A plan that hides nothing."""
    return Plan(finger, lab, copy(finger.motor))
