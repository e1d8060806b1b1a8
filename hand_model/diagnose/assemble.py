"""Findings of all stations as one ranked list, with the verdict and the next experiment."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..effects import catalogue
from ..effects.base import sample_interval
from .doubtful import REFUSED, compared, doubted, trifles
from .findings import Finding, Findings, of_one_whole, rejection
from .locate.displacement import NO_HINGE, NOT_RIGID
from .locate.markers import HINGE, SLIPS
from .locate.preload import usual_spring
from .locate.strokes import STROKES
from .magnitude import (
    AT_THE_END,
    Channel,
    channel_figures,
    likely_magnitude,
    magnitude,
    sure_magnitude,
    sure_share,
    values_of,
)
from .name.distinguishability import protocol_pairs
from .name.entries import (
    channel_of,
    finding_of,
    outsider_of,
    unexplained_of,
    unrepeated_of,
)
from .name.interval import variance_ratio
from .name.naming import ALPHA, Named
from .name.station import SAME_PERIOD, UNREST, Station
from .name.wander import estimate_wander

UNLIKE_OTHERS = 2.0  # times the wander of the calmest finger
HARMONICS = 4
# of an encoder error's size, and of that of its kind: less, in the current of the same motor, may be what is left of it
SHADOW = 0.5
ANGULAR = {e.name for station in ("encoder", "linkage") for e in catalogue(station) if e.signal != "log"}
# of that magnitude: less, where the lack-of-fit test sees nothing, is left to the imperfections of reading angles and
# speeds
MINUTE = 0.15
# the same where that test nearly sees something, or what one of a session's channels shows by chance, or of what is plain
TINY = 0.05
PLAIN = 30.0  # log evidence from which a name is: neither chance nor those imperfections have brought as much
CHANNELS = 15
# of a weight counts where the declared model takes up what is named, so that nothing of the mismatch is its: only the
# hand's other motors speak for it
COMPARED = 0.001
MANY = 3  # names of a finger, beside which a channel of it may be explained in part
NEARLY_ALL = 0.95  # of a mismatch: names that take as much leave nothing worth a word
UNSEEN = 0.01  # probability from which the test sees nothing
SIGNALS = {"drive": "current", "motors": "current", "command": "current", "encoder": "encoder", "linkage": "markers"}
SHOWN_IN = {e.name: SIGNALS[e.station] for e in catalogue() if e.station in SIGNALS}
NAMES = {e.name for e in catalogue()}


def assemble(
    stations: list[Station],
    marker_findings: list[tuple[float, Finding]],
    notes: list[str],
    unexplained: Sequence[dict[str, Any]] = (),
) -> Findings:
    """One ranked list from all stations: by what a finding shows in its channel (its weight, `findings.weighed`) and,
    three times as much, by how large it is for its kind (weighted geometric mean). unexplained: of the markers."""
    ranked: list[tuple[float, Finding]] = _heaviest(marker_findings, _palm_marker)
    rejected: list[dict[str, str]] = []
    unexplained, strange = list(unexplained), list[tuple[Station, Named]]()
    soft = {entry["where"]["finger"] for entry in unexplained if entry["shape"] == NOT_RIGID}
    loose = soft | {entry["where"]["finger"] for entry in unexplained if NO_HINGE in entry["shape"]}
    worn = _worn(stations, [f for _, f in ranked])
    believed = [s.believed or s.finger in worn and s.believed_in_part for s in stations]
    for station, stands in zip(stations, believed, strict=True):
        names = _countable(station, stations, loose, soft)
        stands = stands and names is not None
        if stands:
            strange += [(station, f) for f in station.outsiders]
            for merged in _merged(names or ()):
                weight, finding = finding_of(station, *merged)
                if _magnitude(finding, stations) < _beneath(station, merged[0]):
                    minute = "no test sees it beside the noise, and it is minute for one of its kind"
                    rejected.append(rejection(finding.effect, station.finger, minute))
                else:
                    ranked.append((weight, finding))
        elif station.missing:
            unexplained.append(unexplained_of(station, 1.0))
        if stands and station.naming.after.p < ALPHA and station.explained < NEARLY_ALL:
            unexplained.append(unexplained_of(station, 1 - station.explained))
        rejected += [
            rejection(name, station.finger, _reason(value))
            for name, value in station.naming.rejected[:4]
            if name in NAMES
        ]
    named = {(f.effect, f.where["finger"]) for _, f in ranked}
    unexplained += [outsider_of(s, f) for s, f in strange if (f.term.effect.part_of, s.finger) not in named]
    unexplained += [unrepeated_of(s) for s in stations if _wanders(s, stations)]
    ranked = _without_shadows(_one_clock(_of_hinges(ranked, unexplained), [f for _, f in strange]), stations)
    ranked, unsure = _without(ranked, doubted([f for _, f in ranked]))
    sized = [(*_sure_sizes(f, _shown_in(f, stations)), weight * _counted(f, stations), f) for weight, f in ranked]
    ranked = sorted(((float((m**3 * weight) ** 0.25), f) for m, _, weight, f in sized), key=lambda item: -item[0])
    ranked = _heaviest(ranked, _same_place)
    surely = {id(f): most for _, most, _, f in sized}
    ranked, slight = _without(ranked, trifles(ranked, surely))
    rejected += [*unsure, *slight]
    found = _shared(ranked)
    found, left = of_one_whole(found, unexplained)
    verdict = "mismatch" if found else "unexplained" if left else "consistent"
    return Findings(
        verdict,
        _lack_of_fit(stations, found),
        _protocol(stations),
        found,
        tuple(rejected),
        left,
        _next(found),
        tuple(channel_of(s, stands) for s, stands in zip(stations, believed, strict=True)),
        tuple(notes),
    )


def _lack_of_fit(stations: Sequence[Station], found: Sequence[Finding]) -> dict[str, float | None]:
    """Residual variance over the pure error of where it is largest, before and after, with the limit that chance stays
    below: at a station, on recordings kept out, or of the markers that something moved. None where nothing could be
    compared."""
    lack: dict[str, float | None] = {"before": None, "after": None, "limit": None}
    worst = max(stations, key=lambda s: variance_ratio(s.naming, s.naming.declared), default=None)
    if worst is not None:
        n = worst.naming.balance
        count = max(int((~n.train & n.steady).sum()) or int(n.steady.sum()), 1)
        lack = {
            "before": variance_ratio(worst.naming, worst.naming.declared),
            "after": variance_ratio(worst.naming, worst.naming.fit),
            "limit": 1 + 2.6 * float(np.sqrt(2 / count)),
        }
    for fit in (f.fit for f in found if f.where["signal"] == "markers"):
        if fit.get("metric") == "marker_rmse" and fit["before"] is not None and fit["noise_floor"]:
            before, after = ((fit[k] / fit["noise_floor"]) ** 2 for k in ("before", "after"))
            if before > (lack["before"] or 0.0):
                lack = {**lack, "before": before, "after": after}
    return lack


def _worn(stations: Sequence[Station], of_markers: Sequence[Finding]) -> set[str | None]:
    """Fingers of which so many things are known to be missing that a channel may well lack more than are looked for."""
    named = Counter(f.where["finger"] for f in of_markers)
    for station in (s for s in stations if s.believed):
        named[station.finger] += len(station.kept)
    return {finger for finger, count in named.items() if count >= MANY}


def _beneath(station: Station, named: Named) -> float:
    """Magnitude beneath which what was named at a station says nothing, since the lack-of-fit test sees no mismatch there,
    or one that may be chance. What is plain is none. A motor's steady speed is read as well as its place, which a joint's
    angle is not."""
    p = station.naming.before.p
    least = MINUTE if p >= UNSEEN and named.evidence < PLAIN else TINY if p >= ALPHA / CHANNELS else 0.0
    return 0.0 if least and station.signal == "current" and station.steadily(named) else least


def _counted(finding: Finding, stations: Sequence[Station]) -> float:
    """Share of a finding's weight that counts: how large it is may be told by comparison alone."""
    alone = compared(finding) or any(finding.effect in s.compared and s.names(finding) for s in stations)
    return COMPARED if alone else 1.0


