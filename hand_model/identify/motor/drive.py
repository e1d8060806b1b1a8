"""The drive simulated in raw units: profile generator, controller, mass, spring and friction; many moves at once.

Plant: inertia a = u - viscous v - F - stiffness p - preload, with the friction of LuGre (Canudas de Wit et al. 1995),
    F = f + bristle f',  f' = (level(v) - f sign(v)) v / distance,  level(v) = coulomb (1 + (ratio - 1) exp(-|v / stribeck|^exponent)),
which sticks (any f within its bounds at v = 0). Without a presliding distance friction is Coulomb's, set-valued at rest: bristles however
stiff let a drive off before they hold it, for a time that falls with the square root of their distance only.
Controller: u = gain (r - p) + damping (r' - v), within the current limit. Two kinds make the reference r:
    "profile": a trapezoidal velocity profile from the old to the new setpoint (a ramp where rise and fall take no time);
    "cascade": r' follows position_gain (setpoint - p) within the speed limit and a slew rate, and holds within a deadband, which sets in over a width `edge`; as r is
    the integral of the wanted speed, this is a position loop round a speed loop with proportional and integral action.
The recorded current acts `lead` seconds later: a loop that samples holds its value until the next step.
A loop that samples acts late: p and v reach the controller `delay` seconds old, to first order (p - delay v, v - delay a).
A generator that sums up its reference step by step has the velocity r' `lag` seconds behind r.
Integrated by the implicit midpoint rule, linear within a step.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .friction import Bristles, Stick
from .grid import NEVER, Grid, grid, rows

Array = NDArray[np.float64]

STEP_S = 2e-3
BEYOND_S = 2e-3  # simulated beyond a move's end, where what is known of a sample needs it
TICK_S = 1e-3  # of the controller
EARLY_S = 0.01  # simulated before a move's own zero, for a command that took effect before it
SHARED = ("inertia", "viscous", "coulomb", "stiffness", "preload", "presliding", "bristle", "speed_full", "rise", "gain", "damping", "delay", "lead")
CONTROLLERS = {"profile": (*SHARED, "fall", "lag"), "cascade": (*SHARED, "position_gain", "deadband")}
STRIBECK = ("static_ratio", "stribeck_speed", "stribeck_exponent")


@dataclass(frozen=True)
class Moves:
    """Moves from rest, one per entry (B,): start_s of the command after the move's own zero [s], origin and target [%],
    speed [share of full], limit [raw], position [%] and current hold [raw] at rest, duration_s [s], velocity [%/s] of a drive that
    creeps within its deadband; when it may be simulated in long steps [s]: from when on it cruises, until when, and from when on it rests."""

    start_s: Array
    origin: Array
    target: Array
    speed: Array
    limit: Array
    position: Array
    hold: Array
    duration_s: Array
    velocity: Array | float = 0.0
    cruise_s: Array | float = NEVER
    stop_s: Array | float = NEVER
    rest_s: Array | float = NEVER

    def some(self, columns: NDArray[np.int64]) -> Moves:
        """The moves of these columns."""
        every = (getattr(self, f.name) + np.zeros(len(self.target)) for f in dataclasses.fields(self))
        return Moves(*(x[columns] for x in every))


def profile(time_s: Array, moves: Moves, q: Mapping[str, Array]) -> tuple[Array, Array]:
    """Reference [%] and its velocity [%/s], (n, B), of trapezoidal moves at times (n,) [s]; the velocity `lag` [s] behind."""
    t = time_s[:, None] - moves.start_s
    sign, shape = np.sign(moves.target - moves.origin), _Trapezoid(moves, q)
    return moves.origin + sign * shape.way(t), sign * shape.speed(t - q["lag"])


class _Trapezoid:
    """Way [%] and speed [%/s] of moves over the time since their command."""

    def __init__(self, moves: Moves, q: Mapping[str, Array]) -> None:
        distance = np.abs(moves.target - moves.origin)
        self.up, self.down = q["speed_full"] / np.maximum(q["rise"], 1e-4), q["speed_full"] / np.maximum(q["fall"], 1e-4)
        top = np.minimum(q["speed_full"] * moves.speed, np.sqrt(2 * distance * self.up * self.down / (self.up + self.down)))
        self.top = np.maximum(top, 1e-9)
        self.rise, self.fall = self.top / self.up, self.top / self.down
        self.flat = np.maximum(distance / self.top - 0.5 * (self.rise + self.fall), 0.0)

    def some(self, columns: NDArray[np.int64]) -> _Trapezoid:
        """Those of these columns."""
        found = copy.copy(self)
        for name, x in vars(self).items():
            setattr(found, name, x[columns])
        return found

    def way(self, t: Array) -> Array:
        """Way [%] at times (n, B) [s] after the command."""
        a = _within(t, self.rise)
        b = _within(t - self.rise, self.flat)
        c = _within(t - (self.rise + self.flat), self.fall)
        return 0.5 * self.up * a * a + self.top * b + (self.top - 0.5 * self.down * c) * c

    def speed(self, t: Array) -> Array:
        """Speed [%/s] at times (n, B) [s] after the command."""
        return self.up * _within(t, self.rise) - self.down * _within(t - (self.rise + self.flat), self.fall)


def _within(t: Array, duration: Array) -> Array:
    """Times (n, B) cut to 0..duration (B,)."""
    return np.minimum(np.maximum(t, 0.0), duration)


@dataclass(frozen=True)
class Run:
    """Simulated moves. grid: times of the steps, from EARLY_S before the moves' zero; position (n, B) [%]; feedback (n, B) [raw]: the current without what a reference
    that is known beforehand adds, and unlimited; moves and q (each (B,)), column (B,): where each move stands among these columns. Rows after a move's duration are not filled."""

    grid: Grid
    position: Array
    feedback: Array
    moves: Moves
    q: Mapping[str, Array]
    controller: str
    column: NDArray[np.int64]

    def sample(self, at_s: Sequence[Array], width: int = 1) -> tuple[Array, Array]:
        """Position [%] and, `lead` later, current [raw], (N, width), at times at_s (each (k,)) [s] of every `width` neighbouring moves, one after the other; where the
        reference's speed jumps, the mean over a controller's tick, as nobody knows where in a tick a sample falls."""
        column = np.repeat(self.column.reshape(-1, width), [len(t) for t in at_s], axis=0)
        t = np.concatenate(at_s)[:, None] + EARLY_S
        position = self._interpolated(self.position, t, column)
        t = t + self.q["lead"][column] if "lead" in self.q else t
        current = self._interpolated(self.feedback, t, column)
        moves = self.moves
        if self.controller == "profile":
            t, shape, sign = t - moves.start_s[column], _Trapezoid(moves, self.q).some(column), np.sign(moves.target - moves.origin)[column]
            behind = t - self.q["lag"][column]
            jumped = (shape.way(behind + 0.5 * TICK_S) - shape.way(behind - 0.5 * TICK_S)) / TICK_S
            current += self.q["gain"][column] * (moves.origin[column] + sign * shape.way(t)) + self.q["damping"][column] * sign * jumped
        limit = moves.limit[column]
        return position, np.minimum(np.maximum(current, -limit), limit)

    def _interpolated(self, y: Array, t: Array, column: NDArray[np.int64]) -> Array:
        """y (n, B) at times t (N, width or 1) [s] of columns (N, width), linearly."""
        x = np.minimum(np.maximum(self.grid.index(t, column), 0.0), len(y) - 1.001)
        i = x.astype(int)
        share, flat, below = x - i, i * y.shape[1] + column, y.shape[1]
        y = y.ravel()
        return y[flat] * (1 - share) + y[flat + below] * share


