"""What is hidden in sessions that come with an answer.json, and whether findings say so and nothing else."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

Place = tuple[str, str | None]  # an effect and its finger, None where it is of no finger in particular


def answer_of(session: Path) -> dict[str, Any]:
    """The answer of a session folder."""
    return json.loads((session / "answer.json").read_text())


def hidden_in(session: Path) -> list[Place]:
    """Effects and fingers of a session folder's answer."""
    return [(e["effect"], e["finger"]) for e in answer_of(session)["effects"] if e["effect"] != "none"]


def all_named(named: Sequence[Place], hidden: Sequence[Place]) -> bool:
    """Whether each hidden effect is named, in its finger or in none, and nothing else is."""

    def says(n: Place, h: Place) -> bool:
        return n == h or n[0] == h[0] and n[1] is None

    both = all(any(says(n, h) for h in hidden) for n in named) and all(any(says(n, h) for n in named) for h in hidden)
    return both and len(named) == len(hidden)
