"""How large an effect has to be so that it shows."""

from __future__ import annotations

from .effects import EFFECTS, Drawn, Form, Site
from .gain import Gain, gain_in
from .hand import Finger
from .motor import RunawayError
from .session import Session
from .trial import run_finger

CLEAR_GAIN = 60.0  # [nats]
TRIES = 7
AS_DRAWN = ("asymmetric_friction", "command_as_measurement")
# These stay as they are however plainly they show.
NEVER_SMALLER = (
    "marker_swap",
    "position_dependent_friction",
    "stribeck_friction",
    "command_delay",
    "drive_sag",
    "encoder_periodic_error",
    "distal_stop",
    "coupling_deadband",
    "marker_slip",
    "support_slip",
    "palm_marker_slip",
)


def channel_of(name: str, drawn: Drawn) -> str:
    """Where an effect is looked for; a drive that clips shows in the motion."""
    return "motion" if drawn.figures.get("clips") == "drive" else EFFECTS[name].channel


def gain_of(session: Session, finger: Finger, name: str, drawn: Drawn) -> Gain:
    """Of one effect alone in a finger. Raises RunawayError."""
    channel = channel_of(name, drawn)
    gain = gain_in(channel, session, run_finger(session, finger, [drawn]))
    if channel == "markers":
        return gain
    return gain.above(gain_in(channel, session, run_finger(session, finger, [])))


def next_factor(name: str, gain: Gain, size: float, wanted: float) -> float | None:
    """By what to resize; None where the size will do."""
    if gain.log_likelihood < wanted and size < 4 and gain.rise < 0.5:
        return 1.35 if gain.log_likelihood > wanted / 3 else 1.8
    if gain.rise > 0.9 and gain.log_likelihood > 4 * wanted and name not in NEVER_SMALLER:
        return 0.8
    return None


def clear_size(session: Session, finger: Finger, name: str, form: Form, wanted: float) -> float:
    """Size at which an effect of the table alone brings about `wanted` [nats] in its channel."""
    size = 1.0
    for _ in range(TRIES):
        drawn = EFFECTS[name].draw(Site(session, finger, size, form))
        try:
            if name in AS_DRAWN:
                run_finger(session, finger, [drawn])
                break
            gain = gain_of(session, finger, name, drawn)
        except RunawayError:
            size *= 0.7
            continue
        factor = next_factor(name, gain, size, wanted)
        if factor is None:
            break
        size *= factor
    return size