def _countable(
    station: Station, stations: Sequence[Station], loose: Collection[str], soft: Collection[str]
) -> tuple[Named, ...] | None:
    """What stands at a station; None where nothing of it counts, for the markers of its finger are `loose`. Where these
    leave their hinge in step with the angle, and are not `soft`, that is no function of time: a clock that drifts counts."""
    if station.finger not in loose or not _leave_something(station, stations):
        return station.kept
    clock = () if station.finger in soft else tuple(f for f in station.kept if f.term.effect.signal == "log")
    return clock or None


def _leave_something(station: Station, stations: Sequence[Station]) -> bool:
    """Whether a station is of angles, and angles of its finger leave more than next to nothing beside their names: where
    markers leave their segments or their hinge by no known way, what is wrong with the markers may be behind both."""
    angles = [s for s in stations if s.finger == station.finger and s.signal != "current"]
    return station.signal != "current" and any(s.naming.after.p < ALPHA and s.explained < NEARLY_ALL for s in angles)


def _magnitude(finding: Finding, stations: Sequence[Station]) -> float:
    """How large a finding is for its kind."""
    return magnitude(finding.effect, values_of(finding.parameters), _shown_in(finding, stations))


def _sure_sizes(finding: Finding, channel: Channel | None) -> tuple[float, float]:
    """How large a finding is for its kind for sure, by its figures or by the part of it that recordings kept out bear out:
    as it is ranked, and at most.

    What counts by its load at the end of the range is ranked by its figures. How far a hinge that is none moves is told
    only beside what another hinge would explain, its value the least: that it is none is sure all the same, and how far
    likely more.
    """
    by_figures = likely_magnitude if finding.effect in HINGE else sure_magnitude
    sure = by_figures(finding.effect, finding.parameters, channel)
    borne_out = magnitude(finding.effect, values_of(finding.parameters), channel) * sure_share(finding.fit)
    most = max(sure, borne_out)
    return sure if finding.effect in AT_THE_END else most, most


