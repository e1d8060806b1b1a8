"""What a trial commands, and how the palm moves meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .controllers import BANG
from .geometry import RAD, Array, rotation, turn, unit
from .hand import Session

Pose = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Planned:
    """A trial to be recorded; length_s: of a flexion, at least."""

    kind: str
    finger: str
    length_s: float
    purpose: str | None
    number: int


@dataclass
class Protocol:
    """What is the same in all trials of a session: ends of the strokes [%], commanded speeds (shares of the full one),
    what a faked current reads [raw], the motor's temperature (start and rise [deg C], time constant [s])."""

    low: float
    high: float
    speeds: list[float]
    dead_level: float
    command_level: float
    temperature: tuple[float, float, float]
    trials: list[Planned] = field(default_factory=list)
    gaps_s: Array = field(default_factory=lambda: np.zeros(0))  # after each trial


def draw_protocol(rng: np.random.Generator, session: Session) -> Protocol:
    """Two flexions and two or three excitations of each finger; the last of either is kept for validation."""
    low, high = float(rng.uniform(0, 1.5)), float(rng.uniform(96.5, 100))
    speeds = [1.0, *(float(rng.uniform(*ends)) for ends in ((0.45, 0.6), (0.22, 0.32), (0.12, 0.17)))]
    if rng.uniform() < 0.4:
        speeds.append(float(rng.uniform(0.7, 0.85)))
    protocol = Protocol(
        low=low,
        high=high,
        speeds=[float(speed) for speed in rng.permutation(speeds)],
        dead_level=float(rng.integers(-3, 20)),
        command_level=float(rng.integers(60, 200)),
        temperature=(rng.uniform(21, 27), rng.uniform(3, 12), rng.uniform(50, 120)),
    )
    share = 0.62 if session.laboratory.short else 1
    excitations = int(rng.integers(2, 4))
    for finger in session.fingers:
        for k, ends in enumerate(((36, 46), (27, 36))):
            length = rng.uniform(*ends) * share
            protocol.trials.append(Planned("flexion", finger, length, "validate" if k == 1 else None, k))
        for k in range(excitations):
            purpose = "validate" if k == excitations - 1 else None
            protocol.trials.append(Planned("excitation", finger, 0, purpose, k))
    if rng.uniform() < 0.3:
        protocol.trials.sort(key=lambda trial: trial.kind == "excitation")
    return protocol


@dataclass
class Strokes:
    """Commands of a trial: (time [s], target [%], share of the full speed); its duration [s]."""

    commands: list[tuple[float, float, float]]
    duration_s: float


def draw_strokes(rng: np.random.Generator, session: Session, protocol: Protocol, kind: str, length_s: float) -> Strokes:
    """Commands of a trial; each waits for the motion of the one before, as far as a nominal drive tells."""
    top_speed, low, high = session.laboratory.top_speed, protocol.low, protocol.high
    late = 1.3 if session.laboratory.controller == BANG else 1.08
    commands: list[tuple[float, float, float]] = []
    time_s, at = rng.uniform(1.7, 2.3), low

    def go(target: float, share: float, dwell_s: float) -> None:
        nonlocal time_s, at
        commands.append((time_s, target, share))
        speed = top_speed * share
        time_s += abs(target - at) / speed * late + speed / (top_speed * 6) * 1.5 + 0.12 + dwell_s
        at = target

    if kind == "flexion":
        count = 0
        while time_s < length_s:
            share = protocol.speeds[count % len(protocol.speeds)]
            count += 1
            for _ in range(2 if share > 0.8 and rng.uniform() < 0.4 else 1):
                go(high, share, rng.uniform(0.1, 0.5))
                go(low, share, rng.uniform(0.1, 0.5))
    else:
        middle = (low + high) / 2
        for share in (1.0, 0.5):
            for target in (high, low, middle, high, middle, low):
                go(target, share, rng.uniform(0.15, 0.45))
    return Strokes(commands, time_s + 0.5)


def draw_pose(rng: np.random.Generator, session: Session, tilt_deg: float) -> Pose:
    """Turn and origin [mm] of the landmark frame in the world over trial time [s]: a palm that sways, nods by a tilt
    and drifts."""
    first, origin = session.world
    first = first @ turn(rng.normal(size=3) * 0.02)
    tilt = tilt_deg * RAD
    hz = rng.uniform(0.04, 0.09, 3)
    phase = rng.uniform(0, 6.28, (2, 3))
    drift_mm = rng.uniform(4, 14, 3)
    axis = unit(rng.normal(size=3))
    axis[2] *= 0.3  # mostly about a horizontal axis: gravity turns in the hand
    axis = unit(axis)
    size = rng.uniform(0.8, 1.0) * tilt
    middle = rng.uniform(-0.5, 0.5) * tilt if tilt > 0.15 else 0

    def pose(time: Array) -> tuple[Array, Array]:
        sway = np.stack([0.012 * np.sin(2 * np.pi * hz[i] * 1.3 * time + phase[0, i]) for i in range(3)], -1)
        nod = middle + size * np.sin(2 * np.pi * hz[0] * time + phase[0, 0])
        angle = np.linalg.norm(sway, axis=-1) + 1e-12
        turned = first @ rotation(axis, nod) @ rotation(sway / angle[:, None], angle)
        moved = np.stack([drift_mm[i] * np.sin(2 * np.pi * hz[i] * time + phase[1, i]) for i in range(3)], -1)
        return turned, origin + moved

    return pose
