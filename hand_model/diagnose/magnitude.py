"""How large a named effect is for one of its kind: one where it is plain in a hand that has it.

Shares of noise or of signal do not compare across channels: a marker tells a tenth of a slip better than a motor's
current tells a worn gear. The figures are conventions, from what the published hands and recordings with one known
effect show; they rank findings and decide nothing else. An effect without an entry counts as plain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects.base import DriveState, position_range, speed_range
from ..effects.compliance import at_driver
from ..effects.spring_decoupling import comes_late, tips_over

SLIGHT = 0.25  # of the size at which an effect is plain
LEAST, MOST = 1e-3, 3.0  # beyond, a figure says nothing more about its kind


@dataclass(frozen=True)
class Channel:
    """What magnitudes refer to. effort, load: standard deviations; low, high: range of positions; fastest: speed;
    ahead: farthest that a joint ran ahead of its drive; granted: length of bristles that any drive of the session may
    have; turned: whether the hand was seen to turn; plain: sizes (n,) of what the drive needs without the named effects,
    by each account of it; stiffness: of its spring, bent or not, over the positions that it was at."""

    effort: float = 1.0
    load: float = 0.0
    low: float = 0.0
    high: float = 100.0
    fastest: float = 100.0
    ahead: float = 0.0
    granted: float = 0.0
    turned: bool = True
    plain: tuple[NDArray[np.float64], ...] = ()
    stiffness: float = 0.0

    @property
    def span(self) -> float:
        """Range of positions."""
        return self.high - self.low

    def beyond(self, limit: float) -> float:
        """Share of what the drive needs without the named effects that is beyond a limit, by the account that says least;
        one where it is unknown."""
        return min((float(np.mean(plain > limit)) for plain in self.plain), default=1.0)


def channel_figures(states: tuple[DriveState, ...], *declared: Mapping[str, float], stiffness: float = 0.0) -> Channel:
    """The figures of one balance's recordings. declared: accounts of what the drive needs, name -> coefficient;
    stiffness: of its spring [effort/position], zero where it is unknown."""
    effort = np.concatenate([s.effort[np.isfinite(s.effort)] for s in states])
    load, ahead, granted = (
        np.concatenate([s.extra.get(name, np.zeros(1)) for s in states]) for name in ("load", "ahead", "granted")
    )
    low, high = position_range(states)
    return Channel(
        max(float(np.std(effort)), 1e-12),
        float(np.nanstd(load)),
        low,
        high,
        speed_range(states)[1],
        float(np.nanmax(ahead)),
        float(np.max(granted)),
        any(np.ptp(s.extra.get("gravity_along", np.zeros(1))) > 0 for s in states),
        tuple(_needed(states, account) for account in declared),
        stiffness,
    )


def _needed(states: tuple[DriveState, ...], account: Mapping[str, float]) -> NDArray[np.float64]:
    """Sizes (n,) of the effort that declared coefficients ask for."""
    asked = [(s.declared @ [account[n] for n in s.declared_names])[np.isfinite(s.effort)] for s in states]
    return np.abs(np.concatenate(asked))


def magnitude(effect: str, parameters: Mapping[str, float], channel: Channel | None = None) -> float:
    """Size of an effect over one at which it is plain, within [LEAST, MOST]. parameters: name -> value, as in a
    finding; channel: of the balance that named it, where it is one."""
    rule = PLAIN.get(effect)
    if rule is None:
        return 1.0
    known = {name: abs(float(value)) for name, value in parameters.items() if value is not None and np.isfinite(value)}
    try:
        size = rule(known, channel or Channel())
    except KeyError:
        return 1.0
    return float(np.clip(size, LEAST, MOST)) if np.isfinite(size) else 1.0


def values_of(figures: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """name -> value of figures, as a finding's parameters."""
    return {name: entry["value"] for name, entry in figures.items()}


def sure_magnitude(effect: str, figures: Mapping[str, Mapping[str, Any]], channel: Channel | None = None) -> float:
    """The magnitude less what the 95 % intervals of its figures leave open, as if their errors were independent (square
    root of the sum of squares). figures: name -> entry with `value` and, where there is one, `ci95`, as a finding's
    parameters."""
    values = values_of(figures)
    size, lost = magnitude(effect, values, channel), 0.0
    for name, entry in figures.items():
        interval = entry.get("ci95")
        if entry["value"] is None or interval is None or None in interval:
            continue
        ends = [*interval, 0.0] if interval[0] * interval[1] <= 0 else interval
        least = min(magnitude(effect, {**values, name: end}, channel) for end in ends)
        lost += max(size - least, 0.0) ** 2
    return max(size - float(np.sqrt(lost)), LEAST)


def sure_share(fit: Mapping[str, Any]) -> float:
    """Share of what a name explains of recordings kept out (its square root: of its size) that it explains for sure, by
    the 95 % interval of how far their error falls; zero where that was not asked. fit: a finding's.

    Where two figures of one effect vouch for each other, a load and the speed or place to which it belongs, the interval
    of each alone reaches to nothing, and the effect is sure all the same."""
    before, after, fall = (fit.get(key) for key in ("before", "after", "ci95_reduction"))
    if before is None or after is None or not before > after or fall is None or None in fall:
        return 0.0
    least = before**2 - (before - max(fall[0], 0.0)) ** 2
    return float(np.sqrt(np.clip(least / (before**2 - after**2), 0.0, 1.0)))


