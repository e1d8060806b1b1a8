"""What the twin knows of a hand: geometry, motors, controller, laboratory. Palm frame: the landmark-based one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import HandModelError, did_you_mean

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointTruth:
    """A hinge of the open hand: axis_palm (3,) unit, flexion positive; centre_palm (3,) [m]; markers_palm: label ->
    (3,) [m].
    """

    name: str
    axis_palm: Array
    centre_palm: Array
    markers_palm: Mapping[str, Array]


@dataclass(frozen=True)
class FingerTruth:
    """A finger. proximal_rad: coefficients over u = percent / 100; distal_rad: coefficients over the proximal angle
    [rad].

    Both polynomials are in ascending order and start at zero: the open hand defines the zero of every angle.
    """

    name: str
    actuator: str
    joints: tuple[JointTruth, JointTruth]
    proximal_rad: Array
    distal_rad: Array


@dataclass(frozen=True)
class Controller:
    """Position controller of a drive. kind: "ramp" (PD on a reference of limited speed), "profile" (the same, its
    acceleration limited too) or "cascade" (position, speed with integral).

    gain [raw/%] and damping [raw s/%] of ramp and profile, or of the speed loop [raw s/%] with integral [raw/%];
    speed_full: speed [%/s] at the raw speed 255; acceleration: of the profile [%/s^2].
    """

    kind: str = "ramp"
    gain: float = 22.0
    damping: float = 0.6
    integral: float = 12.0
    speed_full: float = 118.0
    speed_raw_full: float = 255.0
    acceleration: float = 900.0


@dataclass(frozen=True)
class MotorTruth:
    """A drive in raw units: current = inertia a + viscous v + coulomb sign(v) + stiffness p + preload, p in percent
    of the range.

    unrest: standard deviation [raw] of a slow random load, so that repeated cycles differ by more than measurement
    noise. give: distance [%] over which bristles carry the Coulomb friction before it slides; zero for a hard stick.
    """

    actuator: str
    counts_open: float = 12100.0
    counts_close: float = 17900.0
    inertia: float = 0.0125
    viscous: float = 0.145
    coulomb: float = 34.0
    stiffness: float = 0.23
    preload: float = 9.0
    unrest: float = 0.0
    give: float = 0.0
    controller: Controller = field(default_factory=Controller)

    def counts(self, percent: Array) -> Array:
        """Encoder counts of positions [%]."""
        return self.counts_open + (self.counts_close - self.counts_open) * np.asarray(percent, float) / 100.0


@dataclass(frozen=True)
class MocapNoise:
    """The motion capture's dirt. noise_m: standard deviation per coordinate [m]. gaps_per_minute: occlusions per
    marker.

    ghosts_per_minute: unlabelled trajectories per trial; ghost_label_share: share of ghosts that steal a marker's
    label; swaps_per_minute: short label swaps. drift_*: slow motion of the palm; shake_*: its trembling. landmark_m,
    probe_m: placing error of the tip on landmarks and on screw heads [m]; blunder_share: joint trials in which it
    misses the screw head by blunder_m. start_skew_s: the mocap starts up to that much after the trial does. unit:
    "mm" or "m" in the files.
    """

    rate_hz: float = 100.0
    noise_m: float = 1.5e-4
    gaps_per_minute: float = 1.0
    gap_s: float = 0.12
    ghosts_per_minute: float = 0.0
    ghost_label_share: float = 0.0
    swaps_per_minute: float = 0.0
    drift_rad: float = 0.05
    drift_m: float = 0.004
    shake_rad: float = 0.003
    shake_m: float = 2e-4
    landmark_m: float = 1e-4
    probe_m: float = 2e-4
    blunder_share: float = 0.0
    blunder_m: float = 0.006
    start_skew_s: float = 0.0
    unit: str = "mm"


@dataclass(frozen=True)
class LogNoise:
    """The log's dirt. interval_s, jitter_s: mean and half width of the sampling interval; lost_share: rows lost;
    empty_share: cells lost; encoder_counts, current_raw: standard deviations; current_memory_s: correlation time
    of the current noise (0: white); clock_offset_s, clock_rate: log time = offset + rate * session time;
    quantised: whole counts.
    """

    interval_s: float = 0.018
    jitter_s: float = 0.0065
    lost_share: float = 0.0015
    empty_share: float = 0.0
    encoder_counts: float = 3.5
    current_raw: float = 5.0
    current_memory_s: float = 0.0
    clock_offset_s: float = 1000.0
    clock_rate: float = 1.0
    quantised: bool = True


@dataclass(frozen=True)
class SurfaceTruth:
    """A contact surface in the palm frame, hand open: an ellipsoid with centre_palm (3,) [m], axes_palm (3, 3) rows,
    radii_m (3,) [m].
    """

    segment: str
    centre_palm: Array
    axes_palm: Array
    radii_m: Array


@dataclass(frozen=True)
class HandTruth:
    """A whole hand and its laboratory. landmarks_palm, palm_markers_palm: name or label -> (3,) [m]; probe: label ->
    (3,) [m], tip at zero.
    """

    name: str
    side: str
    landmarks_palm: Mapping[str, Array]
    palm_markers_palm: Mapping[str, Array]
    fingers: tuple[FingerTruth, ...]
    motors: Mapping[str, MotorTruth]
    probe: Mapping[str, Array]
    surfaces: tuple[SurfaceTruth, ...] = ()
    mocap: MocapNoise = field(default_factory=MocapNoise)
    log: LogNoise = field(default_factory=LogNoise)
    gravity_world: tuple[float, float, float] = (0.0, 0.0, -9.81)

    def finger(self, name: str) -> FingerTruth:
        """The finger of that name; raises HandModelError with a near name."""
        for finger in self.fingers:
            if finger.name == name:
                return finger
        raise HandModelError(f'the twin has no finger "{name}"; {did_you_mean(name, [f.name for f in self.fingers])}')

    def quiet(self) -> HandTruth:
        """The same hand in a laboratory without dirt: no noise, gaps, quantisation, palm motion or placing error."""
        mocap = MocapNoise(
            rate_hz=self.mocap.rate_hz,
            noise_m=0,
            gaps_per_minute=0,
            drift_rad=0,
            drift_m=0,
            shake_rad=0,
            shake_m=0,
            landmark_m=0,
            probe_m=0,
        )
        log = LogNoise(
            interval_s=self.log.interval_s,
            jitter_s=self.log.jitter_s,
            lost_share=0,
            encoder_counts=0,
            current_raw=0,
            clock_offset_s=self.log.clock_offset_s,
            quantised=False,
        )
        motors = {name: replace(motor, unrest=0.0) for name, motor in self.motors.items()}
        return replace(self, mocap=mocap, log=log, motors=motors)
