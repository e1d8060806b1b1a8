"""From drive position to marker positions: encoder map, linkage, hinges, palm pose, probe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from .geometry import compose, random_turn, rotate, turn, unit
from .influence import Influence
from .motor import Motion
from .schedule import TrialPlan
from .streams import stream
from .truth import FingerTruth, HandTruth, MocapNoise, SurfaceTruth

Array = NDArray[np.float64]

SCREW_M = 0.0085  # half the width of a joint: where the probe finds the screw heads


def joint_angles(finger: FingerTruth, motion: Motion, influences: Sequence[Influence]) -> Array:
    """Proximal and distal angle (n, 2) [rad] of a simulated motion."""
    percent = motion.position
    for influence in influences:
        percent = influence.drive(motion, percent) if influence.drive else percent
    proximal = polyval(percent / 100.0, finger.proximal_rad)
    for influence in influences:
        proximal = influence.proximal(motion, proximal) if influence.proximal else proximal
    driver = proximal
    for influence in influences:
        driver = influence.linkage(motion, driver) if influence.linkage else driver
    distal = polyval(driver, finger.distal_rad)
    for influence in influences:
        distal = influence.distal(motion, distal) if influence.distal else distal
    return np.stack([proximal, distal], axis=1)


def segment_markers(
    finger: FingerTruth, angle_rad: Array, influences: Sequence[Influence], trial: TrialPlan, time_s: Array
) -> dict[str, Array]:
    """Label -> (n, 3) [m] in the palm frame, for angles (n, 2) [rad] at times (n,) [s] of a trial."""
    out: dict[str, Array] = {}
    for depth, joint in enumerate(finger.joints):
        labels = list(joint.markers_palm)
        points = np.broadcast_to(
            np.stack([joint.markers_palm[label] for label in labels]), (len(time_s), len(labels), 3)
        )
        for influence in influences:
            points = influence.segment(trial, time_s, joint.name, points) if influence.segment else points
        for i in range(depth, -1, -1):
            hinge = finger.joints[i]
            rotation, shift = turn(hinge.axis_palm, angle_rad[:, i]), np.zeros((len(time_s), 3))
            for influence in influences:
                if influence.pose:
                    extra, moved = influence.pose(i, angle_rad[:, i])
                    rotation, shift = compose(extra, rotation), shift + moved
            points = rotate(rotation[:, None], points - hinge.centre_palm) + hinge.centre_palm + shift[:, None]
        out |= {label: points[:, k] for k, label in enumerate(labels)}
    return out


@dataclass(frozen=True)
class PalmPose:
    """The palm in the world: a base pose, slow drift and trembling as sums of sinusoids, and a large turn where
    asked.
    """

    base: Array
    position_m: Array
    rotation_rad: Array  # (k, 3) amplitudes
    shift_m: Array  # (k, 3)
    frequency_hz: Array  # (k,)
    phase_rad: Array  # (k, 3)
    turn_rad: float = 0.0
    turn_hz: float = 0.0
    turn_axis: tuple[float, float, float] = (1.0, 0.0, 0.0)

    def at(self, time_s: Array) -> tuple[Array, Array]:
        """Quaternions (n, 4) and origins (n, 3) [m] of the palm frame in the world."""
        wave = np.sin(2 * np.pi * self.frequency_hz[:, None] * time_s[:, None, None] + self.phase_rad)
        vector = (self.rotation_rad * wave).sum(1)
        shift = (self.shift_m * wave[..., ::-1]).sum(1)
        small = turn(vector + 1e-12, np.linalg.norm(vector, axis=1))
        large = turn(np.array(self.turn_axis), self.turn_rad * np.sin(2 * np.pi * self.turn_hz * time_s))
        return compose(compose(self.base, large), small), self.position_m + shift


def palm_pose(noise: MocapNoise, seed: int, trial: str, turns: bool = False) -> PalmPose:
    """The palm's motion in one trial; the base pose is one per session, moved a little between trials."""
    session, rng = stream(seed, "palm"), stream(seed, "palm", trial)
    base = random_turn(session)
    base = compose(base, random_turn(rng, 2 * noise.drift_rad * rng.uniform()))
    slow, fast = rng.uniform(0.02, 0.15, 3), rng.uniform(3.0, 9.0, 2)
    scale = np.concatenate([np.full(3, noise.drift_rad / 3), np.full(2, noise.shake_rad / 2)])[:, None]
    shift = np.concatenate([np.full(3, noise.drift_m / 3), np.full(2, noise.shake_m / 2)])[:, None]
    return PalmPose(
        base,
        session.uniform([-0.5, -0.5, 0.7], [0.5, 0.5, 1.3]) + noise.drift_m * rng.normal(size=3),
        scale * rng.normal(size=(5, 3)),
        shift * rng.normal(size=(5, 3)),
        np.concatenate([slow, fast]),
        rng.uniform(0, 2 * np.pi, (5, 3)),
        turn_rad=1.0 if turns else 0.0,
        turn_hz=float(rng.uniform(0.035, 0.06)),
        turn_axis=tuple(rotate(base * [1, -1, -1, -1], np.array([1.0, 0.3, 0.0]))),
    )


