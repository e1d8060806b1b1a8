"""The kind of controller behind a drive, and a start for the fit of everything: searched with the plant held at the
regression's values.

A few moves of every speed and direction, simulated at a coarse step, are enough to tell one controller from another;
the plant, which a regression that knows no controller has found already, is not let go before the controller is near,
or the two run off together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from . import output_error
from .balance import NAMES
from .drive import CONTROLLERS
from .jacobian import COARSE_S
from .moves import SETTLED, MoveData, shortened, without_rest
from .output_error import ROUGH, OutputErrorFit
from .replicates import lack_of_fit
from .residuals import whitened

CLOSE = 1.15  # mean square of the residuals [noise variances] below which no other kind of friction is tried
SOME = 12  # moves that the search simulates
SOME_S = 1.6  # of each of them
MOVE_S = 2.5  # of a move that is simulated: the rest of a slow one says little more
GLANCE, SEARCH = ((COARSE_S, 3, 5.0, 0.5, 1.0),), ((COARSE_S, 8, 5.0, 0.5, 1.0),)  # see output_error.fit
STICK, BRISTLES = {"presliding": 0.0, "bristle": 0.0}, {"presliding": 0.3, "bristle": 0.004}  # the kinds of friction
JUMP = {"rise": 0.0, "fall": 0.0}  # a reference whose speed jumps
SUDDEN_S = 0.03  # time to full speed [s] below which a jump is tried
EVIDENCE = 10.0  # fall of the misfit for which two parameters more are believed
NEAR, FAR = 5.0, 10.0  # a start is not tried when another came near the noise and it began so many times farther off


def find_controller(
    moves: Sequence[MoveData],
    plant: Mapping[str, float],
    sigma: tuple[float, float],
    bounds: Mapping[str, tuple[float, float]],
    enough: float,
) -> OutputErrorFit:
    """Fit of plant and controller, the kind of controller chosen by how well it explains the moves.

    plant: values of inertia, friction and spring to search with.
    sigma: noise of position [%] and current [raw]. bounds: parameter -> (low, high). enough: systematic misfit [noise
    variances] below which no other kind is tried.
    """
    start, some = start_values(moves, plant), _spread(moves)
    moves = [shortened(m, MOVE_S) for m in moves]
    starts = (
        ("profile", {**start, "rise": 0.01, "fall": 0.01, "damping": 0.3 * start["damping"]}),
        ("profile", {**start, "rise": 0.1, "fall": 0.1}),
        ("cascade", {**start, "rise": 0.08, "gain": 12.0, "damping": 2.5}),
    )
    glances: list[OutputErrorFit] = []
    for kind, values in sorted(starts, key=lambda x: _first_misfit(some, *x, sigma)):
        if not glances or min(max(g.chi2) for g in glances) > NEAR:
            names = [n for n in _names(kind, values) if n not in NAMES]
            glances.append(output_error.fit(some, values, names, sigma, bounds, kind, GLANCE))
    nearest = min(g.cost for g in glances)
    best = None
    for i in np.argsort([g.cost for g in glances]):
        g = glances[i]
        if best is not None and max(best.chi2) < NEAR and g.cost > FAR * nearest:
            break
        near = _near(some, g, {}, sigma, bounds)
        if max(near.chi2) > CLOSE:
            other = _near(some, near, BRISTLES if near.values["presliding"] == 0 else STICK, sigma, bounds)
            near = min((near, other), key=lambda f: f.cost + EVIDENCE * ("bristle" in f.names))
        if near.controller == "profile" and min(near.values["rise"], near.values["fall"]) < SUDDEN_S:
            jump = _near(some, near, JUMP, sigma, bounds)
            near = jump if jump.cost < near.cost + EVIDENCE else near
        # bristles at rest let go under every tremor: what they hold there is not known
        whole = moves if near.values["presliding"] == 0 else [without_rest(m) for m in moves]
        found = output_error.fit(
            whole, near.values, _names(near.controller, near.values), sigma, bounds, near.controller, ROUGH
        )
        if best is None or found.cost < best.cost:
            best = found
        if lack_of_fit(best) < enough:
            break
    return best


def _first_misfit(
    some: Sequence[MoveData], kind: str, values: Mapping[str, float], sigma: tuple[float, float]
) -> float:
    """Sum of squares of the whitened residuals of a start: the kind that is nearest before anything is fitted mostly
    stays it."""
    found = np.concatenate(whitened(some, values, np.array([m.own for m in some]), sigma, kind, COARSE_S))
    return float(np.nan_to_num(np.sum(found**2), nan=np.inf))


def _names(kind: str, values: Mapping[str, float]) -> tuple[str, ...]:
    """Parameters of a drive with this controller; one that sticks hard has no bristles, a reference whose speed jumps
    no ramps of speed."""
    fixed = (*(STICK if values["presliding"] == 0 else ()), *(JUMP if values["rise"] == 0 else ()))
    return tuple(n for n in CONTROLLERS[kind] if n not in fixed)


def _near(
    some: Sequence[MoveData],
    g: OutputErrorFit,
    changed: Mapping[str, float],
    sigma: tuple[float, float],
    bounds: Mapping[str, tuple[float, float]],
) -> OutputErrorFit:
    """The search from a glance, with these values."""
    values = {**g.values, **changed}
    return output_error.fit(
        some,
        values,
        [n for n in _names(g.controller, values) if n not in NAMES],
        sigma,
        bounds,
        g.controller,
        SEARCH,
        g.own,
    )


def start_values(moves: Sequence[MoveData], plant: Mapping[str, float]) -> dict[str, float]:
    """Starting values: the plant as it is, the controller from how fast moves go and what holds the drive off its
    setpoint."""
    ratio, error, hold = [], [], []
    for m in moves:
        n = len(m.time_s)
        way = np.sign(m.target - m.origin)
        middle = (way * (m.position - m.origin) > 0.25 * abs(m.target - m.origin)) & (
            way * (m.position - m.origin) < 0.75 * abs(m.target - m.origin)
        )
        if middle.sum() >= 5 and m.own[2] > 0:
            ratio.append(abs(np.polyfit(m.time_s[middle], m.position[middle], 1)[0]) / m.own[2])
        tail = slice(max(0, n - 6), n)
        if np.ptp(m.position[tail]) < SETTLED:
            error.append(np.mean(m.target - m.position[tail]))
            hold.append(np.mean(m.current[tail]))
    error, hold = np.array(error), np.array(hold)
    gain = float(error @ hold / max(error @ error, 1e-9))
    gain = gain if 0.5 < gain < 1e3 else 20.0
    speed = float(np.median(ratio)) * 1.02 if ratio else 100.0
    return {
        **(BRISTLES if "presliding" in plant else STICK),
        **plant,
        "speed_full": speed,
        "rise": 0.1,
        "fall": 0.1,
        "delay": 5e-4,
        "lead": 5e-4,
        "lag": 0.0,
        "edge": 0.1,
        "position_gain": 12.0,
        "deadband": float(np.median(np.abs(error))) if len(error) else 1.0,
        "gain": gain,
        "damping": 2 * np.sqrt(gain * plant["inertia"]),
    }


def _spread(moves: Sequence[MoveData]) -> tuple[MoveData, ...]:
    """SOME of the moves, of every direction, speed and distance, their first SOME_S."""
    order = sorted(moves, key=lambda m: (m.target > m.origin, m.own[2], abs(m.target - m.origin)))
    pick = np.unique(np.linspace(0, len(order) - 1, min(SOME, len(order))).astype(int))
    return tuple(shortened(order[i], SOME_S) for i in pick)
