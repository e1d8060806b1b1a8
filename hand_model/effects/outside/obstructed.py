"""A segment that an obstacle holds back: what the current shows as an external contact bends the linkage as well."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..base import Array, DriveState
from ..external_contact import LASTING, ExternalContact
from .outsider import Outsider


class Obstructed(Outsider, ExternalContact):
    """follower = map(driver) - k max(0, driver - x0) for a while of one trial or of every trial: the segment stays
    behind as far as its driver presses it against something that was not always there."""

    name = "obstructed"
    station = "linkage"
    part_of = "external_contact"
    repeats = False  # whiles that follow each other would be a stop

    def columns(self, state: DriveState, shape: Mapping[str, float]) -> Array:
        """How far it is pressed, taken from the angle; (n, 1 + 2 MOST_VALIDATION)."""
        return -super().columns(state, shape)

    def sentence(self, where: Mapping[str, Any], parameters: Mapping[str, float]) -> str:
        """From which angle of the driver on."""
        return (
            f"something holds the {where.get('joint') or 'distal'} segment back for a while, "
            f"once the joint before it is at {parameters['begin']:.1f} deg"
        )

    def _all_along(self, shape: Mapping[str, float]) -> bool:
        """Of a single recording, too: what is there all along is a stop or the linkage itself."""
        return shape["until"] - shape["since"] > LASTING


EFFECT = Obstructed()