def run(moves: Moves, q: Mapping[str, Array], step_s: float = STEP_S, controller: str = "profile") -> Run:
    """Simulate B moves under B parameter sets (each (B,)).

    Every move starts at rest in balance, so its friction there is what the controller pushes less the spring; where it creeps,
    friction is that of sliding. Friction without presliding in any set sticks hard.
    """
    beyond = BEYOND_S + max(0.0, float(np.max(q.get("lead", 0.0))))
    # an object stops a drive anywhere
    calm = np.full((3, len(moves.target)), NEVER) if "contact_stiffness" in q else np.stack([x + EARLY_S + np.zeros(len(moves.target)) for x in (moves.cruise_s, moves.stop_s, moves.rest_s)])
    ends_s, steps = rows(calm, moves.duration_s + EARLY_S + beyond, step_s)
    order = np.argsort(-steps, kind="stable")
    column = np.empty(len(order), int)
    column[order] = np.arange(len(order))
    moves, q, steps = moves.some(order), {n: x[order] for n, x in q.items()}, steps[order]
    moves = dataclasses.replace(moves, start_s=moves.start_s + EARLY_S, position=moves.position - EARLY_S * moves.velocity)
    times = grid(ends_s[:, order], int(steps[0]) + 1, step_s)
    kind = _Cascade if controller == "cascade" else _Profile
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # values that a search tries may let a drive run away
        steer = kind(moves, q, times)
        position, feedback = _run(moves, q, steer, times, steps, np.inf)
        simulated = np.arange(len(position))[:, None] < steps
        if np.any(np.isfinite(moves.limit)) and np.any(simulated & (np.abs(steer.at + feedback) > moves.limit)):
            steer = kind(moves, q, times)
            position, feedback = _run(moves, q, steer, times, steps, moves.limit)
        return Run(times, position, steer.at + feedback if controller == "cascade" else feedback, moves, q, controller, column)


