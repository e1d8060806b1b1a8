"""Steady strokes of a drive: what its speed loses under load, and where a limit of its current cuts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ...effects.base import DriveState
from ..findings import weighed
from ..name.naming import EXPLAINED_LEAST

Array = NDArray[np.float64]

STROKES = "strokes"  # what proves a loss of speed, or a limit of the drive, where no engine does
RUN_IN_S, RUN_OUT_S = 0.3, 0.25  # a stroke's part at steady speed begins and ends this far from rest
PIECE_S = 0.15  # of strokes, that are compared
LEAST_LATER = 5  # rows of half of a stroke: fewer, and it tells no speed
RUNNING = 0.7  # of its median speed: slower at either end, a stroke still starts or stops
LEAST_LOSS = 0.035  # of the speed: less is within what controllers do (the most of 560 healthy drives 0.029)
NEARLY_MOST = 0.9  # quantile of the speed that is lost beyond a limit
NEAR = 0.95  # of a limit: a reading there may be cut
FULL_SPEED = 0.9  # of the way, in which strokes of one commanded speed are no faster than at full speed
AT_SPEED = 0.9  # of that, from which a drive does what it is told
# of the current beyond its limit that a drive takes from its speed: one, but for noise in the limit
CEILING_SHARE = 0.6
CEILING_LEFT, CEILING_T = 0.1, 6.0
# of the fastest strokes, at most, that are beyond a limit; limits tried, and by how much two readings of one may differ
# (standard errors, and of its size)
MOSTLY, LIMITS, SURE, SAME_LIMIT = 0.95, 200, 3.0, 0.03
# of the current beyond a limit over what is needed, from which it is none: a drive that slows down needs less
FLAT, SLOPES_T = 0.3, 3.0
BEYOND_T = 2.0  # standard deviations of the current, of what is beyond a limit
RISES_OF_LOAD = 2  # columns: over the places of a stroke, and from its begin to its end
TAKEN = 1e-12  # of log speed per raw/%: less, and a drive is slowed by no rise
ROUNDS = 3  # of telling where a limit is and what is beyond


@dataclass(frozen=True)
class Stroke:
    """A stroke at one commanded speed, away from its start and stop. way: 1 flexing, -1 extending. time_s (since it
    began), position [%], velocity [%/s], current [raw]: (n,). trial: name of its recording; kept_out: whether that is
    for validation."""

    way: float
    commanded: float
    time_s: Array
    position: Array
    velocity: Array
    current: Array
    trial: str = ""
    kept_out: bool = False


@dataclass(frozen=True)
class Loss:
    """Loss of log speed per load, `sag` [1/raw], its standard error [1/raw] and the range of loads [raw]; nan where
    strokes do not tell."""

    sag: float = float("nan")
    sag_se: float = float("nan")
    load_range: float = float("nan")

    @property
    def share(self) -> float:
        """Share of its speed that the drive loses over the recorded loads."""
        return self.sag * self.load_range

    @property
    def share_se(self) -> float:
        """Its standard error."""
        return self.sag_se * self.load_range


def strokes_of(states: tuple[DriveState, ...], currents: tuple[Array, ...]) -> list[Stroke]:
    """Strokes of one drive that are long enough to tell; none where it is not recorded what speed was asked for.
    currents: raw current (n,) of each state."""
    out = []
    for state, current in zip(states, currents, strict=True):
        if "speed" not in state.extra:
            return []
        way = np.where(np.isfinite(state.effort), np.sign(state.velocity), 0)
        edges = np.r_[0, np.flatnonzero(np.diff(way)) + 1, len(way)]
        for a, b in pairwise(edges.tolist()):
            t = state.time_s[a:b]
            keep = np.arange(a, b)[(t > t[0] + RUN_IN_S) & (t < t[-1] - RUN_OUT_S)]
            fast = np.flatnonzero(np.abs(state.velocity[keep]) > RUNNING * np.median(np.abs(state.velocity[a:b])))
            keep = keep[fast[0] : fast[-1] + 1] if len(fast) else keep[:0]
            speeds = state.extra["speed"][keep]
            if way[a] and len(keep) >= 10 and np.ptp(speeds) == 0 and speeds[0] > 0:
                out.append(
                    Stroke(
                        float(way[a]),
                        float(speeds[0]),
                        state.time_s[keep] - t[0],
                        state.position[keep],
                        state.velocity[keep],
                        current[keep],
                        state.trial,
                        state.validate,
                    )
                )
    return out


def beneath(strokes: Sequence[Stroke], limit: float) -> list[Stroke]:
    """Those whose current hardly ever comes near a limit [raw]."""
    return [s for s in strokes if np.quantile(np.abs(s.current), NEARLY_MOST) < NEAR * limit]


def load_rise(strokes: Sequence[Stroke]) -> dict[float, np.poly1d]:
    """Rise of the load over position [raw/%] flexing and extending, as polynomials of position: current = cubic in
    position + viscous velocity, each of its own for the two ways."""
    scale = 100.0 ** -np.arange(4)
    out = {}
    for way in (1.0, -1.0):
        mine = [s for s in strokes if s.way == way]
        beta = np.linalg.lstsq(_load_design(mine), _joined(mine, "current"), rcond=None)[0]
        out[way] = np.poly1d((beta[:4] * scale)[::-1]).deriv()
    return out


def sag(strokes: Sequence[Stroke]) -> Loss:
    """Loss of speed under load. Strokes of one commanded speed are compared. A reference that a proportional controller
    follows is ahead by what the motor's voltage asks for, a sum of load and speed; what it loses while the load rises, and
    what either way it does while the speed changes, is no sag."""
    if len(strokes) < 12 or {s.way for s in strokes} != {1.0, -1.0}:
        return Loss()
    commanded, y = sorted({s.commanded for s in strokes}), log_speeds(strokes)
    design = speed_design(strokes, load_rise(strokes), commanded)
    beta = speed_coefficients(design, y, len(commanded))
    spread = np.median(np.abs(y - design @ beta)) / 0.6745
    at, load = len(commanded) + np.arange(RISES_OF_LOAD), design[:, -1]
    design = np.delete(design, at[beta[at] > -TAKEN], axis=1)
    covariance = np.linalg.pinv(design.T @ design) * spread**2
    return Loss(-float(beta[-1]), float(np.sqrt(covariance[-1, -1])), float(np.ptp(load)))


def log_speeds(strokes: Sequence[Stroke]) -> Array:
    """Logarithms (s,) of the strokes' mean speeds [%/s]."""
    return np.log([max(s.way * float(np.mean(s.velocity)), 1e-9) for s in strokes])


