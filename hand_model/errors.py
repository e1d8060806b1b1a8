"""Errors that hand_model raises: one root, so that a caller can catch everything that is about the input."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class HandModelError(Exception):
    """Root of all errors of this package: the input or the request is wrong, and the message says what would be
    right."""


class SessionError(HandModelError):
    """A recording session breaks its format; the message names file, trial, column or marker."""


class IdentificationError(HandModelError):
    """The recordings do not hold what an identification needs."""


class HandFileError(HandModelError):
    """A .hand file cannot be read."""


class DescriptionError(HandModelError):
    """A URDF, MJCF or compiled folder cannot be read, or misses what is asked of it."""


class MissingDependencyError(HandModelError):
    """An optional dependency is needed and absent."""


def did_you_mean(word: str, valid: Iterable[str]) -> str:
    """Return a hint such as `did you mean "IP1"? (valid: IP1, IP2)` for a name that is not in `valid`."""
    names = sorted(valid)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    listed = ", ".join(names[:30]) + (", ..." if len(names) > 30 else "")
    hint = f'did you mean "{near[0]}"? ' if near else ""
    return f"{hint}(valid: {listed or 'none'})"