def simulate(moves: Moves, q: Mapping[str, Array], step_s: float = STEP_S, controller: str = "profile") -> tuple[Array, Array, Array]:
    """Time (n,) [s], position (n, B) [%] and current (n, B) [raw] of `run`, at its short steps."""
    found = run(moves, {**q, "lead": np.zeros(len(moves.target))}, step_s, controller)
    time_s = np.arange(int(np.ceil(np.max(moves.duration_s) / step_s)) + 2) * step_s
    position, current = found.sample([time_s] * len(moves.target))
    return time_s, *(x.reshape(len(moves.target), -1).T for x in (position, current))


def _run(
    moves: Moves, q: Mapping[str, Array], steer: _Profile | _Cascade, times: Grid, rows_of: NDArray[np.int64], limit: Array | float
) -> tuple[Array, Array]:
    """Position [%] and what it adds to the current that is asked for [raw], (n, B), of drives that follow what `steer` says, with no more current than the limit [raw].

    rows_of (B,): the rows that each takes, falling.
    """
    n = len(times.at)
    active = np.searchsorted(-rows_of, -np.arange(n), side="left").tolist()
    steps = times.steps()
    changes = [True, *np.any(steps[1:] != steps[:-1], axis=1).tolist()]
    position, velocity = np.zeros((2, n, len(moves.target)))
    p, v = moves.position.copy(), np.zeros(len(moves.target)) + moves.velocity
    friction = (Stick if not np.any(q["presliding"]) else Bristles)(q)
    friction.begin(np.clip(steer.first(p, v), -limit, limit) - q["stiffness"] * p - q["preload"], v)
    late = np.minimum(q["delay"], 0.8 * q["inertia"] / np.maximum(q["damping"], 1e-9))
    gain, keep, late_push = q["gain"], q["damping"] - q["gain"] * late, q["damping"] * late
    sprung, preload, limit = q["stiffness"] + gain, q["preload"], limit + np.zeros(len(p))
    every = gain, keep, late_push
    contact = _Contact(q) if "contact_stiffness" in q else None
    bounded = bool(np.isfinite(limit).any())
    h = late_move = moving = closed = inner = steps[0]
    for i in range(n):
        k = active[i]
        if k == 0:
            break
        if k < len(p):
            p, v, h, gain, late_move, moving, sprung, preload, limit, closed, inner = (
                x[:k] for x in (p, v, h, gain, late_move, moving, sprung, preload, limit, closed, inner)
            )
            friction.narrow(k)
            steer.narrow(k)
        if changes[i]:
            h = steps[i, :k]
            half = 0.5 * h
            mass, late_move = q["inertia"][:k] / half, late_push[:k] / half
            moving, closed = mass - late_move, gain * (half - late[:k]) + q["damping"][:k] * (1.0 - late[:k] / half)
            inner = mass + q["viscous"][:k] + half * q["stiffness"][:k] + closed
            friction.pace(h)
            steer.pace(h)
            if contact is not None:
                contact.pace(h)
        push = steer.push(i, p, v)
        position[i, :k], velocity[i, :k] = p, v
        total = push - preload + moving * v - sprung * p
        resisting = inner
        if contact is not None:
            pressed, stiffer = contact.load(p)
            total, resisting = total - pressed, inner + stiffer
        middle = friction.velocity(total, resisting, v)
        if bounded:
            own = total - (push - gain * p - late_move * v)  # what is left without the controller
            u_middle = total - own - closed * middle
            over = np.abs(u_middle) > limit
            if over.any():
                middle = np.where(over, friction.velocity(own + np.sign(u_middle) * limit, resisting - closed, v), middle)
        fresh, middle = friction.advance(v, middle)
        steer.advance(middle)
        p = p + h * middle
        v = fresh
    gain, keep, late_push = every
    feedback = -gain * position - keep * velocity
    feedback[1:] += late_push * np.diff(velocity, axis=0) / steps[:-1]
    return position, feedback


