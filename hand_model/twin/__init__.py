"""The twin: a recorder of hands with something hidden in them. Shares no code with what it is meant to test."""

from . import effects as _effects  # noqa: F401  (fills the catalogue)
from .bebionic import bebionic
from .case import KINDS, Case, draw_case, outside, vocabulary
from .influence import CATALOGUE, Hidden
from .record import Answer, TrialTruth, record
from .schedule import Plan
from .truth import FingerTruth, HandTruth, JointTruth, LogNoise, MocapNoise, MotorTruth

__all__ = [
    "CATALOGUE",
    "KINDS",
    "Answer",
    "Case",
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
    "draw_case",
    "outside",
    "record",
    "vocabulary",
]
