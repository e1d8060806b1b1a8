"""From recordings of a real robot hand to a simulated hand that behaves like it, and to the physics that is missing.

    import hand_model

    hand = hand_model.identify("my_session")
    description = hand_model.compile(hand, "bebionic_left")
    residuals = hand_model.replay(description, "my_session")
    findings = hand_model.diagnose("my_session")

Everything below is importable from here and loaded when it is first used.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .check import check as check
    from .checks import mirror as mirror
    from .checks import parallelism as parallelism
    from .checks import repeatability as repeatability
    from .compile import compile as compile
    from .conform import ConformReport as ConformReport
    from .conform import conform as conform
    from .demo import demo as demo
    from .description import Description as Description
    from .description import load as load
    from .description import read_description as read_description
    from .diagnose import Findings as Findings
    from .diagnose import diagnose as diagnose
    from .errors import DescriptionError as DescriptionError
    from .errors import HandFileError as HandFileError
    from .errors import HandModelError as HandModelError
    from .errors import IdentificationError as IdentificationError
    from .errors import MissingDependencyError as MissingDependencyError
    from .errors import SessionError as SessionError
    from .hand import Hand as Hand
    from .hand import load_hand as load_hand
    from .identify import identify as identify
    from .passive import effects_on as effects_on
    from .replay import Residuals as Residuals
    from .replay import replay as replay
    from .report import write_report as write_report
    from .session import Session as Session
    from .session import read_session as read_session
    from .twin import bebionic as bebionic
    from .twin import record as record

# Public name -> module that defines it.
_HOME = {
    "check": "check",
    "mirror": "checks",
    "parallelism": "checks",
    "repeatability": "checks",
    "compile": "compile",
    "ConformReport": "conform",
    "conform": "conform",
    "demo": "demo",
    "Description": "description",
    "load": "description",
    "read_description": "description",
    "Findings": "diagnose",
    "diagnose": "diagnose",
    "DescriptionError": "errors",
    "HandFileError": "errors",
    "HandModelError": "errors",
    "IdentificationError": "errors",
    "MissingDependencyError": "errors",
    "SessionError": "errors",
    "Hand": "hand",
    "load_hand": "hand",
    "identify": "identify",
    "effects_on": "passive",
    "Residuals": "replay",
    "replay": "replay",
    "write_report": "report",
    "Session": "session",
    "read_session": "session",
    "bebionic": "twin",
    "record": "twin",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f".{_HOME[name]}", __name__)
    # A verb and its package share a name (identify): the package is kept, and can be called.
    return module if _HOME[name] == name else getattr(module, name)


def __dir__() -> list[str]:
    return __all__


class _Verb(ModuleType):
    """A module that stands for the function of its own name: hand_model.identify(session)."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return getattr(self, self.__name__.rpartition(".")[2])(*arguments, **options)


class _Package(ModuleType):
    """This package: its verbs become callable when the import system binds their modules here."""

    def __setattr__(self, name: str, value: Any) -> None:
        if _HOME.get(name) == name and isinstance(value, ModuleType):
            value.__class__ = _Verb
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
