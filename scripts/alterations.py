"""What another laboratory would have done to a recording of the same hand: turned, noisy, lost, held, in other units.

An alteration takes a recording as it was read and gives it back changed; what moved in it stays the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from hand_model.session import Mocap, read_session
from hand_model.session.log import read_log
from hand_model.session.mocap import read_mocap
from hand_model.twin.files import write_log, write_markers

Array = NDArray[np.float64]
Columns = dict[str, Array]
Draw = np.random.Generator

ENDINGS = (".tsv", ".trc", ".csv", ".c3d")  # of marker files, by turns
CLOCK_S, SMALL = 3000.0, 0.6
SEGMENT = re.compile(r"[PD]2$")  # of each segment one marker
UNIT = {"current": 17.3, "position": 0.0137, "setpoint": 0.0137}


@dataclass(frozen=True)
class Alteration:
    """markers: (n, m, 3) [m], the recording and what is drawn -> the same, nan where lost; log: columns with `time` and
    what is drawn -> the same; manifest: its text -> the same. step: of how many frames one is kept. turned: whether
    the world is another."""

    markers: Callable[[Array, Mocap, Draw], Array] = lambda p, mocap, rng: p
    log: Callable[[Columns, Draw], Columns] = lambda c, rng: c
    manifest: Callable[[str], str] = lambda text: text
    step: int = 1
    turned: bool = False


def altered(source: Path, target: Path, alteration: Alteration, ending: str, seed: int) -> None:
    """Write the session `source`, altered, to the new folder `target`, its markers in files of `ending`."""
    rng = np.random.default_rng(seed)
    session = read_session(source)
    turn = Rotation.random(random_state=seed) if alteration.turned else Rotation.identity()
    away = rng.standard_normal(3) if alteration.turned else np.zeros(3)
    for folder in ("mocap", "log"):
        (target / folder).mkdir(parents=True)
    for file in sorted((source / "mocap").iterdir()):
        mocap = read_mocap(file)
        position = alteration.markers(mocap.position_world[:: alteration.step], mocap, rng) @ turn.as_matrix().T + away
        write_markers(
            target / "mocap" / f"{file.stem}{ending}",
            dict(zip(mocap.labels, position.transpose(1, 0, 2), strict=True)),
            mocap.rate_hz / alteration.step,
            "mm",
        )
    for file in sorted((source / "log").iterdir()):
        log = read_log(file)
        write_log(target / "log" / file.name, alteration.log({"time": log.time_s, **log.columns}, rng))
    text = alteration.manifest((source / "session.toml").read_text())
    text = re.sub(r'(mocap/\w+)\.\w+"', rf'\1{ending}"', text)
    if session.gravity_world is not None:
        text = re.sub(r"gravity = \[.*\]", f"gravity = {turn.apply(session.gravity_world).tolist()}", text)
    (target / "session.toml").write_text(text)


def _rows(columns: Columns, which: NDArray) -> Columns:
    return {name: values[which] for name, values in columns.items()}


def _changed(columns: Columns, **changes: Callable[[Array], Array]) -> Columns:
    return {name: changes[name](values) if name in changes else values for name, values in columns.items()}


def _noisy_log(columns: Columns, rng: Draw) -> Columns:
    """3 raw of noise, stamps off by half a millisecond, three rows of a hundred lost."""
    n = len(columns["time"])
    noisy = _changed(
        columns,
        current=lambda x: np.round(x + 3.0 * rng.standard_normal(n)),
        time=lambda t: t + 0.5e-3 * rng.standard_normal(n),
    )
    return _rows(noisy, np.sort(rng.permutation(n)[: int(0.97 * n)]))


def _outliers(position: Array, _: Mocap, rng: Draw) -> Array:
    """Reflections: of a marker's frames four in a thousand are off by 5 mm."""
    hit = rng.random(position.shape[:2]) < 0.004
    return position + hit[..., None] * rng.normal(0, 5e-3, position.shape)


def _spikes(columns: Columns, rng: Draw) -> Columns:
    n = len(columns["time"])
    spikes = (rng.random(n) < 0.003) * rng.choice([-1, 1], n) * rng.uniform(40, 90, n)
    return _changed(columns, current=lambda x: np.round(x + spikes))


def _loose(position: Array, mocap: Mocap, rng: Draw) -> Array:
    """One marker of each segment shakes by 0.35 mm."""
    shakes = np.array([bool(SEGMENT.search(label)) for label in mocap.labels])
    return position + shakes[None, :, None] * rng.normal(0, 0.35e-3, position.shape)


def _hum(columns: Columns, rng: Draw) -> Columns:
    """Mains in the current, and noise in proportion to it."""
    t = columns["time"]
    mains, gain = 3 * np.sin(2 * np.pi * 50 * t + rng.uniform(0, 6)), 1 + 0.04 * rng.standard_normal(len(t))
    return _changed(columns, current=lambda x: np.round(x * gain + mains))


def _coarse(columns: Columns, _: Draw) -> Columns:
    """An encoder of 400 steps over the range, a current of a few."""
    step = max(round(float(np.nanmax(columns["position"]) - np.nanmin(columns["position"])) / 400), 1)

    def rounded(values: Array) -> Array:
        return np.round(values / step) * step

    return _changed(columns, position=rounded, setpoint=rounded, current=lambda x: np.round(x / 4) * 4)