class _Profile:
    """What a trapezoidal profile adds to the current: gain r + damping r', the mean over each step (at)."""

    def __init__(self, moves: Moves, q: Mapping[str, Array], times: Grid) -> None:
        t, sign = times.at_s - moves.start_s, np.sign(moves.target - moves.origin)
        shape = _Trapezoid(moves, q)
        r = moves.origin + sign * shape.way(t)
        t -= q["lag"]
        way = shape.way(t)
        # the mean over a step is exact where the velocity jumps within it
        self.at = q["gain"] * r
        self.at[:-1] = 0.5 * (self.at[1:] + self.at[:-1]) + q["damping"] * sign * np.diff(way, axis=0) / times.steps()[:-1]
        self.hold = q["gain"] * r[0], q["gain"]

    def first(self, p: Array, v: Array) -> Array:
        """Current (B,) [raw] before the move, at rest at positions (B,) [%]."""
        return self.hold[0] - self.hold[1] * p

    def narrow(self, k: int) -> None:
        """Nothing: the drives that are left say how many they are."""

    def pace(self, step_s: Array) -> None:
        """Nothing: the reference is known beforehand."""

    def push(self, i: int, p: Array, v: Array) -> Array:
        """Its part of the current (k,) [raw] in the middle of step i."""
        return self.at[i, : len(p)]

    def advance(self, middle: Array) -> None:
        """Nothing: the profile does not see the drive."""


class _Cascade:
    """What a position loop round a speed loop adds to the current, at the steps (at); r goes with the drive within the deadband."""

    def __init__(self, moves: Moves, q: Mapping[str, Array], times: Grid) -> None:
        self.at_s, self.at, self.hold = times.at_s, np.zeros(times.at.shape), moves.hold
        self.starting = (self.at_s.min(axis=1) < moves.start_s.max()).tolist()
        self.gain, self.damping, self.half_gain, self.half_damping = q["gain"], q["damping"], 0.5 * q["gain"], 0.5 * q["damping"]
        self.start_s, self.target, self.origin, self.loop = moves.start_s, moves.target, moves.origin, _Loop(q, moves.speed)

    def first(self, p: Array, v: Array) -> Array:
        """Current (B,) [raw] before the move: what held the drive."""
        self.r, self.w = p + (self.hold + self.damping * v) / self.gain, np.zeros(len(p))
        return self.hold

    def narrow(self, k: int) -> None:
        """Keep the first k drives."""
        for name in ("gain", "damping", "half_gain", "half_damping", "start_s", "target", "origin", "r", "w", "step_s", "half"):
            setattr(self, name, getattr(self, name)[:k])
        self.loop.narrow(k)

    def pace(self, step_s: Array) -> None:
        """The steps (k,) [s] from here on."""
        self.step_s, self.half = step_s, 0.5 * step_s
        self.loop.pace(step_s)

    def push(self, i: int, p: Array, v: Array) -> Array:
        """Its part of the current (k,) [raw] in the middle of step i."""
        r, w = self.r, self.w
        share, change = self.loop.step(self.target - p, v, w)
        if self.starting[i]:
            # the share of this step that lies behind the command, so that its instant counts within a step too
            since = np.minimum(np.maximum((self.at_s[i, : len(p)] + self.step_s - self.start_s) / self.step_s, 0.0), 1.0)
            old_share, old_change = self.loop.step(self.origin - p, v, w)
            share, change = since * share + (1 - since) * old_share, since * change + (1 - since) * old_change
        self.w = w + change
        both = w + self.w
        self.share, self.r_next = share, r + self.half * both
        self.at[i, : len(p)] = self.gain * r + self.damping * w
        return self.half_gain * (r + self.r_next) + self.half_damping * both

    def advance(self, middle: Array) -> None:
        """One step with the drive at velocity `middle` (k,) [%/s]: within the deadband the integral holds."""
        held = self.r + self.step_s * middle
        self.r = held + self.share * (self.r_next - held)


