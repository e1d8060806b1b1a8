"""The drive simulated in raw units: profile generator, controller, mass, spring and friction; many moves at once.

Plant: inertia a = u - viscous v - F - stiffness p - preload, with the friction of LuGre (Canudas de Wit et al. 1995),
    F = f + bristle f',  f' = coulomb / distance (1 - f sign(v) / level(v)) v,  level(v) = coulomb (1 + (ratio - 1)
    exp(-|v / stribeck|^exponent)),
which sticks (any f within its bounds at v = 0). Without a presliding distance friction is Coulomb's, set-valued at
rest: bristles however stiff let a drive off before they hold it, for a time that falls with the square root of their
distance only.
Controller: u = gain (r - p) + damping (r' - v), within the current limit. Two kinds make the reference r:
    "profile": a trapezoidal velocity profile from the old to the new setpoint (a ramp where rise and fall take no
    time);
    "cascade": r' follows position_gain (setpoint - p) within the speed limit and a slew rate, and holds within a
    deadband, which sets in over a width `edge`; as r is the integral of the wanted speed, this is a position loop round
    a speed loop with proportional and integral action.
The recorded current acts `lead` seconds later: a loop that samples holds its value until the next step.
A loop that samples acts late: p and v reach the controller `delay` seconds old, to first order (p - delay v, v - delay
a).
A generator that sums up its reference step by step has the velocity r' `lag` seconds behind r.
Integrated by the implicit midpoint rule, linear within a step.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .batch import Moves
from .cascade import Cascade
from .contact import Contact
from .current_limit import Ceiling
from .friction import Bristles, Stick
from .grid import NEVER, Grid, grid, rows
from .profile import Profile, Trapezoid

Array = NDArray[np.float64]

STEP_S = 2e-3
BEYOND_S = 2e-3  # simulated beyond a move's end, where what is known of a sample needs it
TICK_S = 1e-3  # of the controller
EARLY_S = 0.01  # simulated before a move's own zero, for a command that took effect before it
SHARED = (
    "inertia",
    "viscous",
    "coulomb",
    "stiffness",
    "preload",
    "presliding",
    "bristle",
    "speed_full",
    "rise",
    "gain",
    "damping",
    "delay",
    "lead",
)
CONTROLLERS = {"profile": (*SHARED, "fall", "lag"), "cascade": (*SHARED, "position_gain", "deadband")}
STRIBECK = ("static_ratio", "stribeck_speed", "stribeck_exponent")


@dataclass(frozen=True)
class Run:
    """Simulated moves. grid: times of the steps, from EARLY_S before the moves' zero; position (n, B) [%]; feedback (n,
    B) [raw]: the current without what a reference that is known beforehand adds, and unlimited; moves and q (each
    (B,)), column (B,): where each move stands among these columns. Rows after a move's duration are not filled."""

    grid: Grid
    position: Array
    feedback: Array
    moves: Moves
    q: Mapping[str, Array]
    controller: str
    column: NDArray[np.int64]

    def sample(self, at_s: Sequence[Array], width: int = 1) -> tuple[Array, Array]:
        """Position [%] and, `lead` later, current [raw], (N, width), at times at_s (each (k,)) [s] of every `width`
        neighbouring moves, one after the other; where the reference's speed jumps, the mean over a controller's tick,
        as nobody knows where in a tick a sample falls."""
        column = np.repeat(self.column.reshape(-1, width), [len(t) for t in at_s], axis=0)
        t = np.concatenate(at_s)[:, None] + EARLY_S
        position = self._interpolated(self.position, t, column)
        t = t + self.q["lead"][column] if "lead" in self.q else t
        current = self._interpolated(self.feedback, t, column)
        moves = self.moves
        if self.controller == "profile":
            t, shape, sign = (
                t - moves.start_s[column],
                Trapezoid(moves, self.q).some(column),
                np.sign(moves.target - moves.origin)[column],
            )
            behind = t - self.q["lag"][column]
            jumped = (shape.way(behind + 0.5 * TICK_S) - shape.way(behind - 0.5 * TICK_S)) / TICK_S
            current += (
                self.q["gain"][column] * (moves.origin[column] + sign * shape.way(t))
                + self.q["damping"][column] * sign * jumped
            )
        limit = moves.limit[column]
        return position, np.minimum(np.maximum(current, -limit), limit)

    def _interpolated(self, y: Array, t: Array, column: NDArray[np.int64]) -> Array:
        """y (n, B) at times t (N, width or 1) [s] of columns (N, width), linearly."""
        x = np.minimum(np.maximum(self.grid.index(t, column[:, :1]), 0.0), len(y) - 1.001)
        i = x.astype(int)
        share, flat, below = x - i, i * y.shape[1] + column, y.shape[1]
        y = y.ravel()
        return y[flat] * (1 - share) + y[flat + below] * share


