"""Runs drive.c: the time stepping of one finger's drive."""

import ctypes
import functools
import hashlib
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

STEP_S = 5e-4
EVERY = 2
TABLE_START, TABLE_STEP, TABLE_SIZE = -10.0, 0.05, 2401
TABLE_Q = TABLE_START + TABLE_STEP * np.arange(TABLE_SIZE)

#: every scalar of drive.c with the value at which it does nothing (or the measured base value)
DEFAULTS: dict[str, float] = {
    "m": 0.012,
    "b": 0.145,
    "Fc": 34.0,
    "k": 0.23,
    "tau0": 9.5,
    "kp": 22.0,
    "kd": 3.0,
    "limit": 255.0,
    "sigma0": 60.0,
    "sigma1": 0.3,
    "sag": 0.0,
    "sag_tau": 0.0,
    "follow_tau": 0.0,
    "rest_at": -100.0,
    "unload": 0.0,
    "arm1": 0.0,
    "arm1_tau": 1.0,
    "arm2": 0.0,
    "arm2_tau": 1.0,
    "stop_at": 1e3,
    "stop_k": 0.0,
    "stop_c": 0.0,
    "touch_from": 0.0,
    "touch_to": 0.0,
    "touch_at": 0.0,
    "touch_k": 0.0,
    "touch_c": 0.0,
    "stribeck": 0.0,
    "vs": 20.0,
    "stribeck_power": 2.0,
    "Fc_asymmetry": 0.0,
    "mu_load": 0.0,
    "mu_drive": 0.0,
    "accel_friction": 0.0,
    "on_time": 0.0,
    "warm": 0.0,
    "warm_tau": 100.0,
    "ageing": 0.0,
    "hysteresis": 0.0,
    "hysteresis_way": 5.0,
    "jenkins_1": 0.0,
    "jenkins_2": 0.0,
    "jenkins_3": 0.0,
    "jenkins_way": 5.0,
    "b_asymmetry": 0.0,
    "b_back": 0.0,
    "quadratic": 0.0,
    "cubic": 0.0,
}


class CompilerError(Exception):
    """No C compiler, or it refused drive.c."""


@dataclass(frozen=True)
class Run:
    """What one run of the drive did, every millisecond: %, %/s, raw, raw, % (finger side)."""

    time: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    current: np.ndarray
    friction: np.ndarray
    finger: np.ndarray


@functools.cache
def _library() -> ctypes.CDLL:
    """Compile drive.c once per content and load it."""
    source = Path(__file__).with_name("drive.c")
    head = "".join(f"#define P_{name} {i}\n" for i, name in enumerate(DEFAULTS))
    head += f"#define TABLE_START ({TABLE_START})\n#define TABLE_STEP {TABLE_STEP}\n#define TABLE_SIZE {TABLE_SIZE}\n"
    code = head + source.read_text()
    folder = Path(tempfile.gettempdir()) / f"seventh_recorder_{hashlib.sha256(code.encode()).hexdigest()[:16]}"
    folder.mkdir(exist_ok=True)
    target = folder / "drive.so"
    if not target.exists():
        with tempfile.TemporaryDirectory(dir=folder) as work:
            c_file, so_file = Path(work) / "drive.c", Path(work) / "drive.so"
            c_file.write_text(code)
            command = ["cc", "-O2", "-shared", "-fPIC", str(c_file), "-o", str(so_file), "-lm"]
            try:
                done = subprocess.run(command, capture_output=True, text=True, check=False)
            except FileNotFoundError as error:
                raise CompilerError("no C compiler: 'cc' is needed") from error
            if done.returncode:
                raise CompilerError(done.stderr)
            so_file.replace(target)
    library = ctypes.CDLL(str(target))
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    library.run.argtypes = [ctypes.c_int, ctypes.c_double, ctypes.c_int] + [array] * 7
    return library


def run_drive(
    scalars: dict[str, float],
    reference: tuple[np.ndarray, np.ndarray],
    extra_load: np.ndarray,
    load_table: np.ndarray,
    friction_table: np.ndarray,
) -> Run:
    """Step the drive along a reference given every STEP_S (position in %, speed in %/s)."""
    values = np.array([scalars.get(name, default) for name, default in DEFAULTS.items()], float)
    position, speed = (np.ascontiguousarray(x, float) for x in reference)
    out = np.zeros(((len(position) + EVERY - 1) // EVERY, 5))
    _library().run(
        len(position),
        STEP_S,
        EVERY,
        values,
        position,
        speed,
        np.ascontiguousarray(extra_load, float),
        np.ascontiguousarray(load_table),
        np.ascontiguousarray(friction_table),
        out,
    )
    return Run(np.arange(len(out)) * STEP_S * EVERY, *out.T)
