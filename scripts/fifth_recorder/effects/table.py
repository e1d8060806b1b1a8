"""All effects by name."""

from fifth_recorder.effects.friction import FRICTION
from fifth_recorder.effects.geometry import GEOMETRY
from fifth_recorder.effects.loads import LOADS
from fifth_recorder.effects.marking import MARKING
from fifth_recorder.effects.option import Draw
from fifth_recorder.effects.outside_body import OUTSIDE_BODY
from fifth_recorder.effects.outside_motor import OUTSIDE_MOTOR
from fifth_recorder.effects.recording import RECORDING
from fifth_recorder.effects.transmission import TRANSMISSION

INSIDE: dict[str, Draw] = {**FRICTION, **LOADS, **TRANSMISSION, **GEOMETRY, **RECORDING, **MARKING}
OUTSIDE: dict[str, Draw] = {**OUTSIDE_MOTOR, **OUTSIDE_BODY}
EXCLUSIVE = ("command_as_measurement", "marker_swap")  # absurd as a background of something else
