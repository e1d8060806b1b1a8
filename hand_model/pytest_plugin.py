"""pytest: two descriptions of one hand must agree.

One line of set-up, in pytest.ini or under [tool.pytest.ini_options], one hand per line, paths relative to that file:

    hand_conform = my_hand.urdf my_hand.xml pair.toml

or, without any file: `pytest --hand-conform my_hand.urdf my_hand.xml [--hand-conform-pair pair.toml]`.
"""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the two options and the ini line."""
    group = parser.getgroup("hand_model")
    group.addoption(
        "--hand-conform", nargs=2, metavar=("A", "B"), help="two descriptions (URDF or MJCF) that must agree"
    )
    group.addoption("--hand-conform-pair", metavar="TOML", help="which names of --hand-conform correspond")
    parser.addini("hand_conform", "lines 'A B [pair.toml]': descriptions that must agree", type="linelist", default=[])


def pytest_collection_modifyitems(session: pytest.Session, config: pytest.Config, items: list[pytest.Item]) -> None:
    """One test per pair of descriptions."""
    root = config.inipath.parent if config.inipath else config.rootpath
    rows = [[root / word for word in shlex.split(line)] for line in config.getini("hand_conform")]
    if wanted := config.getoption("hand_conform"):
        pair = config.getoption("hand_conform_pair")
        rows.append([config.invocation_params.dir / word for word in (*wanted, *([pair] if pair else []))])
    for row in rows:
        if len(row) not in (2, 3):
            raise pytest.UsageError("hand_conform: a line names two descriptions and, if need be, a pair.toml")
        name = f"{row[0].name} = {row[1].name}"
        items.append(ConformItem.from_parent(session, name=name, nodeid=f"hand_conform::{name}", files=row))


class Disagreement(Exception):
    """Two descriptions differ; the message is the report."""


class ConformItem(pytest.Item):
    """The test that one pair of descriptions agrees."""

    def __init__(self, files: list[Path], **kwargs) -> None:
        super().__init__(**kwargs)
        self.files = files

    def runtest(self) -> None:
        """Compare; fail with the report."""
        from .conform import conform

        report = conform(*self.files)
        if not report.ok:
            raise Disagreement(report.text())

    def repr_failure(self, excinfo, style=None) -> str:
        """The report or the reader's sentence instead of a traceback."""
        return str(excinfo.value)

    def reportinfo(self):
        """Where the test stands: the first description."""
        return self.files[0], None, self.name
