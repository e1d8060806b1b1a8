"""BeBionic hands from the published axes and centres, each seed another specimen in another laboratory."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..errors import HandModelError
from .geometry import random_turn, rotate, unit
from .published import FINGERS, published_joint
from .streams import stream
from .truth import Controller, FingerTruth, HandTruth, JointTruth, LogNoise, MocapNoise, MotorTruth, SurfaceTruth

Array = NDArray[np.float64]

# Full flexion [rad] of proximal and distal joints: of the order of a BeBionic's ranges; not published as a table.
RANGE_RAD = {
    "thumb_0": (0.62, 0.35),
    "thumb_1": (0.66, 0.40),
    "index": (1.35, 1.20),
    "middle": (1.40, 1.25),
    "ring": (1.38, 1.22),
    "little": (1.30, 1.15),
}
CODE = {"thumb_0": "T0", "thumb_1": "T1", "index": "IN", "middle": "MI", "ring": "RI", "little": "LI"}
SEGMENTS = ("proximal", "distal")


def bebionic(side: str, seed: int | None = None, fingers: Iterable[str] | None = None) -> HandTruth:
    """A BeBionic hand of one side with the published geometry and typical motors.

    seed: perturbs geometry by a few degrees and millimetres, couplings, motors, controller, encoder range and the
    noise of the laboratory; None leaves every value at its nominal figure. fingers: any of thumb_0, thumb_1, index,
    middle, ring, little (default: all). Raises HandModelError for names that were not published or are given twice.
    """
    names = tuple(fingers) if fingers is not None else FINGERS
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise HandModelError(f'the finger "{twice[0]}" is named twice; each finger once is needed')
    sign = 1.0 if side == "left" else -1.0
    spread = 0.0 if seed is None else 1.0
    motors = {actuator: _motor(actuator, seed) for actuator in dict.fromkeys(_actuator(name) for name in names)}
    truths = tuple(_finger(side, name, seed) for name in names)
    rng = stream(seed or 0, "palm", side)
    mirror = np.array([1.0, sign, 1.0])
    half = 0.024 + 0.003 * spread * rng.uniform(-1, 1)
    landmarks = {
        "origin": np.zeros(3),
        "medial": np.array([0.052 + 0.004 * spread * rng.uniform(-1, 1), -half, 0.0]) * mirror,
        "lateral": np.array([0.047 + 0.004 * spread * rng.uniform(-1, 1), half, 0.0]) * mirror,
    }
    nominal = {"PO": [-0.012, -0.004, 0.011], "PM": [0.035, -0.030, 0.016], "PL": [0.030, 0.029, 0.014]}
    palm = {label: (np.array(p) + 0.004 * spread * rng.normal(size=3)) * mirror for label, p in nominal.items()}
    probe = {"T1": [0.0, 0.0, 0.085], "T2": [0.0, 0.0, 0.125], "T3": [0.034, 0.0, 0.11], "T4": [-0.026, 0.008, 0.118]}
    moved = {label: np.array(p) + spread * rng.normal(0, 0.004, 3) for label, p in probe.items()}
    return HandTruth(
        name="bebionic",
        side=side,
        landmarks_palm=landmarks,
        palm_markers_palm=palm,
        fingers=truths,
        motors=motors,
        # Rounded, so that the manifest holds exactly the probe that is simulated.
        probe={label: np.round(p, 5) for label, p in moved.items()},
        surfaces=_surfaces(side, truths),
        mocap=MocapNoise() if seed is None else _mocap_noise(stream(seed, "mocap")),
        log=LogNoise() if seed is None else _log_noise(stream(seed, "log")),
    )


def _actuator(finger: str) -> str:
    return "thumb" if finger.startswith("thumb") else finger


def _finger(side: str, name: str, seed: int | None) -> FingerTruth:
    spread = 0.0 if seed is None else 1.0
    rng = stream(seed or 0, "finger", name)
    mirror = np.array([1.0, 1.0 if side == "left" else -1.0, 1.0])
    axes, centres = published_joint(side, name)
    joints = []
    for i, segment in enumerate(SEGMENTS):
        axis = rotate(random_turn(rng, spread * np.radians(rng.uniform(0, 3))), axes[i])
        centre = centres[i] + spread * rng.normal(0, 0.001, 3)
        along = unit(centres[1] - centres[0])
        middle = centre + (0.016 + spread * rng.uniform(-0.003, 0.005)) * along
        across, up = unit(axes[i]), unit(np.cross(along, axes[i])) * mirror[1]
        up = up if up[2] > 0 or abs(up[2]) < 0.3 else -up
        plate = np.array([[-0.006, -0.005, 0.009], [0.009, -0.004, 0.011], [0.001, 0.009, 0.016]])  # about 15 mm apart
        plate = plate + spread * rng.normal(0, 0.0012, (3, 3))
        basis = np.stack([along, across, up])
        markers = {f"{CODE[name]}_{segment[0].upper()}{j + 1}": middle + row @ basis for j, row in enumerate(plate)}
        joints.append(JointTruth(segment, axis, centre, markers))
    proximal, distal = RANGE_RAD[name]
    scale = 1.0 + 0.06 * spread * rng.uniform(-1, 1, 2)
    proximal, distal = proximal * scale[0], distal * scale[1]
    bend = np.array([1.0, 0.06, -0.05]) + 0.04 * spread * rng.normal(size=3) * [0, 1, 1]
    knee = np.array([0.62, 0.05, 0.35, 0.10]) + 0.05 * spread * rng.normal(size=4)
    if name.startswith("thumb"):
        knee = np.array([0.85, 0.10, 0.05, 0.0]) + 0.03 * spread * rng.normal(size=4)
    order = np.arange(1, 5)
    return FingerTruth(
        name,
        _actuator(name),
        (joints[0], joints[1]),
        np.concatenate([[0.0], proximal * bend / bend.sum()]),
        np.concatenate([[0.0], distal * knee / knee.sum() / proximal**order]),
    )


def _motor(actuator: str, seed: int | None) -> MotorTruth:
    if seed is None:
        return MotorTruth(actuator)
    rng, shared = stream(seed, "motor", actuator), stream(seed, "controller")
    opened = round(shared.uniform(2000, 14000), -2) + round(rng.uniform(-40, 40))
    kind = "ramp" if shared.uniform() < 0.6 else "cascade"
    gain, damping = shared.uniform(16, 30) if kind == "ramp" else shared.uniform(1.6, 3.0), shared.uniform(0.45, 0.8)
    integral, speed_full = shared.uniform(9, 16), shared.uniform(85, 140)
    raw_full, more, give = float(shared.choice([255, 255, 100])), stream(seed, "profile"), 0.0
    if kind == "ramp" and more.uniform() < 0.5:
        kind, damping, give = "profile", more.uniform(1.5, 3.5), more.uniform(0.4, 0.8)
    controller = Controller(kind, gain, damping, integral, speed_full, raw_full, more.uniform(700, 1200))
    return MotorTruth(
        actuator,
        float(opened),
        float(opened + round(shared.uniform(3500, 9000), -2)),
        inertia=0.0125 * rng.uniform(0.8, 1.25),
        viscous=0.145 * rng.uniform(0.75, 1.3),
        coulomb=34.0 * rng.uniform(0.7, 1.2),
        stiffness=0.23 * rng.uniform(0.8, 1.25),
        preload=9.0 * rng.uniform(0.7, 1.4),
        unrest=float(shared.choice([0.0, 0.0, 0.8])),
        give=give * rng.uniform(0.9, 1.1),
        controller=controller,
    )


def _mocap_noise(rng: np.random.Generator) -> MocapNoise:
    dirty = rng.uniform() < 0.4
    return MocapNoise(
        rate_hz=float(rng.choice([100.0, 100.0, 100.0, 120.0, 150.0])),
        noise_m=float(rng.uniform(1e-4, 4e-4)),
        gaps_per_minute=float(rng.uniform(0.3, 3.0)),
        gap_s=float(rng.uniform(0.05, 0.3)),
        ghosts_per_minute=float(rng.uniform(0.5, 3.0)) if dirty else 0.0,
        ghost_label_share=0.3 if dirty else 0.0,
        drift_rad=float(rng.uniform(0.01, 0.15)),
        drift_m=float(rng.uniform(0.001, 0.02)),
        shake_rad=float(rng.uniform(0.0, 0.006)),
        shake_m=float(rng.uniform(0.0, 5e-4)),
        landmark_m=float(rng.uniform(5e-5, 1.5e-4)),
        probe_m=float(rng.uniform(1e-4, 3e-4)),
        blunder_share=float(rng.choice([0.0, 0.1])),
        start_skew_s=float(rng.uniform(0.0, 0.5)),
    )


def _log_noise(rng: np.random.Generator) -> LogNoise:
    interval = float(rng.uniform(0.011, 0.021))
    return LogNoise(
        interval_s=interval,
        jitter_s=interval * float(rng.uniform(0.1, 0.4)),
        lost_share=float(rng.choice([0.0, 0.0015, 0.01])),
        empty_share=float(rng.choice([0.0, 0.0, 0.003])),
        encoder_counts=float(rng.uniform(1.0, 6.0)),
        current_raw=float(rng.uniform(3.0, 8.0)),
        current_memory_s=float(rng.choice([0.0, 0.0, 0.02])),
        clock_offset_s=float(rng.uniform(100, 5000)),
    )


def _surfaces(side: str, fingers: tuple[FingerTruth, ...]) -> tuple[SurfaceTruth, ...]:
    """An ellipsoidal palm, and one ellipsoid round each proximal segment from joint to joint."""
    palm = SurfaceTruth("palm", np.array([0.005, 0.0, -0.004]), np.eye(3), np.array([0.050, 0.040, 0.014]))
    surfaces = [palm]
    for finger in fingers:
        first, second = (joint.centre_palm for joint in finger.joints)
        along = unit(second - first)
        across = unit(finger.joints[0].axis_palm - along * (along @ finger.joints[0].axis_palm))
        axes = np.stack([along, across, np.cross(along, across)])
        radii = np.array([0.6 * np.linalg.norm(second - first), 0.009, 0.0095])
        surfaces.append(SurfaceTruth(f"{finger.name}/proximal", 0.5 * (first + second), axes, radii))
    return tuple(surfaces)
