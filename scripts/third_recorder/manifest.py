"""The session's manifest, `session.toml`."""

from __future__ import annotations

from .hand import SEGMENTS, Session


def head(session: Session) -> list[str]:
    """Hand, world, palm, probe, actuators and fingers."""
    parts = [f'format = "hand-session/1"\n\n[hand]\nname = "{session.name}"\nside = "{session.side}"\n']
    if session.laboratory.gravity_given:
        parts.append("[world]\ngravity = [0.0, 0.0, -9.81]\n")
    probe = ", ".join(f"{label} = [{', '.join(f'{x:.5f}' for x in at)}]" for label, at in session.probe.items())
    parts.append(
        f'[palm]\nmarkers = {{ origin = "PO", medial = "PM", lateral = "PL" }}\n\n[probe]\nmarkers = {{ {probe} }}\n'
    )
    for finger in session.fingers.values():
        parts.append(f'[[actuator]]\nname = "{finger.actuator}"\nspeed_full = 255\ncurrent_full = 255\n')
    for finger in session.fingers.values():
        segments = ""
        for name, labels in zip(SEGMENTS, finger.labels, strict=True):
            quoted = ", ".join(f'"{label}"' for label in labels)
            segments += f'  {{ name = "{name}", markers = [{quoted}] }},\n'
        parts.append(f'[[finger]]\nname = "{finger.name}"\nactuator = "{finger.actuator}"\nsegments = [\n{segments}]\n')
    return parts


def entry(**keys: str | None) -> str:
    """One trial; a key that is None is left out."""
    lines = [f'{key} = "{value}"' for key, value in keys.items() if value is not None]
    return "\n".join(["[[trial]]", *lines, ""])
