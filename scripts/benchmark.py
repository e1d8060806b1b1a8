"""Speed of identification, each figure beside a baseline measured in the same run.

    OMP_NUM_THREADS=1 python scripts/benchmark.py [RESULT.json]

One finger (40 s at 100 Hz, nine markers, every frame, with covariance) by the chain likelihood, by the published
method, and by scipy's general least squares with the sparsity of the same problem given to it (few frames: it is slow);
ten times the frames; a six-finger hand from session to report. Sessions are the twin's, recorded into a temporary
folder first.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import lil_matrix
from scipy.spatial.transform import Rotation

from hand_model.compile import compile
from hand_model.identify import identify
from hand_model.identify.chain import Chain, ChainData, Pose, propagate
from hand_model.identify.finger import observations
from hand_model.identify.identification import palm_shape
from hand_model.identify.likelihood import fit_chain, fit_poses
from hand_model.identify.published import published_joint
from hand_model.identify.start import start_chain
from hand_model.output import new_file
from hand_model.replay import replay
from hand_model.report import write_report
from hand_model.session import Session, read_session
from hand_model.twin import Plan, bebionic, record

SECONDS, RATE_HZ = 40.0, 100.0
# Frames given to the general solver; its time per frame only grows with more.
FEW = 100


def processor_s() -> float:
    """Processor time [s] of this process and of those that it has waited for."""
    multiprocessing.active_children()  # collects those that have ended, which is when their time counts
    return sum(os.times()[:4])


def timed(call: Callable[[], Any], repeats: int = 1) -> tuple[Any, dict[str, float]]:
    """Result, and the least wall clock and processor time [s] of several calls."""
    wall, processor, result = [], [], None
    for _ in range(repeats):
        at, busy = time.perf_counter(), processor_s()
        result = call()
        wall.append(time.perf_counter() - at)
        processor.append(processor_s() - busy)
    return result, {"wall_s": min(wall), "processor_s": min(processor)}


def finger_data(session: Session, seconds: float) -> tuple[ChainData, np.ndarray, np.ndarray]:
    """Observations of the index finger, frames at rest, shape of the palm markers."""
    finger = session.finger("index")
    mocap = session.select("flexion", "index", validate=False)[0].mocap()
    data, _ = observations(session, finger, mocap)
    frames = np.flatnonzero(mocap.time_s < seconds)
    return data.take(frames), np.flatnonzero(mocap.time_s < 1.0), palm_shape(session)


def by_likelihood(data: ChainData, rest: np.ndarray, shape: np.ndarray) -> Any:
    """All frames, with covariance."""
    return fit_chain(data, start_chain(data, rest, shape))


def by_published(data: ChainData, rest: np.ndarray, shape: np.ndarray) -> Any:
    """Axis and centre of each joint, no covariance."""
    chain = start_chain(data, rest, shape)
    return [published_joint(data, chain, joint, None) for joint in range(data.n_joints)]


def by_general_solver(data: ChainData, start: Chain, noise_m: float) -> Any:
    """The same unknowns by scipy.optimize.least_squares with sparse differences; returns its result."""
    n, m, k = len(data.position_world), len(data.body), data.n_joints
    seen = np.isfinite(data.position_world)
    pose, _ = fit_poses(data, start, noise_m)
    each = 6 + k

    def residual(x: np.ndarray) -> np.ndarray:
        frame = x[start.size :].reshape(n, each)
        turned = pose.rotation @ Rotation.from_rotvec(frame[:, 3:6]).as_matrix()
        moved = Pose(turned, pose.translation + 1e-2 * frame[:, :3], pose.angle_rad + frame[:, 6:])
        model = moved.to_world(propagate(start.moved(scale * x[: start.size]), data.body, moved.angle_rad)[0])
        return np.where(seen, (model - data.position_world) / noise_m, 0.0).ravel()

    scale = np.r_[np.full(3 * m, 1e-2), np.tile([1.0, 1.0, 1e-2, 1e-2], k)]
    pattern = lil_matrix((n * m * 3, start.size + n * each), dtype=np.int8)
    pattern[:, : start.size] = 1
    for i in range(n):
        pattern[i * m * 3 : (i + 1) * m * 3, start.size + i * each : start.size + (i + 1) * each] = 1
    return least_squares(
        residual, np.zeros(start.size + n * each), jac_sparsity=pattern, method="trf", tr_solver="lsmr"
    )


def one_finger(root: Path) -> list[dict[str, Any]]:
    """Rows for one finger and for ten times its frames."""
    plan = Plan(
        flexion=("full", "medium", "slow", "fast") * 22, validation=(), excitations=0, joint_sides=(), still_s=0.5
    )
    record(bebionic("left", 5, ["index"]), root / "finger", 5, plan=plan)
    session = read_session(root / "finger")
    rate = 1 / np.median(np.diff(session.select("flexion", "index")[0].mocap().time_s))
    seconds = SECONDS * RATE_HZ / rate  # as many frames as 40 s at 100 Hz have
    data, rest, shape = finger_data(session, seconds)
    frames = len(data.position_world)
    fit, ours = timed(lambda: by_likelihood(data, rest, shape), 3)
    _, published = timed(lambda: by_published(data, rest, shape), 3)
    few = np.unique(np.r_[rest[:5], np.linspace(0, frames - 1, FEW).astype(int)])
    small = data.take(few)
    start = start_chain(data, rest, shape)
    _, general = timed(lambda: by_general_solver(small, start, fit.noise_m))
    _, ours_small = timed(lambda: fit_chain(small, start), 3)
    long, long_rest, _ = finger_data(session, 10 * seconds)
    _, tenfold = timed(lambda: by_likelihood(long, long_rest, shape))
    return [
        {"what": "one finger, chain likelihood with covariance", "frames": frames, **ours},
        {"what": "one finger, published method", "frames": frames, **published},
        {"what": "few frames, chain likelihood with covariance", "frames": len(few), **ours_small},
        {"what": "few frames, scipy least_squares, sparse, no covariance", "frames": len(few), **general},
        {"what": "ten times the frames, chain likelihood", "frames": len(long.position_world), **tenfold},
    ]


def whole_hand(root: Path) -> list[dict[str, Any]]:
    """Rows for six fingers from session to report."""
    record(bebionic("right", 6), root / "hand", 6, plan=Plan(excitations=0))
    hand, identified = timed(lambda: identify(root / "hand"))
    description, compiled = timed(lambda: compile(hand, root / "compiled"))
    residuals, replayed = timed(lambda: replay(description, root / "hand"))
    _, written = timed(lambda: write_report(residuals, root / "report"))
    session = read_session(root / "hand")
    frames = sum(len(t.mocap().time_s) for t in session.select("flexion", validate=False))
    stages = {"identify": identified, "compile": compiled, "replay": replayed, "report": written}
    rows = [{"what": f"six fingers, {name}", "frames": frames, **cost} for name, cost in stages.items()]
    total = {key: sum(cost[key] for cost in stages.values()) for key in identified}
    return [*rows, {"what": "six fingers, session to report", "frames": frames, **total}]


def main(target: str | None = None) -> None:
    """Measure, print a table, write it as JSON where a file is named."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [*one_finger(Path(folder)), *whole_hand(Path(folder))]
    by_name = {row["what"]: row for row in rows}
    per_frame = {name: row["processor_s"] / row["frames"] for name, row in by_name.items()}
    ours, general = (
        f"few frames, {name}"
        for name in ("chain likelihood with covariance", "scipy least_squares, sparse, no covariance")
    )
    one, ten = (
        by_name["one finger, chain likelihood with covariance"],
        by_name["ten times the frames, chain likelihood"],
    )
    ratios = {
        "general solver over chain likelihood, per frame": per_frame[general] / per_frame[ours],
        "ten times the frames over once, processor time": ten["processor_s"] / one["processor_s"],
    }
    print(f"{'':58s} {'frames':>7s} {'wall [s]':>9s} {'processor [s]':>14s} {'per frame [us]':>15s}")
    for row in rows:
        each = 1e6 * row["processor_s"] / row["frames"]
        print(f"{row['what']:58s} {row['frames']:7d} {row['wall_s']:9.2f} {row['processor_s']:14.2f} {each:15.1f}")
    for name, value in ratios.items():
        print(f"{name}: {value:.1f}")
    if target:
        machine = {"python": platform.python_version(), "numpy": np.__version__, "machine": platform.machine()}
        with new_file(target) as staging:
            staging.write_text(json.dumps({"rows": rows, "ratios": ratios, **machine}, indent=1) + "\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("target", metavar="RESULT.json", nargs="?", help="where to keep the figures")
    main(parser.parse_args().target)