def _shown_in(finding: Finding, stations: Sequence[Station]) -> Channel | None:
    """The figures of the station that shows effects of a finding's kind; None where its finger has none. Strokes that a
    drive's limit slows down never need more than that limit: what it cuts is told by them alone."""
    station = _showing(finding, stations)
    if station is None:
        return None
    slowed = finding.fit.get("engine") == STROKES
    accounts = () if slowed else _accounts(station, stations)
    return channel_figures(station.naming.balance.states, *accounts, stiffness=_stiffness(station))


def _showing(finding: Finding, stations: Sequence[Station]) -> Station | None:
    """The station of a finding's finger in which effects of its kind show; None where there is none."""
    signal, finger = SHOWN_IN.get(finding.effect), finding.where["finger"]
    return next((s for s in stations if s.signal == signal and s.finger == finger), None)


def _accounts(station: Station, stations: Sequence[Station]) -> tuple[Mapping[str, float], ...]:
    """What a station's declared model needs, as fitted beside the names, and with preload and spring as the hand's other
    drives have them: its own may hold what names left over."""
    declared = station.naming.fit.declared
    known = usual_spring(stations, station) if station.signal == "current" else {}
    return (declared, {**declared, **{name: value for name, (value, _) in known.items()}}) if known else (declared,)


def _stiffness(station: Station) -> float:
    """Stiffness [effort/position] of a drive's spring over the positions that it was at, as declared and as bent; zero
    where none is declared."""
    balance, fit = station.naming.balance, station.naming.fit
    stiffness = fit.declared.get("spring", 0.0)
    for which, term in enumerate(fit.terms):
        if term.effect.name == "nonlinear_spring":
            at = balance.gather(lambda s, i=which: np.stack([s.position, fit.added(i, s)], axis=-1))
            stiffness += float(np.polyfit(*at.T, 1)[0])
    return stiffness


def _heaviest(found: Sequence[tuple[float, Finding]], key: Callable[[Finding], Any]) -> list[tuple[float, Finding]]:
    """The heaviest of the findings that share a key."""
    best: dict[Any, tuple[float, Finding]] = {}
    for item in found:
        best[key(item[1])] = max(best.get(key(item[1]), item), item, key=lambda i: i[0])
    return list(best.values())


def _palm_marker(finding: Finding) -> Any:
    """A palm marker is seen with every finger: its slip is one finding, where it shows most."""
    return (finding.effect, finding.where["marker"]) if finding.effect == "palm_marker_slip" else id(finding)


def _same_place(finding: Finding) -> Any:
    """What says the same of the same place: a sag shows in speed and in current."""
    return (finding.effect, *(str(finding.where.get(k)) for k in ("finger", "joint", "actuator", "marker", "markers")))


