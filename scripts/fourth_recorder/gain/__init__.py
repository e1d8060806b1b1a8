"""How plainly an effect shows in a channel: what the truth brings over the best healthy model."""

from __future__ import annotations

from collections.abc import Sequence

from ..session import Session
from ..trial import Trial
from .current import current_gain
from .gain import Gain
from .markers import marker_gain
from .motion import motion_gain

__all__ = ["Gain", "gain_in"]


def gain_in(channel: str, session: Session, trials: Sequence[Trial]) -> Gain:
    """channel: current, motion or markers; trials: all of one finger."""
    return {"current": current_gain, "motion": motion_gain, "markers": marker_gain}[channel](session, trials)
