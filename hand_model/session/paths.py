"""Paths in a manifest: relative to it, and never out of its folder."""

from __future__ import annotations

from pathlib import Path, PureWindowsPath

from ..errors import did_you_mean
from .node import Node


def inside(node: Node, key: str, root: Path) -> Path:
    """The path under a key, in the session folder `root`; raises SessionError where it leaves it, links followed."""
    text = node.text(key)
    if "\0" in text:
        node.refuse(f"{key} is {text!r}; a path relative to session.toml is needed")
    if Path(text).is_absolute() or PureWindowsPath(text).drive or PureWindowsPath(text).root:
        node.refuse(f'{key} is the absolute path "{text}"; a path relative to session.toml is needed')
    try:
        (root / text).exists()  # names that are too long
        leaves = not (root / text).resolve().is_relative_to(root.resolve())
    except (OSError, RuntimeError, ValueError) as error:  # endless links besides
        node.refuse(f'{key} "{text}" cannot be followed ({error}); a path relative to session.toml is needed')
    if leaves:
        node.refuse(f'{key} "{text}" leaves the session folder; a path inside it is needed')
    return root / text


def existing(node: Node, key: str, root: Path) -> Path:
    """As `inside`, and something is there; raises SessionError with a near file name where nothing is."""
    path = inside(node, key, root)
    if not path.exists():
        there = [*path.parent.glob("*")] or [*root.glob("*/*"), *root.glob("*.*")]
        siblings = [file.relative_to(root).as_posix() for file in there]
        node.refuse(f'{key} "{node.table[key]}" does not exist; {did_you_mean(node.table[key], siblings)}')
    return path