def _lost_frames(position: Array, mocap: Mocap, rng: Draw) -> Array:
    """Each marker is hidden every few seconds for up to half a second; at rest beside a probe it is not."""
    out = position.copy()
    for marker in range(position.shape[1]) if len(position) > 20 * mocap.rate_hz else ():
        frame = 0
        while (frame := frame + int(rng.exponential(5) * mocap.rate_hz)) < len(out):
            until = frame + int(rng.uniform(0.05, 0.5) * mocap.rate_hz)
            out[frame:until, marker] = np.nan
            frame = until
    return out


def _lost_rows(columns: Columns, rng: Draw) -> Columns:
    kept, begin = np.ones(len(columns["time"]), bool), columns["time"][0]
    while (begin := begin + rng.exponential(4)) < columns["time"][-1]:
        until = begin + rng.uniform(0.05, 0.4)
        kept[(columns["time"] > begin) & (columns["time"] < until)] = False
        begin = until
    return _rows(columns, kept)


def _pause(columns: Columns, rng: Draw) -> Columns:
    """Two seconds of a log are missing, wherever that is."""
    time_s = columns["time"] - columns["time"][0]
    begin = rng.uniform(0.2, 0.7) * time_s[-1]
    return _rows(columns, (time_s < begin) | (time_s > begin + 2.0))


def _held(columns: Columns, rng: Draw) -> Columns:
    """A log that is written twice as fast as the hand is read."""
    n = len(columns["time"])
    row = np.maximum.accumulate(np.where(rng.random(n) < 0.5, np.arange(n), 0))
    return {name: values[row] if name in ("position", "current") else values for name, values in columns.items()}


def _stamped_late(columns: Columns, rng: Draw) -> Columns:
    """Rows read at even intervals and stamped when the answer arrives, 2 ms off at random."""
    known = np.isfinite(columns["position"]) & np.isfinite(columns["current"])
    columns = _rows(columns, known)
    t = columns["time"]
    even = np.arange(t[0], t[-1], float(np.median(np.diff(t))))
    row = np.searchsorted(t, even, side="right") - 1
    out = {name: values[row] for name, values in columns.items()}
    out["position"] = np.round(CubicSpline(t, columns["position"])(even))
    out["current"] = np.round(np.interp(even, t, columns["current"]) + 0.9 * rng.standard_normal(len(even)))
    return {**out, "time": np.sort(even + 2e-3 * rng.standard_normal(len(even)))}


def _in_units(columns: Columns, _: Draw) -> Columns:
    """Degrees from another zero instead of counts, milliamperes instead of raw units."""
    zero = 3000.0
    return {n: (v - zero * (n in ("position", "setpoint"))) * UNIT.get(n, 1.0) for n, v in columns.items()}


def _empty_cells(columns: Columns, rng: Draw) -> Columns:
    return {
        name: values if name == "time" else np.where(rng.random(len(values)) < 0.05, np.nan, values)
        for name, values in columns.items()
    }


def _arm_turns(position: Array, mocap: Mocap, rng: Draw) -> Array:
    """The whole arm is turned by 20 deg to and fro while it is recorded."""
    t = np.arange(len(position)) / mocap.rate_hz
    turn = np.stack([0.35 * np.sin(2 * np.pi * 0.05 * t + phase) for phase in rng.uniform(0, 6, 3)], axis=1)
    return np.einsum("nij,nmj->nmi", Rotation.from_rotvec(turn).as_matrix(), position)


def _small_probe(text: str) -> str:
    """The pointing probe's markers in a world that is smaller."""

    def smaller(line: re.Match[str]) -> str:
        return re.sub(r"-?\d+\.\d+", lambda x: repr(SMALL * float(x[0])), line[0])

    return re.sub(r"^markers = \{ T1.*$", smaller, text, flags=re.MULTILINE)


def _few(text: str) -> str:
    """One excitation, and no recording said to be kept out."""
    blocks = re.split(r"(?m)^(?=\[)", text)
    return re.sub(r"(?m)^purpose.*\n", "", "".join(b for b in blocks if not re.search(r"excitation_\w+_[23]", b)))


ALTERATIONS: Mapping[str, Alteration] = {
    "turned": Alteration(log=lambda c, rng: {**c, "time": c["time"] - CLOCK_S}, turned=True),
    "slow": Alteration(log=lambda c, rng: _rows(c, np.arange(0, len(c["time"]), 2)), step=2),
    "noisy": Alteration(lambda p, mocap, rng: p + 0.15e-3 * rng.standard_normal(p.shape), _noisy_log),
    "outliers": Alteration(_outliers, _spikes),
    "loose": Alteration(_loose),
    "hum": Alteration(log=_hum),
    "coarse": Alteration(log=_coarse),
    "heavy": Alteration(
        lambda p, mocap, rng: p + 0.07e-3 * rng.standard_t(2.5, p.shape),
        lambda c, rng: _changed(c, current=lambda x: np.round(x + 1.5 * rng.standard_t(2.5, len(x)))),
    ),
    "lost": Alteration(_lost_frames, _lost_rows),
    "pause": Alteration(log=_pause),
    "held": Alteration(log=_held),
    "cells": Alteration(log=_empty_cells),
    "stamps": Alteration(log=_stamped_late),
    "units": Alteration(log=_in_units),
    "bare": Alteration(log=lambda c, rng: {n: c[n] for n in ("time", "position", "current")}),
    "few": Alteration(manifest=_few),
    "small": Alteration(lambda p, mocap, rng: SMALL * p, manifest=_small_probe),
    "arm": Alteration(_arm_turns),
}
