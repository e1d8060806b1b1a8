"""Session -> Hand: rigid bodies and probe, frames, axes, centres, the whole chain, clocks, encoder maps, linkages."""

from .identification import Identification, identify, identify_all

__all__ = ["Identification", "identify", "identify_all"]
