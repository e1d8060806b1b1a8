"""One joint simulated many times at once: trials x parameter sets in the lanes of one vector.

Semi-implicit Euler with implicit damping and the friction impulse clipped to what stops the joint within a step
(as in MuJoCo's and BAM's discrete dry friction).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..bristles import SHORTEST, begun, bent, slowed
from ..carried import followed
from .friction import dry_friction, wet_friction

Array = NDArray[np.float64]
STEP_S = 2e-3

# All physics the simulator knows. Declared first; the rest is zero (or neutral) unless an effect is being tried.
PARAMETERS = (
    "inertia", "gain", "back_emf", "damping", "coulomb",  # declared
    "static_excess", "stribeck_speed", "stribeck_exponent",  # + static_excess exp(-|v / vs|^a)
    "load_gear", "load_motor", "load_external",  # + k |tau_external - tau_motor|, |k_e tau_external - k_m tau_motor|
    "load_gear_low", "load_motor_low", "load_external_low",  # the same, times exp(-|v / vs|^a)
    "motor_squared", "external_squared",  # + k tau^2 of the larger of opposed efforts, times exp(-|v / vs|^a)
    "load_carried", "load_carried_low",  # + k |tau_external - inertia acceleration|, the same times exp(-|v / vs|^a)
    "load_speed",  # damping that grows with |tau_external|
    "reach",  # over which dry friction turns round after a reversal
    "ripple_sine", "ripple_cosine", "ripple_period",  # + s sin(2 pi q / period) + c cos(2 pi q / period)
    "asymmetry", "damping_asymmetry", "drag", "offset", "lateral", "stiffness",
    "sag", "supply", "delay",
)  # fmt: skip
INDEX = {name: i for i, name in enumerate(PARAMETERS)}
DECLARED = PARAMETERS[:5]
NEUTRAL = {
    "stribeck_speed": 1.0,
    "stribeck_exponent": 2.0,
    "ripple_period": 1.0,
}  # what is not zero where an effect is absent
BY_LOAD = ("load_gear", "load_motor", "load_external", "load_carried")
CARRIED = ("load_carried", "load_carried_low")
RIPPLE = ("ripple_sine", "ripple_cosine")
LOW_SPEED = (
    "static_excess",
    "load_gear_low",
    "load_motor_low",
    "load_external_low",
    "motor_squared",
    "external_squared",
    "load_carried_low",
)


def parameter_units(angle: str, effort: str) -> dict[str, str]:
    """Unit of every parameter that is no pure number; angle: "rad" or "m", effort: "N m" or "N"."""
    wet = f"{effort} s/{angle}"
    units = dict.fromkeys(
        ("coulomb", "static_excess", "asymmetry", "offset", "lateral", "ripple_sine", "ripple_cosine"), effort
    )
    units |= dict.fromkeys(("damping", "back_emf", "damping_asymmetry"), wet) | dict.fromkeys(
        ("sag", "motor_squared", "external_squared"), f"1/({effort})"
    )
    return units | {"stribeck_speed": f"{angle}/s", "reach": angle, "ripple_period": angle, "stiffness": f"{effort}/{angle}", "load_speed": f"s/{angle}",
                    "drag": f"{effort} s^2/{angle}^2", "delay": "s"}  # fmt: skip


@dataclass(frozen=True)
class Lane:
    """One stretch of one trial to be simulated: drive and measured position on an even grid of the swing's step_s, or at
    the instants time_s (n,) [s] from its start (of a joint that nothing drives).

    drive (n,): recorded voltage, or effort, or zeros; live: the trial's gear over the declared one (zero:
    disconnected);
    position (n,) [rad or m]; start: (q, v); supply (n,): relative deviation of the supply from its mean; used (n,):
    weights 0 or 1 (recorded, not padded). Of the trial's own bodies: more_inertia [kg m2 or kg] than declared, sine and
    cosine of its weight (None: the swing's); coulomb_scale: its own Coulomb level over the declared one. give (n, 2):
    what a small change of the start does, orthonormal; residuals are what is left beyond it (None: the start is known).
    """

    trial: str
    validate: bool
    drive: Array
    live: float
    position: Array
    start: tuple[float, float]
    supply: Array
    used: Array
    coulomb_scale: float = 1.0
    more_inertia: float = 0.0
    weight: tuple[float, float] | None = None
    give: Array | None = None
    time_s: Array | None = None


@dataclass(frozen=True, eq=False)
class Swing:
    """All stretches of a session, the joint's weight: gravity effort = sine sin q + cosine cos q (what holds it), and
    the period period_s [s] of its small swings; bodies: inertia [kg m2 or kg] of what the joint carries; resolution
    [rad or m]: noise of its encoder; periods [rad or m]: of ripples that its drive may have. leapfrog_s: step [s] of the leapfrog that has to move as recorded (of a free swing
    under its weight; zero: the law itself has to)."""

    lanes: tuple[Lane, ...]
    sine: float
    cosine: float
    initial: Mapping[str, float]
    driven: bool
    step_s: float = STEP_S
    period_s: float = 1.0
    leapfrog_s: float = 0.0
    bodies: float = 0.0
    resolution: float = 0.0
    periods: tuple[float, ...] = ()

    def train(self) -> Array:
        """Indices of stretches that may be fitted."""
        return np.array([i for i, lane in enumerate(self.lanes) if not lane.validate])


def instants(swing: Swing, lane: Lane) -> Array:
    """Times (n,) [s] of a stretch's samples from its start."""
    return swing.step_s * np.arange(len(lane.position)) if lane.time_s is None else lane.time_s


def usual_speed(swing: Swing) -> float:
    """Speed [rad/s or m/s] that is hardly ever exceeded."""
    speeds = [np.abs(np.diff(lane.position)) / np.diff(instants(swing, lane)) for lane in swing.lanes]
    return float(np.percentile(np.concatenate(speeds), 97))


def usual_range(swing: Swing) -> float:
    """How far [rad or m] the recordings go from end to end, the widest of them."""
    return max(float(np.ptp(lane.position)) for lane in swing.lanes)


def vector(values: Mapping[str, float]) -> Array:
    """Parameter vector from names; what is not named is neutral."""
    out = np.zeros(len(PARAMETERS))
    for name, value in {**NEUTRAL, **values}.items():
        out[INDEX[name]] = value
    return out


def simulate(swing: Swing, theta: Array, lanes: Array) -> Array:
    """Positions (steps, L) of L runs: run l simulates stretch lanes[l] with parameters theta[l]; (L,
    len(PARAMETERS))."""
    return _chunks(swing, theta, lanes, False)


def errors(swing: Swing, theta: Array, lanes: Array) -> Array:
    """Position residuals (steps, L), zero where nothing was recorded, without what a start that is free takes up
    (variable projection, Golub & Pereyra 1973)."""
    out = np.clip(np.nan_to_num(_chunks(swing, theta, lanes, True), nan=1e1, posinf=1e1, neginf=-1e1), -10.0, 10.0)
    for i in np.unique(lanes):
        if (give := swing.lanes[i].give) is not None:
            mine, n = np.flatnonzero(lanes == i), min(len(give), len(out))
            out[:n, mine] -= give[:n] @ (give[:n].T @ out[:n, mine])
    return out


LANES_AT_ONCE = 3000  # so many runs' state fits a core's own cache


@lru_cache(maxsize=16)
def _stacked(swing: Swing) -> tuple[Array, ...]:
    """The recordings side by side, (steps, stretches) each: drive, relative supply, position, used; lengths
    (stretches,)."""
    length = np.array([len(lane.position) for lane in swing.lanes])
    out = np.zeros((4, length.max(), len(length)))
    for i, lane in enumerate(swing.lanes):
        for k, values in enumerate((lane.drive * lane.live, lane.supply, lane.position, lane.used)):
            out[k, : length[i], i] = values
    return *out, length


def _chunks(swing: Swing, theta: Array, lanes: Array, residual: bool) -> Array:
    """Runs of like length together, so that few steps are spent on padding and the state stays in the cache."""
    lanes = np.asarray(lanes)
    length = _stacked(swing)[4][lanes]
    out = np.zeros((length.max(), len(lanes)))
    order = np.argsort(length, kind="stable")
    edges = [0]
    for k in range(1, len(order)):
        if k - edges[-1] >= LANES_AT_ONCE or (length[order[k]] > 2 * length[order[edges[-1]]] and k - edges[-1] >= 200):
            edges.append(k)
    for a, b in zip(edges, [*edges[1:], len(order)], strict=True):
        mine = order[a:b]
        steps = int(length[mine].max())
        out[:steps, mine] = _run(swing, theta[mine], lanes[mine], steps, residual)
    return out


def _run(swing: Swing, theta: Array, lanes: Array, steps: int, residual: bool) -> Array:
    """Positions, or residuals, (steps, L); an effect that no run has costs nothing."""
    p, has = constants(swing, theta, lanes)
    q, v = np.array([swing.lanes[i].start for i in lanes]).T.copy()
    h = swing.step_s
    p["acceleration"] = np.zeros(len(lanes))
    drive = _drive(swing, theta, lanes, has, steps) if swing.driven else None
    if has["reach"]:
        acts = p["weight"] * np.sin(q + p["phase"]) + (0.0 if drive is None else drive[0])
        p["bristle"] = begun(v, acts, p["coulomb"], h / p["hi"], p["reach"])
    # Semi-implicit Euler is leapfrog when the velocity starts half a step early: second order instead of first.
    if not swing.driven:
        v = v - 0.5 * p["hi"] * (p["weight"] * np.sin(q + p["phase"]) - p["stiffness"] * q)
    out = np.empty((steps, len(lanes)))
    with np.errstate(all="ignore"):
        for k in range(steps):
            out[k] = q
            external = p["weight"] * np.sin(q + p["phase"] if has["phase"] else q)
            if has["stiffness"]:
                external -= p["stiffness"] * q
            if has["ripple"]:
                turn = p["waves"] * q
                external -= p["ripple_sine"] * np.sin(turn) + p["ripple_cosine"] * np.cos(turn)
            before, v = v, _next_speed(p, has, v, external, None if drive is None else drive[k])
            if has["reach"]:
                p["bristle"] = bent(p["bristle"], h * v, p["reach"])
            if has["carried"]:
                p["acceleration"] = followed(p["acceleration"], v - before, h)
            q = q + h * v
        if residual:
            position, used = _stacked(swing)[2:4]
            out -= position[:steps, lanes]
            out *= used[:steps, lanes]
    return out


def constants(swing: Swing, theta: Array, lanes: Array) -> tuple[dict[str, Array], dict[str, bool]]:
    """Parameters of every run (L,) with what follows from them and from its stretch, and which effects any run has.

    hi: step over inertia; weight, phase: gravity's effort weight sin(q + phase); wet, share: damping with the motor's
    own and what is left of a free speed after one step of it; shove: hi share; stop: speed that dry friction takes in a
    step.
    """
    p = {name: np.ascontiguousarray(theta[:, i]) for name, i in INDEX.items()}
    has = {name: bool(np.any(values)) for name, values in p.items()}
    has["low"] = any(has[k] for k in LOW_SPEED)
    has["carried"] = any(has[k] for k in CARRIED)
    has["exponent"] = bool(np.any(p["stribeck_exponent"] != NEUTRAL["stribeck_exponent"]))
    has["dry"] = has["low"] or any(has[k] for k in (*BY_LOAD, "asymmetry"))
    has["ripple"] = has["ripple_sine"] or has["ripple_cosine"]
    has["wet"] = any(has[k] for k in ("load_speed", "drag", "damping_asymmetry"))
    chosen = [swing.lanes[i] for i in lanes]
    live = np.array([c.live for c in chosen])
    sine, cosine = np.array([c.weight or (swing.sine, swing.cosine) for c in chosen]).T
    cosine = cosine + p["lateral"]
    p["weight"], p["phase"] = -np.hypot(sine, cosine), np.arctan2(cosine, sine)
    has["phase"] = bool(np.any(p["phase"]))
    more = np.array([c.more_inertia for c in chosen])
    p["hi"] = swing.step_s / (p["inertia"] + more)
    p["bodies"] = np.minimum(swing.bodies, p["inertia"]) + more
    p["coulomb"] = p["coulomb"] * np.array([c.coulomb_scale for c in chosen])
    p["emf"] = p["back_emf"] * live**2
    p["inverse"], p["waves"] = 1.0 / p["stribeck_speed"], 2.0 * np.pi / p["ripple_period"]
    p["wet"] = p["damping"] + p["emf"] if swing.driven else p["damping"]
    p["share"] = 1.0 / (1.0 + p["hi"] * p["wet"])
    p["shove"] = p["hi"] * p["share"]
    p["stop"] = p["shove"] * p["coulomb"]
    p["give"] = swing.step_s / np.maximum(p["reach"], SHORTEST)
    return p, has


def _next_speed(
    p: Mapping[str, Array], has: Mapping[str, bool], v: Array, external: Array, motor: Array | None
) -> Array:
    """Velocity (L,) after one step under external effort and the motor's: implicit damping, clipped dry friction."""
    share, shove, stop, effort = p["share"], p["shove"], p["stop"], external
    if motor is not None:
        effort = effort + motor
    if has["offset"]:
        effort = effort + p["offset"]
    if has["wet"]:
        share = 1.0 / (1.0 + p["hi"] * wet_friction(p, has, v, external))
        shove = p["hi"] * share
    if has["dry"]:
        stop = shove * dry_friction(p, has, v, external, motor)
    elif has["wet"]:
        stop = shove * p["coulomb"]
    free = v * share + shove * effort
    if has["reach"]:
        return slowed(free, stop, p["bristle"], p["give"])
    return free - np.minimum(np.maximum(free, -stop), stop)


def _drive(swing: Swing, theta: Array, lanes: Array, has: Mapping[str, bool], steps: int) -> Array:
    """Drive effort (steps, L): gain x recorded drive, late by the delay, less by sag, scaled by the supply."""
    recorded, supply = (values[:steps] for values in _stacked(swing)[:2])
    gain, sag, share = (theta[:, INDEX[n]] for n in ("gain", "sag", "supply"))
    if has["delay"]:
        late = theta[:, INDEX["delay"]] / swing.step_s
        whole = np.ceil(late).astype(int)
        k, part = np.arange(steps)[:, None] - whole, whole - late
        u = recorded[np.maximum(k, 0), lanes] * (1 - part) + recorded[np.clip(k + 1, 0, steps - 1), lanes] * part
    else:
        u = recorded[:, lanes]
    if has["supply"]:
        u = u * (1.0 + share * supply[:, lanes])
    u = u * gain
    return u * (1.0 - sag * np.abs(u)) if has["sag"] else u
