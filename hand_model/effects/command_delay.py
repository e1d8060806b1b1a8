"""Command delay: the drive acts later than told."""

from __future__ import annotations

from .base import Effect


class CommandDelay(Effect):
    """The current leaves its resting level a dead time after the setpoint changed; read from events, not from a balance."""

    name = "command_delay"
    station = "command"


EFFECT = CommandDelay()
