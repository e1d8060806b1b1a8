"""Session -> Hand: rigid bodies and probe, frames, axes, centres, the whole chain, clocks, encoder maps, linkages,
surfaces."""

from .identification import Identification, identify, identify_all
from .surface import Surface, identify_surfaces

__all__ = ["Identification", "Surface", "identify", "identify_all", "identify_surfaces"]
