"""Which moves a trial commands, when, and the reference that the drive makes of them."""

from dataclasses import dataclass

import numpy as np

from fifth_recorder.stepper import DT

REST = 1.2  # s at rest before the first command
DWELL = 0.35  # s after a move should have arrived


@dataclass
class Move:
    """One commanded move: to `target` (% of range) at `speed` (share of full speed), told at `at` (s)."""

    at: float
    target: float
    speed: float


def schedule(
    targets: list[tuple[float, float]], full_speed: float, accel: float, dwell: float = DWELL
) -> tuple[list[Move], float]:
    """Moves with their times for (target %, share of full speed) pairs, and when the trial ends (s)."""
    t, here, moves = REST, 0.0, []
    for target, speed in targets:
        moves.append(Move(t, target, speed))
        v = full_speed * speed
        t += abs(target - here) / v + v / accel + dwell
        here = target
    return moves, t


def _profile(t: np.ndarray, distance: float, v: float, accel: float, shape: str) -> tuple[np.ndarray, np.ndarray]:
    """Travelled distance and speed at times t >= 0 after the start of one move."""
    accel *= 2.5 if shape == "ramp" else 1.0
    v = max(min(v, np.sqrt(distance * accel)), 1e-6)
    ramp = v / accel
    total = distance / v + ramp
    u = np.clip(t, 0.0, total)
    knots = np.array([0.0, ramp, total - ramp, total])
    if shape == "scurve":
        a, c = np.clip(u / ramp, 0, 1), np.clip((u - knots[2]) / ramp, 0, 1)
        smooth, area = (lambda q: q * q * (3 - 2 * q)), (lambda q: q**3 - q**4 / 2)
        speed = v * (smooth(a) - smooth(c))
        way = v * (ramp * area(a) + np.clip(u - ramp, 0, None)) - v * ramp * area(c)
        return np.minimum(way, distance), np.where((t >= 0) & (t < total), speed, 0.0)
    speed = np.interp(u, knots, [0.0, v, v, 0.0])
    way = np.where(u < ramp, 0.5 * accel * u**2, v * u - 0.5 * v * ramp)
    way = np.where(u > knots[2], distance - 0.5 * accel * (total - u) ** 2, way)
    return way, np.where((t >= 0) & (t < total), speed, 0.0)


def reference(
    moves: list[Move], end: float, full_speed: float, accel: float, shape: str, delays: np.ndarray
) -> dict[str, np.ndarray]:
    """Setpoint as the drive knows it (later than told by `delays`, s), reference, and speed limit on the DT grid."""
    n = int(round(end / DT))
    t = np.arange(n) * DT
    setpoint, xref, vref, vlim = np.zeros(n), np.zeros(n), np.zeros(n), np.full(n, full_speed)
    here = 0.0
    for move, delay in zip(moves, delays):
        i = min(int(round((move.at + delay) / DT)), n - 1)
        v = full_speed * move.speed
        way, speed = _profile(t[i:] - t[i], abs(move.target - here), v, accel, shape)
        sign = np.sign(move.target - here)
        setpoint[i:], vlim[i:] = move.target, v
        xref[i:], vref[i:] = here + sign * way, sign * speed
        here = move.target
    return {"setpoint": setpoint, "xref": xref, "vref": vref, "vlim": vlim}
