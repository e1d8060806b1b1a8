"""Compile drive.c once and run trials of a motor through it."""

import ctypes
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

# Healthy values of every constant of loads.h; a zero amplitude switches a law off.
DEFAULTS = {
    "m": 0.012,
    "b": 0.15,
    "Fc": 34.0,
    "k": 0.23,
    "tau0": 9.5,
    "kp": 23.0,
    "kd": 1.0,
    "soft": 0.025,
    "limit": 255.0,
    "angle": 1.35,
    "k2": 0.0,
    "k3": 0.0,
    "weight": 0.0,
    "detent_amp": 0.0,
    "detent_c": 50.0,
    "detent_w": 5.0,
    "detent_law": 0.0,
    "ripple_amp": 0.0,
    "ripple_period": 5.0,
    "ripple_phase": 0.0,
    "ripple_second": 0.0,
    "stop_at": 1e3,
    "stop_k": 0.0,
    "stop_n": 1.0,
    "stop_c": 0.0,
    "low_stop_at": -1e3,
    "low_stop_k": 0.0,
    "touch_at": 1e3,
    "touch_k": 0.0,
    "touch_n": 1.0,
    "touch_c": 0.0,
    "relax_ka": 0.0,
    "relax_kb": 0.0,
    "relax_ta": 1.0,
    "relax_tb": 1.0,
    "slip_amp": 0.0,
    "slip_x": 5.0,
    "slip_law": 0.0,
    "mass_k": 0.0,
    "mass_c": 0.0,
    "mass_m": 0.0,
    "asym": 0.0,
    "stri_amp": 0.0,
    "stri_v": 20.0,
    "stri_law": 0.0,
    "tight_amp": 0.0,
    "tight_c": 50.0,
    "tight_w": 5.0,
    "tight_law": 0.0,
    "mu_flex": 0.0,
    "mu_extend": 0.0,
    "thermal": 0.0,
    "heat_tau": 30.0,
    "heat_law": 0.0,
    "heat_power": 2000.0,
    "age_amp": 0.0,
    "age_tau": 0.5,
    "age_fade": 0.2,
    "b_asym": 0.0,
    "quad": 0.0,
    "sag": 0.0,
    "sag_tau": 0.3,
    "emf": 0.0,
    "enc_amp": 0.0,
    "enc_period": 5.0,
    "enc_phase": 0.0,
    "bristle_x": 0.5,
    "restart": 1.0,
}
STATE = ("heat", "sag", "relax_a", "relax_b", "bristle", "slip0", "slip1", "slip2", "age", "mass_x", "mass_v")
STEP, SKIP = 0.00025, 4
GRID = STEP * SKIP


class Constants(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in DEFAULTS]


class CompilerError(Exception):
    """No C compiler, or it refused drive.c."""


class State(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in STATE]


@cache
def library() -> ctypes.CDLL:
    """The compiled integrator."""
    with tempfile.TemporaryDirectory(prefix="eighth_recorder_") as name:
        return _build(Path(name))


def _build(folder: Path) -> ctypes.CDLL:
    (folder / "params.h").write_text(f"typedef struct {{ double {', '.join(DEFAULTS)}; }} P;\n")
    source = Path(__file__).parent
    command = [
        "cc",
        "-O2",
        "-ffp-contract=off",
        "-fPIC",
        "-shared",
        f"-I{folder}",
        f"-I{source}",
        "-o",
        str(folder / "drive.so"),
        str(source / "drive.c"),
        "-lm",
    ]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise CompilerError("no C compiler: 'cc' is needed") from error
    if done.returncode:
        raise CompilerError(done.stderr)
    return ctypes.CDLL(str(folder / "drive.so"))


def _pointer(array: np.ndarray):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def run_motor(constants: dict, state: State, start: float, inputs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Position [%], speed [%/s], current and reference on the 1 ms grid."""
    names = ("target", "pace", "gate", "away", "gc", "gs", "ext", "dirt")
    arrays = [np.ascontiguousarray(inputs[name], dtype=float) for name in names]
    n = len(arrays[0])
    out = {name: np.zeros(n) for name in ("x", "v", "current", "reference")}
    library().run(
        ctypes.byref(Constants(**constants)),
        ctypes.byref(state),
        n,
        SKIP,
        ctypes.c_double(STEP),
        ctypes.c_double(start),
        *[_pointer(a) for a in arrays],
        *[_pointer(a) for a in out.values()],
    )
    return out


def play(values: np.ndarray, gap: float) -> np.ndarray:
    """The backlash operator."""
    values = np.ascontiguousarray(values, dtype=float)
    out = np.empty_like(values)
    library().play(_pointer(values), _pointer(out), len(values), ctypes.c_double(gap))
    return out
