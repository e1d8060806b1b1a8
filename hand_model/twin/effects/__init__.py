"""Effects that the twin can hide, grouped by the station of the signal path where they act."""

from . import channel, friction, kinematics, load, outside, recording, transmission

__all__ = ["channel", "friction", "kinematics", "load", "outside", "recording", "transmission"]
