"""Recording sessions (`hand-session/1`): what a laboratory hands over, read and checked, nothing interpreted."""

from .check import check_session, moves
from .log import Log, between_rows, read_log, resolution, row_before, rows_lost
from .manifest import read_session
from .mocap import Mocap, read_mocap
from .session import Actuator, Finger, PalmMarkers, Probe, Rig, Segment, Session, Trial

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
    "between_rows",
    "check_session",
    "moves",
    "read_log",
    "read_mocap",
    "read_session",
    "resolution",
    "row_before",
    "rows_lost",
]