def _without(
    ranked: list[tuple[float, Finding]], left_out: list[tuple[Finding, str]]
) -> tuple[list[tuple[float, Finding]], list[dict[str, str]]]:
    """The others, and what is left out with its reason, as it is told."""
    told = [rejection(f.effect, f.where["finger"], reason) for f, reason in left_out]
    return [(w, f) for w, f in ranked if all(f is not other for other, _ in left_out)], told


def _shared(ranked: list[tuple[float, Finding]]) -> tuple[Finding, ...]:
    """The findings with their shares of the whole session's mismatch, by the squares of the weights that rank them,
    times what the names of their channels explain. A channel that is refused counts as the heaviest of the others."""
    heaviest = max((w for w, f in ranked if f.effect != REFUSED), default=1.0)
    power = np.array([min(w, heaviest) ** 2 for w, _ in ranked])
    channels = [tuple(f.where[k] for k in ("finger", "joint", "actuator", "signal")) for _, f in ranked]
    own = [f.where["share_of_mismatch"] for _, f in ranked]
    explained = [min(sum(s for s, c in zip(own, channels, strict=True) if c == channel), 1.0) for channel in channels]
    shares = power / max(power.sum(), 1e-300) * (np.average(explained, weights=power) if power.sum() > 0 else 1.0)
    return tuple(
        replace(f, where={**f.where, "share_of_mismatch": float(s)}) for (_, f), s in zip(ranked, shares, strict=True)
    )


def _wanders(station: Station, stations: Sequence[Station]) -> bool:
    """Whether one finger repeats itself clearly less well than the others do, also if its noise lasts as long as theirs:
    how all of them are is how this hand is."""
    naming, same = station.naming, [s for s in stations if s.signal == station.signal and s.joint == station.joint]
    if naming.wander is None or not naming.wander.real:
        return False
    calmest = min((s.wander for s in same if s is not station), default=0.0)
    longest = max(s.naming.balance.inflation for s in same)
    chance = estimate_wander(naming.balance.with_inflation(longest), naming.fit.prediction)
    return chance is not None and chance.real and station.wander > max(UNREST, UNLIKE_OTHERS * calmest)


def _one_clock(ranked: list[tuple[float, Finding]], strange: Sequence[Named]) -> list[tuple[float, Finding]]:
    """A drift that several fingers show is the log's one clock: one finding, of no finger in particular. It is none where
    in any of them that clock does what no table names. strange: what stands of that kind."""
    beyond = {name for f in strange if f.term.effect.signal == "log" for name in f.term.effect.covers}
    ranked = [i for i in ranked if i[1].effect not in beyond]
    drifts = sorted((i for i in ranked if i[1].effect == "clock_drift"), key=lambda i: -i[0])
    if len(drifts) > 1:
        weight, first = drifts[0]
        trials = sorted({t for _, f in drifts for t in f.where["trials"]})
        drifts = [(weight, replace(first, where={**first.where, "finger": None, "actuator": None, "trials": trials}))]
    return [i for i in ranked if i[1].effect != "clock_drift"] + drifts


def _without_shadows(ranked: list[tuple[float, Finding]], stations: Sequence[Station]) -> list[tuple[float, Finding]]:
    """Without what a motor's encoder error leaves in its current after it was put right: a position that errs by a
    percent errs by many percent in speed. Effects that are small there and for their kind, and ripples at the error's
    period or a harmonic of it that are no larger than half of it makes, are no evidence."""
    wrong = {f.where["actuator"]: (weight, f) for weight, f in ranked if f.effect == "encoder_periodic_error"}

    def shadow(weight: float, finding: Finding) -> bool:
        if finding.where["actuator"] not in wrong or finding.where["signal"] != "current":
            return False
        error_weight, error = wrong[finding.where["actuator"]]
        small = weight < SHADOW * error_weight and _magnitude(finding, stations) < SHADOW
        return small or finding.effect == "torque_ripple" and _echoes(finding, error, stations)

    return [item for item in ranked if not shadow(*item)]


