"""Compilation: a Hand into a folder with URDF and MJCF."""

from .folder import compile

__all__ = ["compile"]
