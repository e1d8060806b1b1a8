"""The drive of one finger: parameters, tables, and plant.c, compiled once per machine and user."""

from __future__ import annotations

import ctypes
import hashlib
import os
import subprocess
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

# In the order of the C enum; loads in raw current, places in %, times in s.
PARAMETERS = (
    *("M_", "B_", "FC", "K_", "TAU0"),  # declared: inertia, viscous, Coulomb, spring, preload
    *("MODE", "KP", "KI", "KX", "ACC", "DB", "HOLD", "PROF", "TS"),  # controller: law, gains, ramp, dead band, period
    *("DELAY", "SAG", "SAGTAU", "SAGPOW", "ILIM"),  # drive: delay of commands, sag of the supply, limit of current
    *("MU", "MUBACK", "MUINER"),  # friction by load, its share when driven back, with inertia
    *("NIW", "IWK", "IWD"),  # Iwan sliders: number, total load, distance over which they spread
    *("BWF", "BWD", "BWN"),  # Bouc-Wen: load, distance, exponent
    *("MX1", "MXT1", "MX2", "MXT2", "MX3", "MXT3"),  # Maxwell branches: stiffness, time
    *("ZS", "ZEXP"),  # presliding: distance, Dahl exponent
    *("THA", "THTAU", "THMODE", "THREF"),  # heat: share of friction, time, of what, reference load
    *("BLG", "BLS"),  # backlash: gap, share of friction lost in it
    *("DWA", "DWT", "DWD"),  # ageing at rest: share of friction, time, distance
    "SEAMP",  # period of the table over travel
    *("RGA", "RGW", "RGZ"),  # resonator: share of the inertia, rad/s, damping
    *("HCD", "HCQ", "HCS"),  # damping in the end stop: load, place, side
    *("CQ", "CK", "CN", "CD"),  # contact: place, stiffness, exponent, damping
    *("PREF", "FF"),  # reference load of the sag, share of friction fed forward
)
DT = 5e-4  # s
STATES = 40
Q, V, HEAT, AGE, BRISTLE, RING_Q, RING_V, BUS = 0, 1, 3, 4, 6, 29, 30, 31  # of the state, as in plant.c
Q_GRID = np.arange(2401) * 0.05 - 10  # %
V_GRID = np.arange(1601) * 0.25 - 200  # %/s
TRAVEL_GRID = np.arange(256) / 256  # share of a period

Series = dict[str, np.ndarray]
PerTrial = Callable[[dict[str, Any], np.ndarray], Series]


class CompilerError(RuntimeError):
    """There is no C compiler named cc, or it does not compile the plant."""


@cache
def library() -> ctypes.CDLL:
    """The compiled plant; raises CompilerError."""
    text = f"enum {{ {', '.join(PARAMETERS)} }};\n" + Path(__file__).with_name("plant.c").read_text()
    folder = Path(tempfile.gettempdir()) / f"sixth_recorder_{os.getuid()}"
    folder.mkdir(exist_ok=True)
    target = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.so"
    if not target.exists():
        source = target.with_suffix(f".{os.getpid()}.c")
        source.write_text(text)
        built = source.with_suffix(".so")
        command = ["cc", "-O2", "-shared", "-fPIC", "-o", str(built), str(source), "-lm"]
        try:
            subprocess.run(command, check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise CompilerError(
                f"the sixth recorder's drive is C, and `{' '.join(command)}` failed: {error}"
            ) from error
        built.rename(target)
        source.unlink()
    return ctypes.CDLL(str(target))


def _pointer(x: np.ndarray) -> ctypes.c_void_p:
    return x.ctypes.data_as(ctypes.c_void_p)


class Plant:
    """Parameters (see PARAMETERS) and tables of one finger; effects change a copy.

    load_q, friction_q, encoder: over Q_GRID (raw, raw, %); load_v, friction_v: over V_GRID (raw); load_travel: over
    TRAVEL_GRID (raw). per_trial: functions of a trial and its time (s), giving any of contact (0..1), friction_factor,
    extra (raw), one value per DT, and load_q."""

    def __init__(self) -> None:
        self.p = dict.fromkeys(PARAMETERS, 0.0)
        self.load_q, self.friction_q, self.encoder = (np.zeros(len(Q_GRID)) for _ in range(3))
        self.load_v, self.friction_v = (np.zeros(len(V_GRID)) for _ in range(2))
        self.load_travel = np.zeros(len(TRAVEL_GRID))
        self.per_trial: list[PerTrial] = []

    def copy(self) -> Plant:
        """A plant that can be changed without changing this one."""
        other = Plant()
        other.p = dict(self.p)
        for name in ("load_q", "friction_q", "encoder", "load_v", "friction_v", "load_travel"):
            setattr(other, name, getattr(self, name).copy())
        other.per_trial = list(self.per_trial)
        return other

    def run(self, trial: dict[str, Any], state: np.ndarray, n: int) -> np.ndarray:
        """Run n steps of a trial from `state` (changed in place); rows of q v a I friction heat target, 1 ms apart."""
        t = np.arange(n) * DT
        contact, factor, extra, load_q = np.zeros(n), np.ones(n), np.zeros(n), self.load_q.copy()
        for function in self.per_trial:
            for name, x in function(trial, t).items():
                match name:
                    case "contact":
                        contact += x
                    case "friction_factor":
                        factor *= x
                    case "extra":
                        extra += x
                    case "load_q":
                        load_q += x
        parameters = np.array(list(self.p.values()))
        moves = np.ascontiguousarray(trial["moves"], float)
        out = np.zeros((n // 2, 7))
        tables = (load_q, self.friction_q, self.load_v, self.friction_v + self.p["FC"], self.load_travel, self.encoder)
        library().simulate(
            n,
            ctypes.c_double(DT),
            _pointer(parameters),
            _pointer(state),
            len(moves),
            _pointer(moves),
            *map(_pointer, (*tables, contact, factor, extra, out)),
        )
        return out


def fresh_state() -> np.ndarray:
    """The state of a drive that has not moved yet."""
    return np.zeros(STATES)


def begin_trial(state: np.ndarray, heat_left: float) -> None:
    """A pause: the drive rests and cools to a share of its heat."""
    state[HEAT] *= heat_left
    state[AGE] = 1
    state[[V, BRISTLE, RING_V, BUS]] = 0
    state[RING_Q] = state[Q]


def _apply(name: str, x: np.ndarray, *numbers: float) -> np.ndarray:
    x = np.ascontiguousarray(x, float)
    y = np.empty_like(x)
    getattr(library(), name)(len(x), *map(ctypes.c_double, numbers), _pointer(x), _pointer(y))
    return y


def play(x: np.ndarray, gap: float) -> np.ndarray:
    """Lost motion of full width `gap`, in the units of x."""
    return _apply("play", x, gap)


def lag(x: np.ndarray, h: float, up: float, down: float) -> np.ndarray:
    """First-order lag of a series at step h (s) with time constants `up` and `down` (s)."""
    return _apply("lag", x, h, up, down)