class _Loop:
    """The position loop of cascades: the wanted speed, within a slew rate, of a position error."""

    def __init__(self, q: Mapping[str, Array], speed: Array) -> None:
        self.slope, self.top, self.delay = q["speed_full"] / np.maximum(q["rise"], 1e-4), q["speed_full"] * speed, q["delay"]
        self.deadband, self.edge, self.gain, self.bottom = q["deadband"], q["edge"], q["position_gain"], -self.top

    def pace(self, step_s: Array) -> None:
        """The steps (k,) [s] from here on."""
        k = len(step_s)
        self.step_s, self.slew = step_s, step_s * self.slope[:k]
        # where the drive will be seen at the middle and at the end of the step
        self.middle, self.end, self.down = 0.5 * step_s - self.delay[:k], step_s - self.delay[:k], -self.slew

    def narrow(self, k: int) -> None:
        """Keep the first k drives."""
        for name in ("step_s", "slew", "top", "down", "bottom", "middle", "end", "deadband", "edge", "gain"):
            setattr(self, name, getattr(self, name)[:k])

    def step(self, error: Array, v: Array, wanted: Array) -> tuple[Array, Array]:
        """Share (k,) (0..1) in which position errors (k,) [%] at velocities v (k,) [%/s] are outside the deadband, and the change of the wanted speed [%/s], in one step."""
        # a deadband narrower than the step's travel sets in within the step
        width = np.maximum(np.abs(self.step_s * v), self.edge)
        share = np.minimum(np.maximum((np.abs(error - self.middle * v) - self.deadband) / width + 0.5, 0.0), 1.0)
        outside = np.minimum(np.maximum(self.gain * (error - self.end * v), self.bottom), self.top) - wanted
        outside = np.minimum(np.maximum(outside, self.down), self.slew)
        inside = np.minimum(np.maximum(-wanted, self.down), self.slew)
        return share, inside + share * (outside - inside)


class _Contact:
    """An object: a one-sided spring with damping."""

    def __init__(self, q: Mapping[str, Array]) -> None:
        self.stiffness, self.at, self.damping = q["contact_stiffness"], q["contact_at"], q["contact_damping"]

    def pace(self, step_s: Array) -> None:
        """The steps (k,) [s] from here on."""
        self.reach = 0.5 * step_s + self.damping[: len(step_s)]

    def load(self, p: Array) -> tuple[Array, Array]:
        """Load (k,) [raw] at positions (k,) [%], and what it resists velocity with [raw s/%]."""
        k = len(p)
        pressed = np.where(p > self.at[:k], self.stiffness[:k], 0.0)
        return pressed * (p - self.at[:k]), pressed * self.reach[:k]


def cascade_step(
    q: Mapping[str, float], error: float, speed: float, reference: float, wanted: float, velocity: float, step_s: float
) -> tuple[float, float]:
    """Reference [%] and wanted speed [%/s] of the cascade after one step of step_s [s], for a controller in another simulator's loop.

    error [%]: setpoint less position; speed: share of full; velocity [%/s] of the drive.
    """
    one = {k: np.atleast_1d(np.asarray(q[k], float)) for k in ("deadband", "edge", "position_gain", "speed_full", "rise", "delay")}
    loop = _Loop(one, np.atleast_1d(speed))
    loop.pace(np.atleast_1d(step_s))
    share, change = (float(x[0]) for x in loop.step(*map(np.atleast_1d, (error, velocity, wanted))))
    w = wanted + change
    # within the deadband the integral holds: the reference goes with the drive
    return share * (reference + 0.5 * step_s * (wanted + w)) + (1 - share) * (reference + step_s * velocity), w
