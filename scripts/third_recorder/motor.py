"""One drive: its parameters, and the simulation in C (`motor.c`), compiled once per process."""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import tempfile
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from .geometry import Array

STEP_S = 2.5e-4  # of the simulation
EVERY = 4  # steps per row of a trace
ROW_S = STEP_S * EVERY
NEVER = 1e3  # [%] a place that the motor does not reach
FLAGS = ["-O2", "-fno-math-errno", "-ffp-contract=off", "-shared", "-fPIC"]  # contracted sums would round otherwise


class CompilerError(RuntimeError):
    """No C compiler, or it failed."""


@dataclass
class Motor:
    """Drive with position in % of the range, force in raw units of current, time in s. Sizes of 0 hide nothing."""

    mass: float = 0.0
    viscous: float = 0.0
    coulomb: float = 0.0
    stiffness: float = 0.0
    preload: float = 0.0  # spring's force at 0 %
    breakaway: float = 0.008  # [%] before friction slides
    stribeck: float = 0.0  # friction at rest above coulomb
    stribeck_speed: float = 10.0
    stribeck_form: float = 0.0  # 0 exponential, 1 rational
    viscous_asymmetry: float = 0.0  # flexion has it more, extension less
    coulomb_asymmetry: float = 0.0
    load_friction: float = 0.0  # raw per raw of load
    tight_spot: float = 0.0
    tight_centre: float = 0.0
    tight_width: float = 1.0
    detent: float = 0.0
    detent_centre: float = 0.0
    detent_width: float = 1.0
    detent_form: float = 0.0  # 0 bump, 1 over the hill
    bent_spring: float = 0.0
    bent_form: float = 0.0  # 0 exponential, 1 knee
    bent_shape: float = 1.0
    bent_offset: float = 0.0  # straight line that the curve is counted from
    bent_slope: float = 0.0
    weight: float = 0.0
    full_angle: float = 0.0  # [rad] of the proximal joint at 100 %
    ripple: float = 0.0
    ripple_period: float = 10.0
    ripple_phase: float = 0.0
    ripple_second: float = 0.0  # at half the period
    drag: float = 0.0  # raw per speed squared
    hysteresis: float = 0.0
    hysteresis_distance: float = 10.0
    relaxing_stiffness: float = 0.0
    relaxation_time: float = 1.0
    upper_stop: float = NEVER
    upper_stiffness: float = 0.0
    lower_stop: float = -NEVER
    lower_stiffness: float = 0.0
    warming: float = 0.0  # change of friction once warm
    warming_time: float = 60.0
    warm_s: float = 0.0  # since the motor first moved, at the start of a trial
    encoder_error: float = 0.0
    encoder_period: float = 10.0
    encoder_phase: float = 0.0
    sag: float = 0.0  # share of the current lost per raw
    command_delay: float = 0.0
    current_limit: float = 400.0
    obstacle_stiffness: float = 0.0
    obstacle: float = NEVER
    obstacle_damping: float = 0.0
    third_stroke: float = 0.0  # friction of every third stroke
    fast_spring: float = 0.0
    fast_spring_speed: float = 1.0
    ageing: float = 0.0  # friction after a rest
    ageing_time: float = 0.3  # until it is gone
    ageing_rest: float = 0.3  # until it has grown
    controller: float = 0.0  # index in controllers.NAMES
    position_gain: float = 0.0
    speed_gain: float = 0.0
    integral_gain: float = 0.0
    derivative_gain: float = 0.0
    acceleration: float = 0.0
    top_speed: float = 0.0  # at full commanded speed
    deadband: float = 0.0
    feed_forward: float = 0.0
    drive_gain: float = 0.0
    load_share: float = 0.0
    holding_gain: float = 0.0


@dataclass(frozen=True)
class Inputs:
    """What acts on a motor, one value per step of STEP_S; the order is that of `struct inputs`."""

    target: Array  # [%]
    speed_share: Array  # of the full speed
    external: Array  # [raw]
    touching: Array  # 0 to 1: whether an obstacle is there
    gravity_dorsal: Array  # components of the unit vector in the finger's frame, hand open
    gravity_along: Array
    pushed_to: Array  # [%] where a hand holds the finger beyond its drive


@dataclass(frozen=True)
class Trace:
    """Motion at every ROW_S: position and encoder's reading [%], speed [%/s], current and friction [raw], lift [%]."""

    position: Array
    speed: Array
    current: Array
    lift: Array
    friction: Array
    seen: Array

    @property
    def time(self) -> Array:
        """Seconds from the start of the trial."""
        return np.arange(len(self.position)) * STEP_S * EVERY


@functools.cache
def library() -> ctypes.CDLL:
    """The compiled motor; raises CompilerError where there is no C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise CompilerError("the third recorder simulates its motor in C and needs a C compiler named cc on the path")
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


def simulate(motor: Motor, inputs: Inputs, start: float) -> Trace:
    """Motion from rest at `start` [%]."""
    steps = len(inputs.target)
    values = np.array([float(value) for value in astuple(motor)])
    arrays = [np.ascontiguousarray(getattr(inputs, each.name), float) for each in fields(Inputs)]
    pointers = (ctypes.c_void_p * len(arrays))(*[array.ctypes.data for array in arrays])
    out = np.zeros(((steps + EVERY - 1) // EVERY, len(fields(Trace))))
    library().simulate(
        values.ctypes.data_as(ctypes.c_void_p),
        ctypes.c_long(steps),
        ctypes.c_double(STEP_S),
        pointers,
        ctypes.c_double(start),
        ctypes.c_int(EVERY),
        out.ctypes.data_as(ctypes.c_void_p),
    )
    return Trace(*out.T)
