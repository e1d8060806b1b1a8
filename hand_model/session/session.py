"""What a session holds: hand, palm, probe, actuators, fingers, rig, trials. Plain data; the manifest reader fills
it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SessionError, did_you_mean
from .log import Log, read_log
from .mocap import Mocap, read_mocap
from .repeats import without_repeats
from .stamps import evened

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PalmMarkers:
    """Labels of the three palm markers."""

    origin: str
    medial: str
    lateral: str

    @property
    def labels(self) -> tuple[str, str, str]:
        """The labels in the order origin, medial, lateral."""
        return self.origin, self.medial, self.lateral


@dataclass(frozen=True)
class Probe:
    """The pointing tool. labels: marker labels. position_probe: (m, 3) [m] in its own frame, tip at the origin;
    None where the tip is not known and a `pivot` trial calibrates it."""

    labels: tuple[str, ...]
    position_probe: Array | None


@dataclass(frozen=True)
class Actuator:
    """One motor: one encoder channel, one current channel. speed_full, current_full: raw full scales."""

    name: str
    speed_full: float | None = None
    current_full: float | None = None


@dataclass(frozen=True)
class Segment:
    """One moving segment of a finger and the labels of its markers (three or more, not on one line)."""

    name: str
    markers: tuple[str, ...]


@dataclass(frozen=True)
class Finger:
    """A finger: its actuator (None for kinematics only) and its segments from the palm outwards."""

    name: str
    actuator: str | None
    segments: tuple[Segment, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """All marker labels of the finger, palm outwards."""
        return tuple(label for segment in self.segments for label in segment.markers)


@dataclass(frozen=True)
class Rig:
    """A recorded mechanism that is no hand. model: its MJCF file. signals: log column -> quantity of the model."""

    model: Path
    signals: Mapping[str, str]


@dataclass(frozen=True)
class Trial:
    """One recording. name: its file relative to the session, log before mocap; set: parameters the laboratory changed.

    actuator: the finger's, which picks the channel out of a bag that holds several.
    """

    kind: str
    name: str
    finger: str | None = None
    mocap_path: Path | None = None
    log_path: Path | None = None
    landmark: str | None = None
    joint: str | None = None
    side: str | None = None
    segment: str | None = None
    object: str | None = None
    stiffness: float | str | None = None
    validate: bool = False
    set: Mapping[str, Any] = field(default_factory=dict)
    actuator: str | None = None

    def mocap(self) -> Mocap:
        """Read the marker trajectories; raises SessionError where the trial has none."""
        if self.mocap_path is None:
            raise SessionError(f'trial "{self.name}" ({self.kind}) has no mocap file')
        return read_mocap(self.mocap_path)

    def log(self) -> Log:
        """Read the actuator log, a hand's without rows that repeat what was read before them and with times that its
        motion follows; raises SessionError where the trial has none."""
        if self.log_path is None:
            raise SessionError(f'trial "{self.name}" ({self.kind}) has no log')
        log = read_log(self.log_path, self.actuator)
        return log if self.kind == "motion" else evened(without_repeats(log))


@dataclass(frozen=True)
class Session:
    """A recording session. side: "left" | "right". gravity_world: (3,) [m/s^2] or None. notes: what was ignored."""

    path: Path
    hand: str
    side: str
    gravity_world: Array | None
    palm: PalmMarkers | None
    probe: Probe | None
    actuators: tuple[Actuator, ...]
    fingers: tuple[Finger, ...]
    trials: tuple[Trial, ...]
    rig: Rig | None = None
    notes: tuple[str, ...] = ()

    def finger(self, name: str) -> Finger:
        """The finger of that name; raises SessionError with a near name."""
        for finger in self.fingers:
            if finger.name == name:
                return finger
        raise SessionError(f'{self.path}: no finger "{name}"; {did_you_mean(name, [f.name for f in self.fingers])}')

    def select(self, kind: str, finger: str | None = None, validate: bool | None = None) -> tuple[Trial, ...]:
        """Trials of one kind, optionally of one finger, optionally only (True) or never (False) validation trials."""
        return tuple(
            t
            for t in self.trials
            if t.kind == kind
            and (finger is None or t.finger == finger)
            and (validate is None or t.validate == validate)
        )