def speed_design(strokes: Sequence[Stroke], rise: Mapping[float, np.poly1d], commanded: Sequence[float]) -> Array:
    """Columns (s, k) of log speed: one of each commanded speed, what the load's and the speed's rises take, and the load
    [raw]. rise: of the load over position (`load_rise`)."""
    levels = np.array([[float(s.commanded == level) for level in commanded] for s in strokes])
    rises = np.array([[float(np.mean(rise[s.way](s.position))), *_changes(s)] for s in strokes])
    load = np.array([s.way * float(np.mean(s.current)) for s in strokes])
    return np.concatenate([levels, rises, load[:, None]], axis=1)


def speed_coefficients(design: Array, y: Array, commanded: int) -> Array:
    """Coefficients of log speed (s,) on such columns, the first `commanded` of which are levels; a rise of the load only
    slows."""
    most = np.full(design.shape[1], np.inf)
    most[commanded + np.arange(RISES_OF_LOAD)] = 0.0
    return lsq_linear(design, y, (-np.inf, most), method="bvls").x


def _changes(stroke: Stroke) -> tuple[float, float]:
    """By how much load [raw/%] and speed [1/s] have risen at the end of a stroke, for its way."""
    first, last = stroke.time_s <= stroke.time_s[0] + PIECE_S, stroke.time_s >= stroke.time_s[-1] - PIECE_S
    way = max(abs(float(stroke.position[-1] - stroke.position[0])), 1e-9)
    load, speed = (float(np.mean(v[last]) - np.mean(v[first])) for v in (stroke.current, stroke.velocity))
    return stroke.way * load / way, stroke.way * speed / way


