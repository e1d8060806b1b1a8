"""Drive sag: the drive delivers less per command as it is loaded (supply, bus current limit, back-EMF)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Effect


class DriveSag(Effect):
    """Steady speed = commanded speed (1 - sag * load), the load being the current in the direction of motion."""

    name = "drive_sag"
    station = "command"
    unwritten = "the controller's speed under load is no force: the command must be slowed by whoever gives it"

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """Speed lost per load."""
        return f"the motor loses {1e4 * parameters['sag']:.1f} % of its speed for every 100 raw of current that its load takes"


EFFECT = DriveSag()
