"""The text of session.toml."""

from __future__ import annotations

from .hand import PALM_LABELS, SEGMENTS, Finger, Hand

PROBE = {
    "T1": (0.0, 0.0, 85.0),
    "T2": (0.0, 0.0, 125.0),
    "T3": (34.0, 0.0, 110.0),
    "T4": (-26.0, 8.0, 118.0),
}  # [mm] from its tip


def head(hand: Hand) -> list[str]:
    """Everything before the trials."""
    palm = ", ".join(f'{name} = "{label}"' for name, label in zip(hand.landmarks, PALM_LABELS, strict=True))
    probe = ", ".join(f"{label} = [{', '.join(repr(v / 1000) for v in place)}]" for label, place in PROBE.items())
    lines = ['format = "hand-session/1"', "", "[hand]", 'name = "bebionic"', f'side = "{hand.side}"', ""]
    lines += ["[palm]", f"markers = {{ {palm} }}", ""]
    lines += ["[world]", f"gravity = [{', '.join(repr(value) for value in hand.gravity)}]", ""]
    lines += ["[probe]", f"markers = {{ {probe} }}", ""]
    for name in hand.fingers:
        lines += ["[[actuator]]", f'name = "{name}"', "speed_full = 255", "current_full = 255", ""]
    for finger in hand.fingers.values():
        lines += finger_lines(finger)
    return lines


def finger_lines(finger: Finger) -> list[str]:
    """A finger, its actuator and the markers of its segments."""
    lines = ["[[finger]]", f'name = "{finger.name}"', f'actuator = "{finger.name}"', "segments = ["]
    for i, segment in enumerate(SEGMENTS):
        labels = ", ".join(f'"{label}"' for label in finger.labels[3 * i : 3 * i + 3])
        lines.append(f'  {{ name = "{segment}", markers = [{labels}] }},')
    return [*lines, "]", ""]


def trial_lines(**entries: str) -> list[str]:
    """One trial."""
    return ["[[trial]]", *(f'{key} = "{value}"' for key, value in entries.items()), ""]
