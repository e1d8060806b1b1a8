"""One drive: its parameters, and the simulation in C (`motor.c`), compiled once per process."""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from .geometry import Array
from .moves import Move

STEP_S = 5e-4  # of the simulation
EVERY = 4  # steps per row of a trace
ROW_S = STEP_S * EVERY
NOISE = 60000  # random numbers of a simulation, as in motor.c
FLAGS = ["-O2", "-ffp-contract=off", "-shared", "-fPIC"]  # contracted sums would round otherwise


class CompilerError(RuntimeError):
    """No C compiler, or it failed."""


class RunawayError(RuntimeError):
    """A simulated motor left its range by far."""


@dataclass(frozen=True)
class Motor:
    """Drive with position in % of the range, force in raw units of current, time in s. Sizes of 0 hide nothing."""

    mass: float
    viscous: float
    coulomb: float
    stiffness: float
    preload: float  # spring's force at 0 %
    static_friction: float
    stribeck_speed: float = 1.0
    position_gain: float = 0.0
    speed_gain: float = 0.0
    top_speed: float = 0.0
    acceleration: float = 0.0
    bristle_stiffness: float = 60.0
    bristle_damping: float = 0.25
    drag: float = 0.0  # raw per speed squared
    viscous_asymmetry: float = 0.0  # share more in extension
    coulomb_asymmetry: float = 0.0  # share more in extension
    load_friction: float = 0.0  # raw per raw of load
    tight_spot: float = 0.0  # share of coulomb
    tight_centre: float = 0.0
    tight_width: float = 1.0
    detent: float = 0.0
    detent_centre: float = 0.0
    detent_width: float = 1.0
    detent_form: float = 0.0  # 0 bump, 1 over the hill
    square_spring: float = 0.0  # force at 100 %
    cubic_spring: float = 0.0  # force at 100 %
    weight: float = 0.0
    weight_phase: float = 0.0  # [rad]
    full_angle: float = 0.0  # [rad] of the proximal joint at 100 %
    ripple: float = 0.0
    ripple_period: float = 1.0
    ripple_phase: float = 0.0
    hysteresis: float = 0.0
    hysteresis_distance: float = 1.0
    relaxing_stiffness: float = 0.0
    relaxation_time: float = 1.0
    stop: float = 0.0
    stop_stiffness: float = 0.0
    warming: float = 0.0  # share of friction more while cold
    warming_time: float = 1.0
    begun_s: float = 0.0  # start of the trial, since the motor first moved
    encoder_error: float = 0.0
    encoder_period: float = 1.0
    encoder_phase: float = 0.0
    sag_of_force: float = 0.0  # share lost per 100 raw
    sag_of_speed: float = 0.0  # share lost per 100 raw
    command_delay: float = 0.0
    current_limit: float = 0.0  # 0 none
    obstacle: float = 0.0
    obstacle_stiffness: float = 0.0
    obstacle_from_s: float = 0.0
    obstacle_to_s: float = 0.0
    lost_spring: float = 0.0  # share of the spring that does not act below a place
    lost_below: float = 0.0
    lost_width: float = 1.0
    acceleration_friction: float = 0.0  # raw per %/s^2
    sticking: float = 0.0  # share of friction more, now and then
    sticking_period: float = 1.0  # of travel
    sticking_length: float = 0.0
    retuned_s: float = 0.0  # 0 never
    retuned_gain: float = 1.0  # factor
    wandering: float = 0.0  # friction's random walk, share per root of a second
    supply_swing: float = 0.0
    supply_hz: float = 0.0
    lubricant: float = 0.0  # share of viscous friction more before it has spread
    lubricant_time: float = 1.0
    ageing: float = 0.0  # share of friction more after a rest
    vibration: float = 0.0
    vibration_hz: float = 0.0
    travel_load: float = 0.0
    travel_period: float = 1.0  # of travel
    preload_jump: float = 0.0
    preload_jump_s: float = 0.0


@dataclass(frozen=True)
class Trace:
    """Motion at every ROW_S: position, reference and encoder's reading [%], speed [%/s], current, friction and the load
    without viscous friction [raw]."""

    position: Array
    speed: Array
    current: Array
    friction: Array
    reference: Array
    load: Array
    seen: Array

    @property
    def time(self) -> Array:
        """Seconds from the start of the trial."""
        return np.arange(len(self.position)) * ROW_S


@functools.cache
def library() -> ctypes.CDLL:
    """The compiled motor; raises CompilerError where there is no C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise CompilerError("the fourth recorder simulates its motor in C and needs a C compiler named cc on the path")
    with tempfile.TemporaryDirectory() as folder:
        names = ", ".join(each.name for each in fields(Motor))
        (Path(folder) / "parameters.h").write_text(f"struct parameters {{ double {names}; }};\n")
        built = Path(folder) / "motor.so"
        source = Path(__file__).with_name("motor.c")
        done = subprocess.run(
            [compiler, *FLAGS, f"-I{folder}", str(source), "-o", str(built), "-lm"],
            check=False,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            raise CompilerError(f"{compiler} could not compile {source}: {done.stderr.strip()}")
        return ctypes.CDLL(str(built))


def pointer(values: Array) -> ctypes.c_void_p:
    """Of an array, for the library."""
    return values.ctypes.data_as(ctypes.c_void_p)


def simulate(motor: Motor, moves: Sequence[Move], starts: Sequence[float], duration_s: float, noise: Array) -> Trace:
    """Motion from rest at 0 % through moves that start at given times [s]; noise: NOISE normal numbers. Raises
    RunawayError."""
    steps = int(duration_s / STEP_S + 0.5)
    values = np.array([float(value) for value in astuple(motor)])
    targets = np.array([move.target for move in moves], float)
    shares = np.array([move.share for move in moves], float)
    times = np.array(starts, float)
    out = np.zeros((steps // EVERY + 1, len(fields(Trace))))
    library().simulate(
        pointer(values),
        len(moves),
        pointer(targets),
        pointer(shares),
        pointer(times),
        steps,
        ctypes.c_double(STEP_S),
        EVERY,
        pointer(noise),
        pointer(out),
    )
    if not np.isfinite(out).all() or np.abs(out[:, 0]).max() > 130:
        raise RunawayError("the simulated motor ran away")
    return Trace(*out.T)
