"""A session with something planted in one of its fingers: loads first, then channels; joints, then markers."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from shown_answers import answer_of

from hand_model.session import Finger, Session, read_session
from hand_model.session.log import read_log
from hand_model.twin.files import write_log, write_markers

from .channels import CHANNELS
from .loads import LOADS
from .plant import SPREAD, Array, Columns, Draw, Motor, Moving, Plant, smoothed
from .segments import SEGMENTS
from .slips import SLIPS
from .watched import watched

EFFECTS: dict[str, Callable[[Draw, float, Motor], Plant]] = {
    f.__name__: f for f in (*LOADS, *CHANNELS, *SEGMENTS, *SLIPS)
}


def planted(
    source: Path, target: Path, finger: str, sizes: Mapping[str, float], seed: int, noise: float = 0.0
) -> dict[str, Plant]:
    """Write the session `source` with effects of such sizes in one finger to the new folder `target`. noise: white noise
    that comes on top of it, in that of a usual recording (5 raw, 0.15 mm)."""
    session = read_session(source)
    rng = np.random.default_rng(seed)
    one = next(f for f in session.fingers if f.name == finger)
    motor = _motor(session, one, answer_of(source)["motor"][finger])
    plants = {name: EFFECTS[name](rng, sizes[name], motor) for name in EFFECTS if name in sizes}
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("answer.json"))
    logged = [t for t in session.trials if t.log_path is not None and t.log_path.is_file()]
    mine = [t for t in logged if t.finger == finger]
    begun = min(float(read_log(t.log_path).time_s[0]) for t in mine)
    for trial in logged:
        log = read_log(trial.log_path)
        current = log.columns["current"] + 5.0 * noise * rng.standard_normal(len(log.time_s))
        columns = {"time": log.time_s, **log.columns, "current": current}
        if trial in mine:
            columns = _changed(columns, tuple(plants.values()), _moving(columns, motor, begun, mine.index(trial)))
        write_log(target / trial.log_path.relative_to(source), {**columns, "current": np.round(columns["current"])})
    for trial in (t for t in session.select("flexion") if t.mocap_path is not None):
        mocap, owner = trial.mocap(), next(f for f in session.fingers if f.name == trial.finger)
        position = mocap.position_world
        moved = [p.markers for p in plants.values() if p.markers is not None]
        if moved and owner.name == finger:
            seen, log = watched(session, owner, trial), trial.log()
            moving = _moving({"time": log.time_s, **log.columns}, motor, begun, mine.index(trial))
            load = np.interp(seen.log_s, moving.time_s, _load(plants.values(), moving))
            seen = replace(seen, load=load)
            for markers in reversed(moved):  # what turns segments takes along what slipped on them
                seen = replace(seen, position=markers(seen))
            position = seen.position
        position = position + 1.5e-4 * noise * rng.standard_normal(position.shape)
        write_markers(
            target / trial.mocap_path.relative_to(source),
            dict(zip(mocap.labels, position.transpose(1, 0, 2), strict=True)),
            mocap.rate_hz,
            "mm",
        )
    return plants


def _changed(columns: Columns, plants: Sequence[Plant], moving: Moving) -> Columns:
    """A log with all loads added to its current, and then as each faulty channel has it."""
    columns = {**columns, "current": np.round(columns["current"] + _load(plants, moving))}
    for plant in plants:
        columns = columns if plant.columns is None else plant.columns(columns, moving)
    return columns


def _load(plants: Iterable[Plant], moving: Moving) -> Array:
    return sum((p.load(moving) for p in plants if p.load is not None), np.zeros(len(moving.time_s)))


def _moving(columns: Columns, motor: Motor, begun_s: float, number: int) -> Moving:
    """Place and speed along a log, smoothed as far as its own scatter says."""
    time_s, known = columns["time"], np.isfinite(columns["position"])
    place = 100 * (columns["position"] - motor.low) / (motor.high - motor.low)
    course = smoothed(time_s[known], place[known], 100 * SPREAD / (motor.high - motor.low))
    return Moving(time_s - time_s[0], course(time_s), course.derivative()(time_s), time_s - begun_s, number)


def _motor(session: Session, finger: Finger, told: dict[str, float]) -> Motor:
    """A finger's drive as its answer tells it, its counts and the moments of a weight at its markers."""
    trials = session.select("flexion", finger.name)
    counts = np.concatenate([t.log().columns["position"] for t in trials])
    low, high = (float(np.nanpercentile(counts, q)) for q in (2, 98))
    seen = watched(session, finger, trials[0])
    lever = np.nanmean(seen.position[:, seen.segments[0]], axis=1) - seen.centre[0]
    lever = lever - seen.axis[0] * np.sum(lever * seen.axis[0], 1)[:, None]
    lever = lever / np.linalg.norm(lever, axis=1)[:, None]
    gravity = np.array([0.0, 0.0, -9.81]) if session.gravity_world is None else np.array(session.gravity_world)
    down = gravity / np.linalg.norm(gravity)
    moment = -np.sum(seen.axis[0] * np.cross(lever, down), axis=1)
    known = np.isfinite(moment)
    waves = np.stack([np.cos(seen.angle[0]), np.sin(seen.angle[0])], 1)
    weight = np.linalg.lstsq(waves[known], moment[known], rcond=None)[0]
    return Motor(
        coulomb=told["Fc"],
        viscous=told["b"],
        stiffness=told["k"],
        preload=told["tau0"],
        low=low,
        high=high,
        weight=(float(weight[0]), float(weight[1])),
        full_rad=float(np.percentile(seen.angle[0], 98)),
    )
