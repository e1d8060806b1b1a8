"""Rigs: recordings of any mechanism with joints, against the MJCF that a laboratory declares for it."""

from .declared import DeclaredFit, fit_declared
from .diagnose import diagnose_rig
from .findings import Finding, Findings, RigFindings
from .model import RigModel, RigTrial, load_rig
from .replay import RigResiduals, replay_rig, simulate_trial

__all__ = [
    "DeclaredFit",
    "Finding",
    "Findings",
    "RigFindings",
    "RigModel",
    "RigResiduals",
    "RigTrial",
    "diagnose_rig",
    "fit_declared",
    "load_rig",
    "replay_rig",
    "simulate_trial",
]