def gravity_palm(pose: PalmPose, truth: HandTruth, time_s: Array) -> Array:
    """Unit vectors of gravity (n, 3) in the palm frame."""
    rotation, _ = pose.at(time_s)
    return rotate(rotation * np.array([1.0, -1, -1, -1]), unit(truth.gravity_world))


def probe_target(truth: HandTruth, trial: TrialPlan, time_s: Array) -> tuple[Array, Array]:
    """Tip (n, 3) [m] and outward direction (n, 3) of the probe in the palm frame during a probe trial."""
    n = len(time_s)
    if trial.kind == "surface":
        surface = next(s for s in truth.surfaces if s.segment == trial.segment)
        return sweep(surface, time_s / trial.duration_s)
    if trial.kind == "landmark":
        point, direction = truth.landmarks_palm[trial.landmark], np.array([0.0, 0.0, 1.0])
    else:
        joint = next(j for j in truth.finger(trial.finger).joints if j.name == trial.joint)
        outwards = -1.0 if truth.side == "left" else 1.0  # medial is the index side: -y on a left hand
        direction = joint.axis_palm * outwards * (1.0 if trial.side == "medial" else -1.0)
        point = joint.centre_palm + SCREW_M * direction
    return np.broadcast_to(point, (n, 3)), np.broadcast_to(direction, (n, 3))


def sweep(surface: SurfaceTruth, progress: Array, turns: float = 24.0) -> tuple[Array, Array]:
    """Points (n, 3) [m] and outward normals (n, 3) on a surface along a spiral, progress (n,) in 0..1."""
    height = 1.0 - 2.0 * np.clip(progress, 0, 1)
    ring = np.sqrt(np.maximum(0.0, 1.0 - height**2))
    angle = 2 * np.pi * turns * progress
    sphere = np.stack([height, ring * np.cos(angle), ring * np.sin(angle)], axis=1)
    normal = unit(sphere / surface.radii_m) @ surface.axes_palm
    return (sphere * surface.radii_m) @ surface.axes_palm + surface.centre_palm, normal


def probe_markers(truth: HandTruth, trial: TrialPlan, time_s: Array, seed: int) -> dict[str, Array]:
    """Label -> (n, 3) [m], palm frame: the probe held on its target, the hand that holds it wavering."""
    rng = stream(seed, "probe", trial.name)
    steady = truth.mocap.drift_rad == 0 and truth.mocap.shake_rad == 0
    if trial.kind == "pivot":
        tip, direction = (
            np.broadcast_to([0.06, 0.0, 0.08], (len(time_s), 3)),
            np.broadcast_to([0.0, 0.0, 1.0], (len(time_s), 3)),
        )
        tilt = 0.6
    else:
        tip, direction = probe_target(truth, trial, time_s)
        tilt = 0.0 if steady else 0.12
    if trial.kind in ("landmark", "joint_probe"):
        tip = tip + (truth.mocap.landmark_m if trial.kind == "landmark" else truth.mocap.probe_m) * rng.normal(size=3)
        if trial.kind == "joint_probe" and rng.uniform() < truth.mocap.blunder_share:
            tip = tip + truth.mocap.blunder_m * unit(rng.normal(size=3))
    elif trial.kind == "surface":
        tip = tip + truth.mocap.probe_m * rng.normal(size=(len(time_s), 3))
    up = np.array([0.0, 0.0, 1.0])
    # The shortest turn that takes the probe's z axis to the outward direction (half-way quaternion).
    half = np.concatenate([1.0 + direction @ up[:, None], np.cross(up, direction)], axis=1)
    half = np.where(half[:, :1] < 1e-6, [0.0, 1.0, 0.0, 0.0], half)
    rotation = compose(unit(half), turn(up, np.full(len(time_s), rng.uniform(0, 2 * np.pi))))
    angle, phase = 2 * np.pi * np.outer(time_s, rng.uniform(0.2, 0.5, 2)), rng.uniform(0, 2 * np.pi, 2)
    waver = tilt * np.sin(angle + phase)
    rotation = compose(rotation, compose(turn([1.0, 0, 0], waver[:, 0]), turn([0, 1.0, 0], waver[:, 1])))
    return {label: tip + rotate(rotation, point) for label, point in truth.probe.items()}
