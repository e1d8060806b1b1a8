"""What a joint truly does: its friction, loads and small imperfections, as scalars while time steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

LOAD_SIDES = ("joint", "motor", "gear")


@dataclass(frozen=True)
class Law:
    """One joint [SI; N m, rad for a hinge, N, m for a slide]. weight: m g l; tilt: of gravity or of the weight off its
    axis [rad].

    by_load: friction per load, reckoned from what the joint carries, from its motor or from the mean of both
    (load_side);
    slow_load: the same at low speed only. tight, spot: (centre, width, height) of a friction or a one-sided load tied
    to a place. stop: (yield load, reach). ripple: (amplitude, period, phase). grit: friction that wanders in time
    (amplitude, correlation time [s]); slosh: (stiffness, inertia, damping) of a second mass on a spring that nobody
    declared.
    """

    inertia: float
    weight: float = 0.0
    tilt: float = 0.0
    viscous: float = 0.0
    coulomb: float = 0.0
    asymmetry: float = 0.0
    stribeck: float = 0.0
    stribeck_speed: float = 1.0
    drag: float = 0.0
    by_load: float = 0.0
    slow_load: float = 0.0
    load_side: str = "joint"
    offset: float = 0.0
    tight: tuple[float, float, float] = (0.0, 1.0, 0.0)
    spot: tuple[float, float, float] = (0.0, 1.0, 0.0)
    stop: tuple[float, float] = (0.0, 1.0)
    ripple: tuple[float, float, float] = (0.0, 1.0, 0.0)
    stiffness: float = 0.0
    grit: tuple[float, float] = (0.0, 1.0)
    slosh: tuple[float, float, float] = (0.0, 1.0, 0.0)

    def dry(self, q: float, v: float, load: float, drive: float, grit: float) -> float:
        """Bound of dry friction at position q, velocity v, with the load that the joint carries and its motor's
        effort."""
        slow = math.exp(-((v / self.stribeck_speed) ** 2))
        side = {"joint": abs(load), "motor": abs(drive), "gear": 0.5 * (abs(load) + abs(drive))}[self.load_side]
        place = self.tight[2] * math.exp(-0.5 * ((q - self.tight[0]) / self.tight[1]) ** 2) if self.tight[2] else 0.0
        return max(
            self.coulomb
            + self.stribeck * slow
            + (self.by_load + self.slow_load * slow) * side
            + place
            + self.grit[0] * grit,
            0.0,
        )

    def smooth(self, q: float, v: float) -> float:
        """Effort that opposes the drive, without inertia and dry friction: viscous, drag, springs, ripple."""
        out = (
            self.viscous * (1.0 + math.copysign(self.asymmetry, v)) * v
            + self.drag * v * abs(v)
            - self.offset
            + self.stiffness * q
        )
        if self.ripple[0]:
            out += self.ripple[0] * math.sin(2 * math.pi * q / self.ripple[1] + self.ripple[2])
        if self.spot[2]:
            out += self.spot[2] * math.exp(-0.5 * ((q - self.spot[0]) / self.spot[1]) ** 2)
        return out

    def pull(self, q: float) -> float:
        """Weight [N m] at position q."""
        return self.weight * math.sin(q + self.tilt)
