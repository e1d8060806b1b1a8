"""Everything that a session may hide."""

from eighth_recorder.channels import CHANNELS
from eighth_recorder.friction import FRICTION
from eighth_recorder.load import LOADS
from eighth_recorder.outside import OUTSIDE_PHYSICS
from eighth_recorder.outside_recording import OUTSIDE_RECORDING
from eighth_recorder.segments import SEGMENTS
from eighth_recorder.slips import SLIPS
from eighth_recorder.transmission import TRANSMISSION

VOCABULARY = FRICTION + LOADS + TRANSMISSION + SEGMENTS + CHANNELS + SLIPS
OUTSIDE = OUTSIDE_PHYSICS + OUTSIDE_RECORDING


def coexist(a, b) -> bool:
    """Whether two effects can be in one recording without one erasing the other."""
    return a is not b and b.name not in a.clashes and a.name not in b.clashes
