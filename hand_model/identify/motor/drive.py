"""The drive simulated in raw units: profile generator, controller, mass, spring and friction; many moves at once.

Plant: inertia a = u - viscous v - F - stiffness p - preload, with the friction of LuGre (Canudas de Wit et al. 1995),
    F = f + bristle f',  f' = (level(v) - f sign(v)) v / distance,  level(v) = coulomb (1 + (ratio - 1) exp(-|v / stribeck|^exponent)),
which sticks (any f within its bounds at v = 0) and becomes Coulomb's as the presliding distance goes to zero.
Controller: u = gain (r - p) + damping (r' - v), within the current limit. Two kinds make the reference r:
    "profile": a trapezoidal velocity profile from the old to the new setpoint (a ramp where rise and fall take no time);
    "cascade": r' follows position_gain (setpoint - p) within the speed limit and a slew rate, and holds within a deadband, which sets in over a width `edge`; as r is
    the integral of the wanted speed, this is a position loop round a speed loop with proportional and integral action.
The recorded current acts `lead` seconds later: a loop that samples holds its value until the next step.
A loop that samples acts late: p and v reach the controller `delay` seconds old, to first order (p - delay v, v - delay a).
Integrated by the implicit midpoint rule, linear within a step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 2e-3
SHARED = ("inertia", "viscous", "coulomb", "stiffness", "preload", "presliding", "bristle", "speed_full", "rise", "gain", "damping", "delay", "lead")
CONTROLLERS = {"profile": (*SHARED, "fall"), "cascade": (*SHARED, "position_gain", "deadband")}
STRIBECK = ("static_ratio", "stribeck_speed")


@dataclass(frozen=True)
class Moves:
    """Moves from rest, one per entry (B,): start_s of the command after the move's own zero [s], origin and target [%],
    speed [share of full], limit [raw], position [%] and current hold [raw] at rest, duration_s [s], velocity [%/s] of a drive that
    creeps within its deadband; by falling duration for `simulate`."""

    start_s: Array
    origin: Array
    target: Array
    speed: Array
    limit: Array
    position: Array
    hold: Array
    duration_s: Array
    velocity: Array | float = 0.0


def profile(time_s: Array, moves: Moves, q: Mapping[str, Array]) -> tuple[Array, Array]:
    """Reference [%] and its velocity [%/s], (n, B), of trapezoidal moves at times (n,) [s]."""
    distance, sign = np.abs(moves.target - moves.origin), np.sign(moves.target - moves.origin)
    up, down = q["speed_full"] / np.maximum(q["rise"], 1e-4), q["speed_full"] / np.maximum(q["fall"], 1e-4)
    top = np.minimum(q["speed_full"] * moves.speed, np.sqrt(2 * distance * up * down / (up + down)))
    top = np.maximum(top, 1e-9)
    t_up, t_down = top / up, top / down
    t_flat = np.maximum(distance / top - 0.5 * (t_up + t_down), 0.0)
    t = time_s[:, None] - moves.start_s
    a = np.clip(t, 0.0, t_up)
    b = np.clip(t - t_up, 0.0, t_flat)
    c = np.clip(t - t_up - t_flat, 0.0, t_down)
    reference = 0.5 * up * a * a + top * b + (top - 0.5 * down * c) * c
    return moves.origin + sign * reference, sign * (up * a - down * c)


def simulate(moves: Moves, q: Mapping[str, Array], step_s: float = STEP_S, controller: str = "profile") -> tuple[Array, Array, Array]:
    """Time (n,) [s], position (n, B) [%] and current (n, B) [raw] of B moves under B parameter sets (each (B,)).

    Every move starts at rest in balance, so its friction there is what the controller pushes less the spring; where it creeps,
    friction is that of sliding.
    Rows after a move's duration are not filled.
    """
    n = int(np.ceil(moves.duration_s.max() / step_s)) + 2
    time_s = np.arange(n) * step_s
    cascade = controller == "cascade"
    r, w = (None, None) if cascade else profile(time_s, moves, q)
    active = np.searchsorted(-moves.duration_s, -(time_s - 2 * step_s), side="right")
    gain, damping, limit = q["gain"], q["damping"], moves.limit
    spring, preload, viscous = q["stiffness"], q["preload"], q["viscous"]
    exponent, bristle = q["stribeck_exponent"], q["bristle"]
    ratio, per_speed = q["static_ratio"] - 1.0, 1.0 / q["stribeck_speed"]
    coulomb, distance = q["coulomb"], q["presliding"]
    has_stribeck = bool(np.any(ratio != 0.0))
    half = 0.5 * step_s
    mass = q["inertia"] / half
    position, current = np.empty((n, len(moves.target))), np.empty((n, len(moves.target)))
    p, v = moves.position.copy(), np.zeros(len(moves.target)) + moves.velocity
    u = np.clip(moves.hold if cascade else gain * (r[0] - p), -limit, limit)
    if cascade:
        r_now, w_now = p + (u + damping * v) / gain, np.zeros(len(p))
        slew, top_speed = step_s * q["speed_full"] / np.maximum(q["rise"], 1e-4), q["speed_full"] * moves.speed
        started = moves.start_s
    top = coulomb * (1.0 + ratio)
    f = np.where(v == 0.0, np.clip(u - spring * p - preload, -top, top), np.sign(v) * top)
    touch = "contact_stiffness" in q
    linear = mass + viscous + half * spring
    delay = np.minimum(q["delay"], 0.8 * q["inertia"] / np.maximum(damping, 1e-9))
    closed = gain * (half - delay) + damping * (1.0 - delay / half)
    a = np.zeros(len(p))
    for i in range(n):
        k = active[i]
        if k == 0:
            break
        if k < len(p):
            p, v, f, a = p[:k], v[:k], f[:k], a[:k]
        if cascade:
            r_now, w_now = r_now[:k], w_now[:k]
            # the share of this step that lies behind the command, so that its instant counts within a step too
            since = np.minimum(np.maximum((time_s[i] + step_s - started[:k]) / step_s, 0.0), 1.0)
            share, change = _cascade(q, k, moves.target[:k] - p, w_now, top_speed, slew)
            if since.min() < 1.0:
                old_share, old_change = _cascade(q, k, moves.origin[:k] - p, w_now, top_speed, slew)
                share, change = since * share + (1 - since) * old_share, since * change + (1 - since) * old_change
            w_next = w_now + change
            r_next = r_now + 0.5 * step_s * (w_now + w_next)
        else:
            r_now, w_now = r[i, :k], w[i, :k]
            r_next, w_next = (r[i + 1, :k], w[i + 1, :k]) if i + 1 < n else (r_now, w_now)
        late = delay[:k]
        u = gain[:k] * (r_now - p + late * v) + damping[:k] * (w_now - v + late * a)
        position[i, :k] = p
        current[i, :k] = np.minimum(np.maximum(u, -limit[:k]), limit[:k])
        if i + 1 == n:
            break
        level = coulomb[:k]
        if has_stribeck:
            level = level * (1.0 + ratio[:k] * np.exp(-(np.abs(v * per_speed[:k]) ** exponent[:k])))
        ahead = gain[:k] * (0.5 * (r_now + r_next) - p) + damping[:k] * 0.5 * (w_now + w_next)
        rest = mass[:k] * v - spring[:k] * p - preload[:k] - f
        ahead = ahead - damping[:k] * late * v / half
        push = rest + ahead
        way = np.sign(push)
        travel = np.maximum(step_s * np.abs(v), 1e-6 * distance[:k])
        slope = (level - f * way) * -np.expm1(-travel / distance[:k]) / travel
        inner = linear[:k] + (half + bristle[:k]) * slope
        if touch:
            pressed = np.where(p > q["contact_at"][:k], q["contact_stiffness"][:k], 0.0)
            push = push - pressed * (p - q["contact_at"][:k])
            rest = rest - pressed * (p - q["contact_at"][:k])
            inner = inner + pressed * (half + q["contact_damping"][:k])
        middle = push / (inner + closed[:k])
        u_middle = ahead - closed[:k] * middle
        over = np.abs(u_middle) > limit[:k]
        if over.any():
            middle = np.where(over, (rest + np.sign(u_middle) * limit[:k]) / inner, middle)
        if cascade:  # within the deadband the integral holds: the reference goes with the drive
            r_now = share * r_next + (1 - share) * (r_now + step_s * middle)
            w_now = w_next
        p = p + step_s * middle
        a = (middle - v) / half
        v = 2.0 * middle - v
        limit_f = np.sign(middle) * level
        f = limit_f + (f - limit_f) * np.exp(-step_s * np.abs(middle) / distance[:k])
    return time_s, position, current


def _cascade(q: Mapping[str, Array], k: int, error: Array, speed: Array, top_speed: Array, slew: Array) -> tuple[Array, Array]:
    """Share (0..1) in which a position error (k,) [%] is outside the deadband, and the change of the wanted speed [%/s] in one step."""
    share = np.minimum(np.maximum((np.abs(error) - q["deadband"][:k]) / q["edge"][:k] + 0.5, 0.0), 1.0)
    wanted = share * np.minimum(np.maximum(q["position_gain"][:k] * error, -top_speed[:k]), top_speed[:k])
    return share, np.minimum(np.maximum(wanted - speed, -slew[:k]), slew[:k])


def cascade_step(
    q: Mapping[str, float], error: float, speed: float, reference: float, wanted: float, velocity: float, step_s: float
) -> tuple[float, float]:
    """Reference [%] and wanted speed [%/s] of the cascade after one step of step_s [s], for a controller in another simulator's loop.

    error [%]: setpoint less position; speed: share of full; velocity [%/s] of the drive.
    """
    one = {k: np.atleast_1d(np.asarray(q[k], float)) for k in ("deadband", "edge", "position_gain", "speed_full", "rise")}
    slew = step_s * one["speed_full"] / np.maximum(one["rise"], 1e-4)
    share, change = _cascade(one, 1, np.atleast_1d(error), np.atleast_1d(wanted), one["speed_full"] * speed, slew)
    s, w = float(share[0]), wanted + float(change[0])
    # within the deadband the integral holds: the reference goes with the drive
    return s * (reference + 0.5 * step_s * (wanted + w)) + (1 - s) * (reference + step_s * velocity), w