def later(strokes: Sequence[Stroke]) -> list[Stroke]:
    """The later half of each: what a slow controller still settles fades, and a loss of speed stays."""
    halves = ((s, s.time_s >= 0.5 * (s.time_s[0] + s.time_s[-1])) for s in strokes)
    return [
        replace(s, time_s=s.time_s[k], position=s.position[k], velocity=s.velocity[k], current=s.current[k])
        for s, k in halves
        if k.sum() >= LEAST_LATER
    ]


@dataclass(frozen=True)
class Pushed:
    """A drive in its fastest flexing strokes, as its slower ones foretell it. beta (5,): of the current on
    `_load_design`; full: the speed [%/s] that the fastest strokes reach; limit [raw]: the current where more is needed
    than the drive gives, infinite where nowhere is; noise [raw]: of the current."""

    beta: Array
    full: float
    limit: float
    noise: float

    @property
    def viscous(self) -> float:
        """Current per speed [raw s/%]."""
        return float(self.beta[-1])

    def lost(self, strokes: Sequence[Stroke], mine: Sequence[Stroke]) -> tuple[Array, Array]:
        """Speed [%/s] that the fast strokes `mine` have lost, and current [raw] that full speed would need there, (n,)
        both. strokes: all, that tell what settles or brakes."""
        lost = np.minimum(self.full, _unloaded(strokes, mine)) - _joined(mine, "velocity")
        return lost, _load_design(mine) @ self.beta + self.viscous * lost


def fastest(strokes: Sequence[Stroke]) -> list[Stroke]:
    """The flexing strokes of the highest commanded speed."""
    fast = max((s.commanded for s in strokes), default=0.0)
    return [s for s in strokes if s.way > 0 and s.commanded == fast]


def pushed(strokes: Sequence[Stroke]) -> tuple[Pushed, Array, Array, NDArray[np.bool_]] | None:
    """What slower strokes foretell of the fastest, of these the speed lost and the current needed, as `Pushed.lost`, and
    in which samples (n,) the current is at its limit; None where there are too few of either, or nothing is viscous."""
    mine = fastest(strokes)
    slower = [s for s in strokes if s.way > 0 and s.commanded < mine[0].commanded] if mine else []
    if len(mine) < 3 or not slower:
        return None
    design, drawn, at_speed = _load_design(slower), _joined(slower, "current"), _at_speed(slower)
    beta = np.linalg.lstsq(design[at_speed], drawn[at_speed], rcond=None)[0]
    if beta[-1] <= 0:
        return None
    noise = max(float(np.std((drawn - design @ beta)[at_speed])), 1e-9)
    found = Pushed(beta, _full_speed(_joined(mine, "velocity")), np.inf, noise)
    current, (lost, needed) = _joined(mine, "current"), found.lost(strokes, mine)
    seen = _joined(mine, "position") <= np.max(_joined(slower, "position")[at_speed])
    over = needed > np.quantile(needed, 0.75)
    for _ in range(ROUNDS):  # the current stays at the limit wherever more is needed
        found = replace(found, limit=float(np.mean(current[over])) if over.any() else np.inf)
        over = (needed > found.limit) & seen
    return found, lost, needed, over


def ceiling(strokes: list[Stroke]) -> tuple[float, float, float]:
    """Current [raw] at which the drive is at its limit, nan where it is at none, the weight of what that cuts and the
    share of time in which it does: in the fastest flexing strokes speed falls by just what keeps the current from
    exceeding it. What current each place would need at full speed is told by the slower strokes."""
    none, told_by = (np.nan, 0.0, 0.0), pushed(strokes)
    if told_by is None or told_by[-1].sum() < 10:
        return none
    found, lost, needed, over = told_by
    current = _joined(fastest(strokes), "current")
    x, y = needed[over] - found.limit, found.viscous * lost[over]
    share = float(x @ y / max(x @ x, 1e-12))
    rest = y - share * x
    told = share > CEILING_T * float(np.std(rest)) / np.sqrt(max(float(x @ x), 1e-12))
    alone = float(rest @ rest) < CEILING_LEFT * float(y @ y)  # speed changes for no other reason
    bends = _slope(needed[over], current[over])
    slopes = abs(bends[0]) > max(FLAT, SLOPES_T * bends[1])
    # a healthy controller loses as much
    slight = float(np.quantile(lost[over], NEARLY_MOST)) < LEAST_LOSS * found.full
    hidden = float(np.sqrt(x @ x)) < BEYOND_T * found.noise  # what is needed beyond it is less than the current tells
    just = alone and CEILING_SHARE < share < 1 / CEILING_SHARE
    if slight or slopes or hidden or not told or not (just or _agrees(found, lost, needed, current)):
        return none
    every = _joined(strokes, "current")
    weight = weighed(float(np.sqrt(y @ y / len(every))) / found.noise, float(np.std(every)) / found.noise)
    return found.limit, weight, int(over.sum()) / len(every)


