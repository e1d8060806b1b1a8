"""Compile stepper.c once per machine and user, and call it with arrays."""

import ctypes
import hashlib
import os
import subprocess
import tempfile
from dataclasses import astuple, dataclass, fields
from functools import cache
from pathlib import Path

import numpy as np

from fifth_recorder.dynamics import Dynamics

COLUMNS = ("x", "v", "a", "u", "friction", "shadow", "extra", "contact", "heat")
STATES = 12
DT = 0.001  # s


class CompilerError(RuntimeError):
    """There is no C compiler named cc, or it does not compile the stepper."""


@dataclass
class Drive:
    """What acts on a motor over one trial, one value per DT."""

    setpoint: np.ndarray  # %
    xref: np.ndarray  # %
    vref: np.ndarray  # %/s
    vlim: np.ndarray  # %/s
    load: np.ndarray  # raw, added whatever the motion
    friction: np.ndarray  # raw, added to the friction level
    spring: np.ndarray  # raw per %, added to the spring rate
    contact: np.ndarray  # 0..1, whether the obstacle is there
    heat: np.ndarray  # share of Fc added


def _source() -> str:
    lines = [f"#define P_{f.name} {i}" for i, f in enumerate(fields(Dynamics))]
    lines += [f"#define O_{name} {i}" for i, name in enumerate(COLUMNS)] + [f"#define O_COUNT {len(COLUMNS)}"]
    return "\n".join([*lines, Path(__file__).with_name("stepper.c").read_text()])


@cache
def library() -> ctypes.CDLL:
    """The compiled stepper; raises CompilerError."""
    text = _source()
    folder = Path(tempfile.gettempdir()) / f"fifth_recorder_{os.getuid()}"
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
                f"the fifth recorder's motor is C, and `{' '.join(command)}` failed: {error}"
            ) from error
        built.rename(target)
        source.unlink()
    return ctypes.CDLL(str(target))


def _pointer(a: np.ndarray) -> ctypes.c_void_p:
    return a.ctypes.data_as(ctypes.c_void_p)


def step(dyn: Dynamics, drive: Drive, state: np.ndarray) -> np.ndarray:
    """Run one trial from `state` (changed in place); returns rows of COLUMNS at DT."""
    n = len(drive.setpoint)
    out = np.zeros((n, len(COLUMNS)))
    p = np.array(astuple(dyn), float)
    arrays = [np.ascontiguousarray(a, float) for a in _fields(drive)]
    library().run(
        ctypes.c_long(n), ctypes.c_double(DT), _pointer(p), *map(_pointer, arrays), _pointer(state), _pointer(out)
    )
    return out


def _fields(drive: Drive) -> list[np.ndarray]:
    """The arrays of a drive in the order of its fields, not copied."""
    return [getattr(drive, f.name) for f in fields(drive)]


def _apply(name: str, x: np.ndarray, *numbers: float) -> np.ndarray:
    x = np.ascontiguousarray(x, float)
    y = np.empty_like(x)
    getattr(library(), name)(ctypes.c_long(len(x)), *map(ctypes.c_double, numbers), _pointer(x), _pointer(y))
    return y


def play(x: np.ndarray, width: float) -> np.ndarray:
    """Lost motion of full width `width`, in the units of x."""
    return _apply("play", x, width)


def memory(x: np.ndarray, distance: float) -> np.ndarray:
    """-1..1, direction of travel with exponential build-up over `distance` after a reversal."""
    return _apply("memory", x, distance)


def lag(x: np.ndarray, tau: float) -> np.ndarray:
    """First-order lag of time constant `tau` seconds of a series at DT."""
    return _apply("lag", x, DT, tau) if tau > 0 else x.copy()
