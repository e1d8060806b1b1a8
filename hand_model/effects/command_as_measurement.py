"""Command as measurement: a channel said to be measured is a command or is dead: it must be refused, not fitted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Effect


class CommandAsMeasurement(Effect):
    """Seen by a channel without noise that the motion does not explain; nothing is fitted to it."""

    name = "command_as_measurement"
    station = "command"
    of_the_hand = False
    unwritten = "the channel is refused: there is nothing to model"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """That nothing is fitted."""
        return (
            f"the {where.get('signal') or 'current'} is no measurement, but a command or a dead channel: "
            "nothing is fitted to it"
        )


EFFECT = CommandAsMeasurement()