def _agrees(found: Pushed, lost: Array, needed: Array, current: Array) -> bool:
    """Whether the limit at which the fastest strokes begin to lose speed, likeliest by that loss alone, explains most of
    what they lose, and is the current that flows from there on. lost [%/s], needed and current [raw]: (n,) of them."""
    y = found.viscous * lost
    limits = np.linspace(np.quantile(needed, 1 - MOSTLY), np.max(needed), LIMITS)[:-1]
    left = [float(np.sum((y - np.maximum(needed - limit, 0.0)) ** 2)) for limit in limits]
    limit = float(limits[int(np.argmin(left))])
    flows = current[needed > limit]
    doubt = SURE * found.noise / np.sqrt(len(flows)) + SAME_LIMIT * limit
    explained = 1 - min(left) / max(float(y @ y), 1e-12)
    return explained > EXPLAINED_LEAST and abs(float(np.mean(flows)) - limit) < doubt


def _full_speed(speed: Array) -> float:
    """The speed that strokes (n,) reach where nothing holds them up: in a tenth of their way they are as fast, however
    long they take elsewhere."""
    order = np.sort(np.maximum(speed, 0.0))
    way = np.cumsum(order)
    return float(np.interp(FULL_SPEED * way[-1], way, order))


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Slope of y over x, (n,) both, and its standard error."""
    apart = x - x.mean()
    size = max(float(apart @ apart), 1e-12)
    slope = float(apart @ y) / size
    return slope, float(np.std(y - y.mean() - slope * apart)) / float(np.sqrt(size))


def _at_speed(strokes: Sequence[Stroke]) -> NDArray[np.bool_]:
    """Samples (n,) in which the drive has not fallen behind the speed that it reaches when told as much: in the others it
    may be at its limit, too."""
    reached = {}
    for commanded in {s.commanded for s in strokes}:
        mine = [s.way * s.velocity for s in strokes if s.commanded == commanded]
        reached[commanded] = _full_speed(np.concatenate(mine))
    return np.concatenate([s.way * s.velocity > AT_SPEED * reached[s.commanded] for s in strokes])


def _unloaded(strokes: Sequence[Stroke], mine: Sequence[Stroke]) -> Array:
    """Speed (n,) [%/s] of extending strokes of the same commanded speed, which a spring helps, at the same time after
    their start and before their end as each sample of `mine`, the lower one: what is settling still, or brakes, is no
    limit. Infinite where there are none."""
    back = [s for s in strokes if s.way < 0 and s.commanded == mine[0].commanded]
    if not back:
        return np.full(sum(len(s.time_s) for s in mine), np.inf)
    speed = np.concatenate([-s.velocity for s in back])
    out = []
    for since in (lambda s: s.time_s, lambda s: s.time_s[-1] - s.time_s):
        at = np.concatenate([since(s) // PIECE_S for s in back])
        known = np.unique(at)
        usual = [float(np.median(speed[at == k])) for k in known]
        out.append(np.interp(np.concatenate([since(s) for s in mine]) / PIECE_S - 0.5, known, usual))
    return np.minimum(*out)


def _joined(strokes: Sequence[Stroke], name: str) -> Array:
    """One channel (n,) of all strokes, one after the other."""
    return np.concatenate([getattr(s, name) for s in strokes])


def _load_design(strokes: Sequence[Stroke]) -> Array:
    """Columns (n, 5): powers 0 to 3 of position / 100 %, and velocity [%/s]."""
    position, velocity = _joined(strokes, "position"), _joined(strokes, "velocity")
    return np.stack([*((position / 100) ** k for k in range(4)), velocity], axis=-1)
