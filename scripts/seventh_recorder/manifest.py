"""The text of session.toml."""

from .hand import Hand

HEAD = """format = "hand-session/1"

[hand]
name = "bebionic"
side = "{side}"

[palm]
markers = {{ origin = "PO", medial = "PM", lateral = "PL" }}

[world]
gravity = [0.0, 0.0, -9.81]

[probe]
markers = {{ T1 = [0.0, 0.0, 0.085], T2 = [0.0, 0.0, 0.125], T3 = [0.034, 0.0, 0.11], T4 = [-0.026, 0.008, 0.118] }}
"""
ACTUATOR = """
[[actuator]]
name = "{name}"
speed_full = 255
current_full = 255
"""
FINGER = """
[[finger]]
name = "{name}"
actuator = "{name}"
segments = [
  {{ name = "proximal", markers = [{proximal}] }},
  {{ name = "distal", markers = [{distal}] }},
]
"""


def trial_text(**fields: str) -> str:
    """One [[trial]] table."""
    return "\n[[trial]]\n" + "".join(f'{key} = "{value}"\n' for key, value in fields.items())


def manifest(hand: Hand, trials: list[dict[str, str]]) -> str:
    """The whole session.toml."""
    text = HEAD.format(side=hand.side)
    text += "".join(ACTUATOR.format(name=f.name) for f in hand.fingers)
    for finger in hand.fingers:
        quoted = [f'"{label}"' for label in finger.labels]
        text += FINGER.format(name=finger.name, proximal=", ".join(quoted[:3]), distal=", ".join(quoted[3:]))
    return text + "".join(trial_text(**trial) for trial in trials)
