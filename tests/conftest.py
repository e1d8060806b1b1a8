"""One thread per numerical library, and what the tests of the command line share: a session, and what is made of it."""

import os

import pytest

# before any library is loaded: the matrices are small, and threads only get in each other's way
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """A small session of one finger whose marker files are text."""
    from hand_model.twin import Plan, bebionic, record

    folder = tmp_path_factory.mktemp("cli") / "session"
    plan = Plan(flexion=("full", "half", "full"), validation=("half",), excitations=0, still_s=0.3)
    record(bebionic("left", fingers=["index"]), folder, 1, plan=plan, mocap_format="tsv")
    return folder


@pytest.fixture(scope="session")
def loop(recorded, tmp_path_factory):
    """Hand, compiled folder and report, made by the three commands."""
    from hand_model.cli import main

    out = tmp_path_factory.mktemp("loop")
    assert main(["identify", str(recorded), "--output", str(out / "left.hand")]) == 0
    assert main(["compile", str(out / "left.hand"), "--output", str(out / "compiled")]) == 0
    assert main(["replay", str(out / "compiled"), str(recorded), "--output", str(out / "report")]) == 0
    return out
