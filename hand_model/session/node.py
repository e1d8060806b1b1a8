"""A table of a TOML file with its place in the file: typed look-ups that refuse in one sentence, unknown keys
counted."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from ..errors import SessionError, did_you_mean


class Node:
    """One table. file: the TOML file; where: how a person finds the table in it, such as `[[finger]] "index"`.

    Keys are read by `text`, `number`, ...; what nobody asked for is reported by `unknown`.
    """

    def __init__(self, file: Path, where: str, table: Mapping[str, Any]) -> None:
        self.file, self.where, self.table = file, where, table
        self._read: set[str] = set()

    def refuse(self, what: str) -> NoReturn:
        """Raise a SessionError that names file and place."""
        raise SessionError(f"{self.file}: {self.where}: {what}" if self.where else f"{self.file}: {what}")

    def has(self, key: str) -> bool:
        """Whether the key is there."""
        return key in self.table

    def get(self, key: str, kind: type | tuple[type, ...], needed: str, default: Any = ...) -> Any:
        """The value of a key; without a default the key must be there. needed: the right type in words."""
        self._read.add(key)
        if key not in self.table:
            if default is not ...:
                return default
            unread = [name for name in self.table if name not in self._read]
            near = difflib.get_close_matches(key, unread, n=1)
            hint = f'; is "{near[0]}" meant to be it?' if near else ""
            self.refuse(f'the key "{key}" is missing, {needed} is needed{hint}')
        value = self.table[key]
        if not isinstance(value, kind) or isinstance(value, bool):
            self.refuse(f"{key} is {_shown(value)}; {needed} is needed")
        return value

    def text(self, key: str, default: Any = ...) -> Any:
        """A text that is not blank."""
        value = self.get(key, str, "a text", default)
        if isinstance(value, str) and (not value.strip() or value != value.strip()):
            self.refuse(f"{key} is {_shown(value)}; a text without blanks around it is needed")
        return value

    def name(self, key: str) -> str:
        """A text that can be part of `finger/segment` and of the names in a description."""
        value = self.text(key)
        if any(letter in value for letter in "/\\:\n\t\0"):
            self.refuse(f"{key} is {_shown(value)}; a name without slash, colon or line break is needed")
        return value

    def choice(self, key: str, valid: Iterable[str], default: Any = ...) -> Any:
        """One of the valid texts."""
        value = self.text(key, default)
        if value is not default and value not in (names := list(valid)):
            self.refuse(f'{key} is "{value}"; {did_you_mean(value, names)}')
        return value

    def positive(self, key: str) -> float | None:
        """A finite number above zero, None where the key is absent."""
        value = self.get(key, (int, float), "a number above zero", None)
        if value is not None and not 0 < value < math.inf:
            self.refuse(f"{key} is {value}; a number above zero is needed")
        return None if value is None else float(value)

    def numbers(self, key: str, count: int, default: Any = ...) -> Any:
        """A list of `count` finite numbers."""
        value = self.get(key, list, f"a list of {count} numbers", default)
        if value is default:
            return value
        if len(value) != count or not all(is_number(x) for x in value):
            self.refuse(f"{key} is {_shown(value)}; a list of {count} numbers is needed")
        return [float(x) for x in value]

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts, each once."""
        value = self.get(key, list, "a list of texts")
        for item in value:
            if not isinstance(item, str) or not item.strip():
                self.refuse(f"{key} holds {_shown(item)}; a list of texts is needed")
        for item in value:
            if value.count(item) > 1:
                self.refuse(f'{key} names "{item}" twice; each name once is needed')
        return tuple(value)

    def child(self, key: str, where: str | None = None) -> Node:
        """A table inside this one."""
        return Node(self.file, where or f"[{key}]", self.get(key, dict, f"a table [{key}]"))

    def children(self, key: str, where: str) -> list[Node]:
        """A list of tables, none where the key is absent; where: what one of them is called."""
        found = self.get(key, list, f"a list of tables {where}", [])
        for entry in found:
            if not isinstance(entry, dict):
                self.refuse(f"{key} holds {_shown(entry)}; tables {where} are needed")
        return [Node(self.file, _place(where, i, entry), entry) for i, entry in enumerate(found, start=1)]

    def unknown(self) -> list[str]:
        """Notes on the keys that nobody asked for, with a near key."""
        place = f"{self.where}: " if self.where else ""
        return [f'{place}unknown key "{key}" was ignored' for key in self.table if key not in self._read]


def is_number(value: Any) -> bool:
    """Whether a TOML value is a finite number (true and false are not)."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _place(where: str, number: int, entry: Mapping[str, Any]) -> str:
    name = entry.get("name") or entry.get("log") or entry.get("mocap")
    return f'{where} "{name}"' if isinstance(name, str) else f"{where} {number}"


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
