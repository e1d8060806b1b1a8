"""All effects by name."""

from . import effects_chain, effects_drive, effects_friction, effects_load, effects_slips, outside
from .effect import Effect

VOCABULARY: tuple[Effect, ...] = (
    effects_friction.EFFECTS
    + effects_load.EFFECTS
    + effects_chain.EFFECTS
    + effects_drive.EFFECTS
    + effects_slips.EFFECTS
)
OUTSIDE: tuple[Effect, ...] = outside.EFFECTS
