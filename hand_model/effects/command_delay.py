"""Command delay: the drive acts later than told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Effect
from .mjcf import delay, motor_joint


class CommandDelay(Effect):
    """The current leaves its resting level a dead time after the setpoint changed; read from events, not from a
    balance."""

    name = "command_delay"
    station = "command"
    unwritten = "shown by events: the answer to a command, not an error along a motion"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """The dead time."""
        return f"the motor answers its commands {1e3 * parameters['delay']:.0f} ms late"

    def write_mjcf(self, root: Any, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str | None:
        """The delay of the motor's actuator."""
        found = motor_joint(root, where)
        if found is None:
            return None
        drive = next(a for a in root.iterfind("actuator/general") if a.get("name") == where["actuator"])
        return delay(root, drive, parameters["delay"])


EFFECT = CommandDelay()
