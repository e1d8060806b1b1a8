"""Diagnosis: where a recording differs from the declared model, what was left out, and how sure that is."""

from __future__ import annotations

from typing import Any

from .findings import Finding, Findings

__all__ = ["Finding", "Findings", "diagnose"]


def __getattr__(name: str) -> Any:
    if name == "diagnose":
        from .diagnosis import diagnose

        return diagnose
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
