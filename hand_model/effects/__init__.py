"""Effects: what a declared model may have left out, one file each, found by `catalogue()`."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import Any

from .base import DriveEffect, DriveState, Effect, Shape

__all__ = ["DriveEffect", "DriveState", "Effect", "Shape", "catalogue", "effect", "outsiders"]


@cache
def _modules(package: str = __name__) -> tuple[Any, ...]:
    found = []
    for info in sorted(pkgutil.iter_modules(importlib.import_module(package).__path__), key=lambda m: m.name):
        module = importlib.import_module(f"{package}.{info.name}")
        if hasattr(module, "EFFECT"):
            found.append(module.EFFECT)
    return tuple(found)


def catalogue(station: str | None = None) -> tuple[Any, ...]:
    """Every effect in this folder, by name; `station` keeps those of one balance ("drive", "encoder", "linkage",
    ...)."""
    return tuple(e for e in _modules() if station is None or e.station == station)


def outsiders(station: str) -> tuple[Any, ...]:
    """What no row of the table holds and would be taken for one, of one balance: it competes beside the catalogue and
    is never a finding."""
    return tuple(e for e in _modules(f"{__name__}.outside") if e.station == station)


def effect(name: str) -> Any:
    """The effect of that name; raises DescriptionError with a near name."""
    from ..errors import DescriptionError, did_you_mean

    for candidate in _modules():
        if candidate.name == name:
            return candidate
    raise DescriptionError(f'no effect "{name}"; {did_you_mean(name, [e.name for e in _modules()])}')