def likely_magnitude(effect: str, figures: Mapping[str, Mapping[str, Any]], channel: Channel | None = None) -> float:
    """The magnitude of an effect of which recordings tell at least how large it is, and at most: at the middle of each
    interval by order of magnitude, where that is more than the least. figures: as of `sure_magnitude`."""
    values = values_of(figures)
    middle = dict(values)
    for name, entry in figures.items():
        interval = entry.get("ci95")
        if interval is not None and None not in interval and min(interval) > 0:
            middle[name] = float(np.sqrt(interval[0] * interval[1]))
    return max(magnitude(effect, values, channel), magnitude(effect, middle, channel))


Rule = Callable[[Mapping[str, float], Channel], float]


def _asymmetry(p: Mapping[str, float], _: Channel) -> float:
    there, back = p["viscous_flexion"], p["viscous_extension"]
    return abs(there - back) / max(there + back, 1e-12) / 0.5


def _depth(p: Mapping[str, float], c: Channel) -> float:
    """Load of a stop or an obstacle at the end of the range, for half of the effort's deviation."""
    reach = max(c.high - p["begin"], p["begin"] - c.low if p["begin"] < c.low + c.span / 4 else 0.0)
    # an obstacle's load may grow with the square of the depth, as stiff as said at a tenth of 100; a stop's form says how
    # it damps
    bent = "side" not in p and p.get("form", 0.0) > 0.5
    return p["stiffness"] * reach * (reach / 10.0 if bent else 1.0) / (0.6 * c.effort)


def _by_load(p: Mapping[str, float], c: Channel) -> float:
    """Friction per load of the whole spring: beside one that bends, its straight part alone may be anything."""
    return (p["per_load"] / c.stiffness if c.stiffness > 0 else p["load_coefficient"]) / 0.4


def _apart(p: Mapping[str, float], c: Channel) -> float:
    if comes_late(p):
        return p["lead"] * p["lag"] * c.fastest / (0.3 * c.span)
    if tips_over(p):
        return p["lead"] / (0.3 * c.effort)
    return (p["lead"] * (p["below"] - c.low) if p["form"] > 0.5 else c.ahead) / (0.3 * c.effort)


def _give(p: Mapping[str, float], c: Channel) -> float:
    dragged = p.get("drag_compliance", 0.0) * p.get("drag", 0.0) * 0.5 * c.fastest
    given = np.hypot(p["compliance"] * c.load, dragged)
    return given / (0.017 * (c.span if at_driver({"form": 1.0, **p}) else 3.5 * c.effort))


PLAIN: Mapping[str, Rule] = {
    "asymmetric_friction": lambda p, c: p["half_difference"] / (0.3 * c.effort),
    "asymmetric_viscous_friction": _asymmetry,
    "stribeck_friction": lambda p, c: (
        p["static_excess"] * min(p["stribeck_speed"] / (0.25 * c.fastest), 1.0) / (0.5 * c.effort)
    ),
    "load_dependent_friction": _by_load,
    "position_dependent_friction": lambda p, c: p["extra_friction"] / (0.4 * c.effort),
    "quadratic_damping": lambda p, c: p["drag"] * c.fastest**2 / (0.6 * c.effort),
    "presliding_friction": lambda p, c: max(p["bristle_length"] - c.granted, 0.0) / (0.02 * c.span),
    "thermal_friction_drift": lambda p, c: p["cold_excess"] / (0.3 * c.effort),
    "detent_load": lambda p, c: p["load"] / (0.35 * c.effort),
    # whatever loads the drive a little by position bends its spring, in one pose a weight, too, of which preload and
    # spring take nearly all else up
    "nonlinear_spring": lambda p, c: p["bend"] / ((0.22 if c.turned else 0.3) * c.effort),
    "gravity_load": lambda p, c: p["largest"] / ((0.25 if c.turned else 0.75) * c.effort),
    "torque_ripple": lambda p, c: p["amplitude"] / (0.17 * c.effort),
    "elastoplastic_hysteresis": lambda p, c: p["yield_load"] / (0.3 * c.effort),
    "viscoelastic_spring": lambda p, c: p["stiffness"] * c.span / (0.6 * c.effort),
    "end_stop_contact": _depth,
    "external_contact": _depth,
    "drive_backlash": lambda p, c: p["gap"] / (0.03 * c.span),
    "linkage_backlash": lambda p, c: p["gap"] / (0.03 * c.span),
    "spring_decoupling": _apart,
    "series_elasticity": _give,
    "linkage_compliance": _give,
    "coupling_deadband": lambda p, c: p["until"] / (0.1 * c.span),
    "distal_stop": lambda p, c: (c.high - p["from"]) / (0.12 * c.span),
    "encoder_periodic_error": lambda p, c: p["amplitude"] / (0.005 * c.span),
    "drive_sag": lambda p, _: p["sag"] / 0.002 if "sag" in p else p["torque_loss"] / 0.3,
    # what it would cut alone: another effect may push the current beyond it
    "current_saturation": lambda p, c: min(p["share_cut"], c.beyond(p["limit"])) / 0.15,
    "current_channel_delay": lambda p, _: p["delay"] / 0.06,
    "command_delay": lambda p, _: p["delay"] / 0.11,
    "clock_drift": lambda p, _: p["rate_minus_one"] / 0.001,
    "joint_wobble": lambda p, _: p["amplitude"] / 0.05,
    # of a travel of 2 mm half is told: the rest another hinge would explain
    "moving_centre": lambda p, _: min(p["travel"] / 0.001, 1.0),
    "marker_slip": lambda p, _: p["distance"] / 0.002,
    "palm_marker_slip": lambda p, _: p["distance"] / 0.0025,
    "support_slip": lambda p, _: p["turn"] / 0.05,
    "marker_swap": lambda p, _: p["lasting"] / 4.0,
}
# By their load at the end of the range, where they may never have been felt.
AT_THE_END = frozenset(effect for effect, rule in PLAIN.items() if rule is _depth)