def _echoes(ripple: Finding, error: Finding, stations: Sequence[Station]) -> bool:
    """Whether a ripple is at the period of an encoder's error, or a harmonic of it, and no larger than what half of that
    error makes of the current: position, speed and acceleration err, by A, A w and A w^2 at w = 2 pi speed / period."""
    order = error.parameters["period"]["value"] / ripple.parameters["period"]["value"]
    if not 0.5 < order < HARMONICS + 0.5 or abs(order / round(order) - 1) >= SAME_PERIOD:
        return False
    station = _showing(ripple, stations)
    if station is None:  # nothing says how much
        return True
    balance, declared = station.naming.balance, station.naming.fit.declared
    velocity = balance.gather(lambda s: s.velocity)
    rate = 2 * np.pi * float(np.sqrt(np.mean(velocity**2))) / ripple.parameters["period"]["value"]
    made = sum(abs(declared.get(name, 0.0)) * rate**k for k, name in enumerate(("spring", "viscous", "inertia")))
    return bool(ripple.parameters["amplitude"]["value"] < SHADOW * made * error.parameters["amplitude"]["value"])


def _of_hinges(
    ranked: list[tuple[float, Finding]], unexplained: Sequence[Mapping[str, Any]]
) -> list[tuple[float, Finding]]:
    """Without what markers and angles tell where several fingers' markers leave the hinges' motion by no known way: it
    is the cameras that bend space."""
    bent = {entry["where"]["finger"] for entry in unexplained if NO_HINGE in entry["shape"]}
    wrong = ANGULAR | {*HINGE, *SLIPS} if len(bent) > 1 else set()
    return [item for item in ranked if item[1].where["finger"] not in bent or item[1].effect not in wrong]


def _merged(found: tuple[Named, ...]) -> list[tuple[Named, float, float]]:
    """One entry per effect with its share and size: further harmonics of a periodic one belong to its first."""
    out: dict[str, tuple[Named, float, float]] = {}
    for named in found:
        first, share, size = out.get(named.term.effect.name, (named, 0.0, 0.0))
        out[named.term.effect.name] = (first, share + named.share, float(np.hypot(size, named.size)))
    return list(out.values())


def _reason(log_evidence: float) -> str:
    if log_evidence <= 0:
        return f"the fit does not gain what its parameters cost (log evidence {log_evidence:.1f})"
    return f"another effect explains it better, or what it brings is within the noise (log evidence {log_evidence:.1f})"


def _protocol(stations: list[Station]) -> dict[str, Any]:
    """What the first motor's recordings can tell apart: how many, rows a second, commanded speeds, and pairs of
    effects."""
    drives = [s for s in stations if s.signal == "current"]
    if not drives:
        return {"repeats": 0, "rate_hz": None, "speeds": 0, "isolable": [], "not_isolable": []}
    states = drives[0].naming.balance.states
    speeds = {v for s in states if "speed" in s.extra for v in np.unique(s.extra["speed"]).tolist()}
    step = sample_interval(states)
    told, alike = protocol_pairs(drives[0].naming.balance, catalogue("drive"))
    return {
        "repeats": len(states),
        "rate_hz": round(1 / step, 1),
        "speeds": len(speeds),
        "isolable": told,
        "not_isolable": [["asymmetric_friction", "spring_preload"], *alike],
    }


EXPERIMENTS = {
    frozenset(("stribeck_friction", "quadratic_damping")): "moves at a tenth of full speed and at three speeds between",
    frozenset(("drive_backlash", "series_elasticity")): "the same flexion with a known weight at the tip",
    frozenset(("linkage_backlash", "linkage_compliance")): "the same flexion with a known weight at the tip",
    frozenset(("nonlinear_spring", "gravity_load")): "the same flexion with the palm turned over",
    frozenset(("gravity_load", "asymmetric_friction")): "the same flexion with the palm turned over",
    frozenset(("detent_load", "end_stop_contact")): "slow moves that end at three places short of the end of the range",
}


def _next(found: tuple[Finding, ...]) -> str | None:
    for finding in found:
        if len(finding.members) > 1:
            for pair, text in EXPERIMENTS.items():
                if pair <= set(finding.members):
                    return f"{text}: it would separate {' from '.join(sorted(pair))}"
            return (
                f"slow and fast full-range moves repeated five times on {finding.where['finger']}, and half-range moves "
                f"from both ends: they would separate {', '.join(finding.members)}"
            )
    return None
