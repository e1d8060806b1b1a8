"""The motor of a finger: friction, spring, inertia and controller from the hand's own log."""

from .fit import MotorFit, fit_motor, identify_motor, identify_motors

__all__ = ["MotorFit", "fit_motor", "identify_motor", "identify_motors"]
