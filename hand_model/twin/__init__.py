"""The twin: a recorder of hands with something hidden in them. Shares no code with identification, compilation or diagnosis."""

from .bebionic import bebionic
from .influence import Hidden
from .record import Answer, TrialTruth, record
from .schedule import Plan
from .truth import FingerTruth, HandTruth, JointTruth, LogNoise, MocapNoise, MotorTruth

__all__ = [
    "Answer",
    "FingerTruth",
    "HandTruth",
    "Hidden",
    "JointTruth",
    "LogNoise",
    "MocapNoise",
    "MotorTruth",
    "Plan",
    "TrialTruth",
    "bebionic",
    "record",
]