def run(
    moves: Moves, q: Mapping[str, Array], step_s: float = STEP_S, controller: str = "profile", width: int = 1
) -> Run:
    """Simulate B moves under B parameter sets (each (B,)); every `width` neighbours are one move, in the same steps.

    Every move starts at rest in balance, so its friction there is what the controller pushes less the spring; where it
    creeps, friction is that of sliding. Friction without presliding in any set sticks hard.
    """
    beyond = BEYOND_S + max(0.0, float(np.max(q.get("lead", 0.0))))
    # an object stops a drive anywhere
    calm = (
        np.full((3, len(moves.target)), NEVER)
        if "contact_stiffness" in q
        else np.stack([x + EARLY_S + np.zeros(len(moves.target)) for x in (moves.cruise_s, moves.stop_s, moves.rest_s)])
    )
    ends_s, steps = rows(calm, moves.duration_s + EARLY_S + beyond, step_s)
    order = np.argsort(-steps, kind="stable")
    column = np.empty(len(order), int)
    column[order] = np.arange(len(order))
    moves, q, steps = moves.some(order), {n: x[order] for n, x in q.items()}, steps[order]
    moves = dataclasses.replace(
        moves, start_s=moves.start_s + EARLY_S, position=moves.position - EARLY_S * moves.velocity
    )
    times = grid(ends_s[:, order], int(steps[0]) + 1, step_s, width)
    kind = Cascade if controller == "cascade" else Profile
    # values that a search tries may let a drive run away
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        steer = kind(moves, q, times)
        position, feedback = _run(moves, q, steer, times, steps, np.inf)
        simulated = np.arange(len(position))[:, None] < steps
        if np.any(np.isfinite(moves.limit)) and np.any(
            simulated & (np.abs(steer.asked(position) + feedback) > moves.limit)
        ):
            steer = kind(moves, q, times)
            position, feedback = _run(moves, q, steer, times, steps, moves.limit)
        return Run(
            times,
            position,
            steer.asked(position) + feedback if controller == "cascade" else feedback,
            moves,
            q,
            controller,
            column,
        )


def simulate(
    moves: Moves, q: Mapping[str, Array], step_s: float = STEP_S, controller: str = "profile"
) -> tuple[Array, Array, Array]:
    """Time (n,) [s], position (n, B) [%] and current (n, B) [raw] of `run`, at its short steps."""
    found = run(moves, {**q, "lead": np.zeros(len(moves.target))}, step_s, controller)
    time_s = np.arange(int(np.ceil(np.max(moves.duration_s) / step_s)) + 2) * step_s
    position, current = found.sample([time_s] * len(moves.target))
    return time_s, *(x.reshape(len(moves.target), -1).T for x in (position, current))


def _run(
    moves: Moves,
    q: Mapping[str, Array],
    steer: Profile | Cascade,
    times: Grid,
    rows_of: NDArray[np.int64],
    limit: Array | float,
) -> tuple[Array, Array]:
    """Position [%] and what it adds to the current that is asked for [raw], (n, B), of drives that follow what `steer`
    says, with no more current than the limit [raw].

    rows_of (B,): the rows that each takes, falling.
    """
    width, steps = len(moves.target), times.steps()
    position, velocity = np.zeros((2, len(times.at) + 1, width))
    position[0], velocity[0] = moves.position, moves.velocity
    friction = (Stick if not np.any(q["presliding"]) else Bristles)(q)
    friction.begin(
        np.clip(steer.begin(position[0], velocity[0]), -limit, limit) - q["stiffness"] * position[0] - q["preload"],
        velocity[0],
    )
    late = np.minimum(q["delay"], 0.8 * q["inertia"] / np.maximum(q["damping"], 1e-9))
    late_push, sprung = q["damping"] * late, q["stiffness"] + steer.stiffness
    contact = Contact(q) if "contact_stiffness" in q else None
    ceiling = Ceiling(q, late, limit) if np.isfinite(limit).any() else None
    for first, last, k in _stretches(steps, rows_of):
        h, own_sprung = times.each(steps[first])[:k], sprung[:k]
        half = 0.5 * h
        mass = q["inertia"][:k] / half
        closed = q["gain"][:k] * (half - late[:k]) + q["damping"][:k] * (1.0 - late[:k] / half)
        moving = mass - late_push[:k] / half
        inner = 0.5 * (mass + q["viscous"][:k] + half * q["stiffness"][:k] + closed)
        total, work = np.empty((2, k))
        for part in (friction, steer, *(x for x in (contact, ceiling) if x is not None)):
            part.pace(first, last, h)
        p, v = position[first, :k], velocity[first, :k]
        for i, to, fresh in zip(
            range(first, last), position[first + 1 : last + 1, :k], velocity[first + 1 : last + 1, :k], strict=True
        ):
            np.multiply(moving, v, out=total)
            np.multiply(own_sprung, p, out=work)
            np.subtract(total, work, out=total)
            np.add(total, steer.push(i, p, v), out=total)
            resisting = inner
            if contact is not None:
                pressed, stiffer = contact.load(p)
                total, resisting = total - pressed, inner + 0.5 * stiffer
            both = friction.velocities(total, resisting, v)
            if ceiling is not None:
                both = ceiling.kept(both, total, resisting, p, v, 0.0 if contact is None else pressed, friction)
            friction.advance(v, both, fresh)
            np.multiply(half, both, out=work)
            steer.advance(work)
            np.add(p, work, out=to)
            p, v = to, fresh
    position, velocity = position[:-1], velocity[:-1]
    feedback, rate = -q["gain"] * position, np.diff(velocity, axis=0)
    np.divide(rate.reshape(*steps[1:].shape, -1), steps[:-1, :, None], out=rate.reshape(*steps[1:].shape, -1))
    rate *= late_push
    feedback[1:] += rate
    velocity *= q["damping"] - q["gain"] * late
    feedback -= velocity
    return position, feedback


def _stretches(steps: Array, rows_of: NDArray[np.int64]) -> Iterator[tuple[int, int, int]]:
    """First row, the row after the last, and how many drives are simulated, of stretches in which no drive changes its
    step or ends.

    steps (n, ...) [s] that begin in each row; rows_of (B,): the rows that each takes, falling.
    """
    ends = np.minimum(rows_of, len(steps))
    change = np.flatnonzero(np.any(steps[1:] != steps[:-1], axis=1)) + 1
    cuts = np.unique(np.concatenate([[0], change, ends]))
    for first, last in itertools.pairwise(cuts[cuts <= ends[0]].tolist()):
        yield first, last, int(np.count_nonzero(ends > first))
