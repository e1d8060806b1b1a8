"""Damage at random places of a session: a valid reading, or a SessionError, never anything else."""

from __future__ import annotations

import re

import numpy as np
import pytest
from session_writers import MANIFEST, write_session

from hand_model.errors import SessionError
from hand_model.session import read_log, read_mocap, read_session


@pytest.fixture
def root(tmp_path):
    return write_session(tmp_path / "session")


def survives(call, *args):
    try:
        call(*args)
    except SessionError as error:
        assert "\n" not in str(error)
        return 0
    return 1


@pytest.mark.parametrize("name", ["mocap/index.c3d", "mocap/ring.tsv", "log/index.csv"])
def test_cut_and_damaged_recordings(name, root):
    rng = np.random.default_rng(0)
    file = root / name
    data = file.read_bytes()
    read = read_log if name.startswith("log") else read_mocap
    assert survives(read, file)
    for i in range(150):
        file.write_bytes(data[: rng.integers(len(data))])
        cut = survives(read, file)
        assert not (cut and name.endswith("c3d")), "a C3D that ends early was taken for a whole one"
    for i in range(150):
        damaged = bytearray(data)
        places = rng.integers(0, len(data) if i % 2 else 1500, rng.integers(1, 8))
        for place in places:
            damaged[place] = rng.integers(256)
        file.write_bytes(damaged)
        survives(read, file)


def test_cut_and_damaged_manifest(root):
    rng = np.random.default_rng(0)
    data = (root / "session.toml").read_bytes()
    for i in range(300):
        damaged = bytearray(data[: rng.integers(len(data))] if i % 3 == 0 else data)
        for place in rng.integers(0, len(damaged), rng.integers(0, 5)) if damaged else ():
            damaged[place] = rng.choice(np.frombuffer(data, "u1")) if i % 2 else rng.integers(256)
        (root / "session.toml").write_bytes(damaged)
        survives(read_session, root)


def test_every_value_of_the_manifest_replaced_by_another_type(root):
    values = ["5", "true", '"x"', "[]", "{}", "[[1]]", "{ a = 1 }", "nan", "1979-05-27"]
    places = list(re.finditer(r"= (.+)$", MANIFEST, re.MULTILINE))
    assert len(places) > 30
    for place in places:
        for value in values:
            (root / "session.toml").write_text(MANIFEST[: place.start(1)] + value + MANIFEST[place.end(1) :], "utf-8")
            survives(read_session, root)
