"""Recording sessions (`hand-session/1`): what a laboratory hands over, read and checked, nothing interpreted."""

from .log import Log, read_log
from .manifest import (
    Actuator,
    Finger,
    PalmMarkers,
    Probe,
    Rig,
    Segment,
    Session,
    Trial,
    read_session,
)
from .mocap import Mocap, read_mocap

__all__ = [
    "Actuator",
    "Finger",
    "Log",
    "Mocap",
    "PalmMarkers",
    "Probe",
    "Rig",
    "Segment",
    "Session",
    "Trial",
    "read_log",
    "read_mocap",
    "read_session",
]
