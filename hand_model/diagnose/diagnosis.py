"""Session -> Findings: three stations, corrections of the recording before physics, one ranked list."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..effects import catalogue
from ..effects.base import DriveState
from ..errors import HandModelError, IdentificationError
from ..hand import Hand
from ..session import Finger, Session, read_session
from .angles import FingerAngles
from .balance import Balance
from .command import command_facts, command_findings, refused
from .correct import write_corrected
from .drive import drive_states, drive_trials, is_measured
from .evidence import typical_coefficients
from .findings import Finding, Findings
from .gravity import with_gravity
from .improve import read_model, write_improved
from .interval import held_out, parameter_intervals, proven, sized, variance_ratio
from .name import ALPHA, Named, Naming, name_effects, polish, scan
from .page import write_page
from .prove import Replay

# How before and after were computed, said in the findings: no compiled file is involved until one is replayed.
ENGINE = {"current": "inverse dynamics of the motor's balance, motion as recorded", "encoder": "encoder map, motion as recorded",
          "markers": "linkage polynomial, motion as recorded"}
UNWRITTEN = {"native": False, "mjcf": None, "urdf": "not expressible"}
SMALL = 0.07  # share of the explained mismatch
EXPLAINED_LEAST = 0.7  # of the explainable mismatch: below, the names are not believed


def diagnose(session: Session | str | Path, model: Any = None, output: str | Path | None = None,
             say: Callable[[str], None] | None = None) -> Findings:
    """Say what physics is missing from the declared model of a recorded hand.

    session: a session or its folder. model: a Hand, a .hand file or a compiled folder into which the effects are written
    (what is missing is judged by the declared model fitted to the session itself); None identifies the session's own, False
    writes none. output: folder that gets `findings.json`, `report.html` and, where physics was named, `model_before` and `model`,
    compiled; where the recording was put right, `corrected`, a session. say: called with one line per result as it comes.
    Raises SessionError for a session that breaks its format, HandFileError for a model that is none.
    """
    session = session if isinstance(session, Session) else read_session(session)
    hand = read_model(model) if model not in (None, False) else None
    tell = say or (lambda line: None)
    notes: list[str] = []
    found: list[tuple[float, Finding]] = []
    fingers: dict[str, FingerAngles] = {}
    unexplained: list[dict[str, Any]] = []
    stations = _kinematic_stations(session, tell, notes, found, fingers, unexplained)
    drives = {a: with_gravity(session, fingers, states)
              for a, states in drive_states(session, _encoder_corrections(stations)).items()}
    for actuator in [a for a, states in drives.items() if not is_measured(states)]:
        found.append(refused(actuator, _finger_of(session, actuator), tuple(s.trial for s in drives.pop(actuator))))
    found += _command(session, drives)
    for _, finding in found:
        tell(finding.statement)
    allowed, alone = _delays_apart(drives), {a: Balance(states).fit() for a, states in drives.items()}
    for actuator, states in drives.items():
        effects = [e for e in catalogue("drive") if not e.warps or allowed[actuator]]
        typical = typical_coefficients([fit for a, fit in alone.items() if a != actuator])
        stations.append(Station("current", _finger_of(session, actuator), actuator, None,
                                name_effects(states, effects, typical=typical)))
        tell(stations[-1].line())
    clipped = {s.actuator for s in stations if s.believed for f in s.kept if f.term.effect.clips}
    # a reading that clips says little of the load, on which a sag is judged
    found = [i for i in found if i[1].effect != "drive_sag" or i[1].where["actuator"] not in clipped]
    findings = assemble(stations, _once(found), notes, unexplained)
    if output is not None:
        replays: tuple[Replay, ...] = ()
        if model is not False:
            findings, replays = _modelled(findings, session, hand, stations, Path(output), tell)
            write_corrected(session, findings.findings, _counts_corrected(session, stations), Path(output))
        write_page(findings, stations, replays, session.path.name, Path(output))
        findings.save(output)
    return findings


def _counts_corrected(session: Session, stations: list[Station]) -> dict[str, Callable[[Any], Any]]:
    """Actuator -> correction of its encoder's counts."""
    from .angles import ranges_of_counts

    def of(correct: Callable[[Any], Any], low: float, high: float) -> Callable[[Any], Any]:
        return lambda counts: low + (high - low) * correct(100 * (counts - low) / (high - low)) / 100

    counts = ranges_of_counts(session)
    return {a: of(correct, *counts[a]) for a, correct in _encoder_corrections(stations).items()}


def _modelled(findings: Findings, session: Session, hand: Hand | None, stations: list[Station], output: Path,
              tell: Callable[[str], None]) -> tuple[Findings, tuple[Replay, ...]]:
    """The findings with the model that holds them written, and its replays; without a `hand` the session's own is identified."""
    from ..identify import identify
    from .angles import ranges_of_counts

    if not any(f.correction is None for f in findings.findings):
        return findings, ()
    try:
        hand = identify(session) if hand is None else hand
        tell(f"writing {output / 'model'}")
        named, replays = write_improved(hand, findings.findings, stations, ranges_of_counts(session), output)
    except HandModelError as error:
        return replace(findings, notes=(*findings.notes, f"no model was written: {error}")), ()
    return replace(findings, findings=named), replays


def _encoder_corrections(stations: list[Station]) -> dict[str, Callable[[Any], Any]]:
    """Actuator -> correction of its position [%] for a periodic encoder error: the recording is put right before physics."""
    out: dict[str, Callable[[Any], Any]] = {}
    for station in stations:
        for named in station.naming.found:
            if named.term.effect.name == "encoder_periodic_error" and station.believed and station.actuator is not None:
                slope = float(np.median(np.concatenate([s.slope for s in station.naming.balance.states])))
                before = out.get(station.actuator)
                out[station.actuator] = _periodic(named.term.shape["period"], named.amplitudes["sine"] / slope,
                                                  named.amplitudes["cosine"] / slope, before)
    return out


def _periodic(period: float, sine: float, cosine: float, further: Callable[[Any], Any] | None) -> Callable[[Any], Any]:
    def correct(position: Any) -> Any:
        phase = 2 * np.pi * position / period
        base = position if further is None else further(position)
        return base + sine * np.sin(phase) + cosine * np.cos(phase)

    return correct


def _delays_apart(drives: dict[str, tuple[DriveState, ...]]) -> dict[str, bool]:
    """Whether each drive's current may be delayed: a delay that all drives of a session share is how the log is read."""
    best: dict[str, float] = {}
    for actuator, states in drives.items():
        balance = Balance(states)
        delay = next(e for e in catalogue("drive") if e.warps)
        fit = scan(balance, delay, ())
        best[actuator] = polish(balance, fit, 0).terms[0].shape["delay"] if fit is not None else 0.0
    step = {a: float(np.median(np.diff(s[0].time_s))) for a, s in drives.items()}
    common = min(best.values(), key=abs) if len(best) > 1 else 0.0
    return {a: abs(value - common) > 0.75 * step[a] for a, value in best.items()}


def _command(session: Session, drives: dict[str, tuple[DriveState, ...]]) -> list[tuple[float, Finding]]:
    facts = {}
    for actuator, trials in drive_trials(session).items():
        logs = {t.name: t.log() for t in trials}
        states = drives.get(actuator, ())
        currents = tuple(np.interp(s.time_s, logs[s.trial].time_s, np.nan_to_num(logs[s.trial].column("current"))) for s in states)
        if states:
            facts[actuator] = command_facts(states, currents)
    return command_findings(facts, {a: _finger_of(session, a) for a in facts})


def _once(found: list[tuple[float, Finding]]) -> list[tuple[float, Finding]]:
    """A palm marker is seen with every finger: its slip is one finding, where it shows most."""
    best: dict[Any, tuple[float, Finding]] = {}
    for weight, finding in found:
        key = (finding.effect, finding.where["marker"]) if finding.effect == "palm_marker_slip" else id(finding)
        if key not in best or weight > best[key][0]:
            best[key] = (weight, finding)
    return list(best.values())


class Station:
    """One balance of one finger and what was named there."""

    def __init__(self, signal: str, finger: str | None, actuator: str | None, joint: str | None, naming: Naming) -> None:
        self.signal, self.finger, self.actuator, self.joint, self.naming = signal, finger, actuator, joint, naming
        places = {id(f): naming.fit.terms.index(f.term) for f in naming.found}
        self.parameters = {which: parameter_intervals(naming, which) for which in places.values() if proven(naming, which)}
        self.proven = tuple(f for f in naming.found if places[id(f)] in self.parameters and sized(f, self.parameters[places[id(f)]]))

    @property
    def missing(self) -> bool:
        """Whether the lack-of-fit test says that something is missing, or an effect that it overlooked holds out: along the
        known effects mismatch shows earlier than in any grouping of cells."""
        return self.naming.before.p < ALPHA or bool(self.proven)

    @property
    def explained(self) -> float:
        """Share of the explainable mismatch that the named effects take away."""
        before = max(self.naming.before.excess, 1e-9)
        return float(np.clip(1 - max(self.naming.after.excess, 0.0) / before, 0, 1))

    @property
    def believed(self) -> bool:
        """Whether the names stand: the final model passes the test, or takes most of the mismatch away."""
        return bool(self.proven) and (self.naming.after.p >= ALPHA or self.explained >= EXPLAINED_LEAST)

    @property
    def kept(self) -> tuple[Named, ...]:
        """The effects that stand beside each other: one of a small share may be no more than the form of the large one being
        another, and is left to the unexplained part."""
        return tuple(f for f in self.proven if f.share >= SMALL or f is self.proven[0])

    def line(self) -> str:
        """One line for a progress display."""
        place = " ".join(x for x in (self.finger, self.joint, self.signal) if x)
        if not self.missing:
            return f"{place}: consistent (p {self.naming.before.p:.2g})"
        names = ", ".join(f.term.effect.name for f in self.kept) if self.believed else "unexplained"
        return f"{place}: {names} (p {self.naming.before.p:.2g} -> {self.naming.after.p:.2g})"


def _finger_of(session: Session, actuator: str) -> str | None:
    return next((f.name for f in session.fingers if f.actuator == actuator), None)


def _kinematic_stations(session: Session, tell: Callable[[str], None], notes: list[str],
                        marker_findings: list[tuple[float, Finding]], fingers: dict[str, FingerAngles],
                        unexplained: list[dict[str, Any]]) -> list[Station]:
    if session.palm is None:
        return []
    from ..identify.identification import palm_shape
    from .angles import ranges_of_counts

    if not session.select("flexion") or not any(t.mocap_path for t in session.select("flexion")):
        return []
    try:
        shape = palm_shape(session)
    except IdentificationError as error:
        notes.append(str(error))
        return []
    counts = ranges_of_counts(session)
    out: list[Station] = []
    for finger in session.fingers:
        try:
            out += _finger_stations(session, finger, shape, counts, tell, marker_findings, fingers, unexplained)
        except IdentificationError as error:
            notes.append(str(error))
    return out


def _finger_stations(session: Session, finger: Finger, shape: Any, counts: dict[str, tuple[float, float]],
                     tell: Callable[[str], None], marker_findings: list[tuple[float, Finding]],
                     fingers: dict[str, FingerAngles], unexplained: list[dict[str, Any]]) -> list[Station]:
    from .angles import encoder_states, expected_angles, finger_angles, linkage_states
    from .markers import corrected_angles, name_markers
    from .slips import marker_findings as findings_of
    from .slips import steps
    from .slips import unexplained as unexplained_of

    angles = fingers[finger.name] = finger_angles(session, finger, shape)
    markers = name_markers(angles)
    found = findings_of(angles, markers)
    marker_findings += found
    unexplained += unexplained_of(angles, markers)
    tell(f"{finger.name} markers: {', '.join(f.effect for _, f in found) or 'consistent'} "
         f"(p {markers.p_before:.2g} -> {markers.p_after:.2g})")
    angles, moments = corrected_angles(angles, markers), steps(angles, markers)
    out: list[Station] = []
    states = encoder_states(angles, *counts[finger.actuator], moments) if finger.actuator in counts else ()
    if states:
        out.append(Station("encoder", finger.name, finger.actuator, finger.segments[0].name,
                           name_effects(states, catalogue("encoder"))))
        tell(out[-1].line())
    for joint in range(1, len(finger.segments)):
        expected = expected_angles(out[0].naming) if out and joint == 1 else {}
        states = linkage_states(angles, joint, moments, expected)
        if states:
            out.append(Station("markers", finger.name, finger.actuator, finger.segments[joint].name,
                               name_effects(states, catalogue("linkage"))))
            tell(out[-1].line())
    return out


def assemble(stations: list[Station], marker_findings: list[tuple[float, Finding]], notes: list[str],
             unexplained: Sequence[dict[str, Any]] = ()) -> Findings:
    """One ranked list from all stations; weight: log likelihood that an effect's model takes off. unexplained: of the markers."""
    ranked: list[tuple[float, Finding]] = list(marker_findings)
    rejected: list[dict[str, str]] = []
    unexplained = list(unexplained)
    for station in stations:
        if station.believed:
            ranked += [_finding(station, named, share) for named, share in _merged(station.kept)]
        elif station.missing:
            unexplained.append(_unexplained(station, 1.0))
        if station.believed and station.naming.after.p < ALPHA and station.explained < 0.95:
            unexplained.append(_unexplained(station, 1 - station.explained))
        rejected += [{"effect": name, "where": str(station.finger), "reason": _reason(value)}
                     for name, value in station.naming.rejected[:4]]
    ranked = _one_clock(ranked)
    ranked.sort(key=lambda item: -item[0])
    found = tuple(f for _, f in ranked)
    verdict = "mismatch" if found else "unexplained" if unexplained else "consistent"
    worst = max(stations, key=lambda s: variance_ratio(s.naming, s.naming.declared), default=None)
    lack = {"before": 1.0, "after": 1.0, "limit": 1.0}
    if worst is not None:
        n = worst.naming.balance
        count = max(int((~n.train & n.steady).sum()) or int(n.steady.sum()), 1)
        lack = {"before": variance_ratio(worst.naming, worst.naming.declared),
                "after": variance_ratio(worst.naming, worst.naming.fit), "limit": 1 + 2.6 * float(np.sqrt(2 / count))}
    return Findings(verdict, lack, _protocol(stations), found, tuple(rejected), tuple(unexplained), _next(found),
                    tuple(_channel(s) for s in stations), tuple(notes))


def _one_clock(ranked: list[tuple[float, Finding]]) -> list[tuple[float, Finding]]:
    """A drift that several fingers show is the log's one clock: one finding, of no finger in particular."""
    drifts = sorted((i for i in ranked if i[1].effect == "clock_drift"), key=lambda i: -i[0])
    if len(drifts) > 1:
        weight, first = drifts[0]
        trials = sorted({t for _, f in drifts for t in f.where["trials"]})
        drifts = [(weight, replace(first, where={**first.where, "finger": None, "actuator": None, "trials": trials}))]
    return [i for i in ranked if i[1].effect != "clock_drift"] + drifts


def _merged(found: tuple[Named, ...]) -> list[tuple[Named, float]]:
    """One entry per effect with its share: further harmonics of a periodic one belong to its first."""
    out: dict[str, tuple[Named, float]] = {}
    for named in found:
        first, share = out.get(named.term.effect.name, (named, 0.0))
        out[named.term.effect.name] = (first, share + named.share)
    return list(out.values())


def _reason(log_evidence: float) -> str:
    if log_evidence <= 0:
        return f"the fit does not gain what its parameters cost (log evidence {log_evidence:.1f})"
    return f"another effect explains it better, or what it brings is within the noise (log evidence {log_evidence:.1f})"


def _finding(station: Station, named: Named, share: float) -> tuple[float, Finding]:
    naming = station.naming
    which = naming.fit.terms.index(named.term)
    effect = named.term.effect
    parameters = dict(station.parameters[which])
    parameters |= effect.further(naming.balance.states, parameters)
    values = {k: v["value"] for k, v in parameters.items()}
    where: dict[str, Any] = {
        "finger": station.finger,
        "joint": getattr(effect, "joint", station.joint) if station.signal != "current" else None,
        "actuator": station.actuator,
        "signal": getattr(effect, "signal", station.signal),
        "marker": None,
        "trials": [s.trial for s in naming.balance.states],
        "region": effect.region(naming.balance.states, named.term.shape),
        "share_of_mismatch": share * station.explained,
    }
    top = named.rivals[0].evidence
    weights = np.exp(np.array([r.evidence for r in named.rivals] + [0.0]) - max(top, 0.0))
    weights = weights / weights.sum()
    alternatives = tuple((r.name, float(p)) for r, p in zip(named.rivals, weights[:-1], strict=True)
                         if r.name != effect.name and p > 1e-3)[:4]
    unit = naming.balance.states[0].effort_unit
    fit = {"metric": f"{station.signal}_rmse", "unit": unit, **held_out(naming, which), "engine": ENGINE[station.signal]}
    members = named.members if effect.name in named.members else (effect.name, *named.members)
    recording = getattr(effect, "correction", None)
    model = None if recording else dict(UNWRITTEN)
    weight = 0.5 * max(naming.declared.rss - naming.fit.rss, 0.0) * share
    return weight, Finding(effect.name, members, named.probability, alternatives, where,
                           effect.statement(where, values), parameters, fit, model, recording)


def _unexplained(station: Station, share: float) -> dict[str, Any]:
    return {
        "where": {"finger": station.finger, "joint": station.joint, "actuator": station.actuator, "signal": station.signal},
        "share_of_mismatch": share,
        "shape": f"varies with {station.naming.after.telling}",
    }


def _channel(station: Station) -> dict[str, Any]:
    n = station.naming
    return {"finger": station.finger, "joint": station.joint, "signal": station.signal, "p_before": n.before.p,
            "p_after": n.after.p, "varies_with": n.before.telling, "noise": n.balance.sigma,
            "effects": [f.term.effect.name for f in n.found], "explained": station.explained}


def _protocol(stations: list[Station]) -> dict[str, Any]:
    drives = [s for s in stations if s.signal == "current"]
    if not drives:
        return {}
    states = drives[0].naming.balance.states
    speeds = {v for s in states if "speed" in s.extra for v in np.unique(s.extra["speed"]).tolist()}
    step = float(np.median(np.concatenate([np.diff(s.time_s) for s in states])))
    return {"repeats": len(states), "rate_hz": round(1 / step, 1), "speeds": len(speeds), "isolable": [],
            "not_isolable": [["asymmetric_friction", "spring_preload"]]}


EXPERIMENTS = {
    frozenset(("stribeck_friction", "quadratic_damping")): "moves at a tenth of full speed and at three speeds between",
    frozenset(("drive_backlash", "series_elasticity")): "the same flexion with a known weight at the tip",
    frozenset(("linkage_backlash", "linkage_compliance")): "the same flexion with a known weight at the tip",
    frozenset(("nonlinear_spring", "gravity_load")): "the same flexion with the palm turned over",
    frozenset(("detent_load", "end_stop_contact")): "slow moves that end at three places short of the end of the range",
}


def _next(found: tuple[Finding, ...]) -> str | None:
    for finding in found:
        if len(finding.members) > 1:
            for pair, text in EXPERIMENTS.items():
                if pair <= set(finding.members):
                    return f"{text}: it would separate {' from '.join(sorted(pair))}"
            return (f"slow and fast full-range moves repeated five times on {finding.where['finger']}, and half-range moves "
                    f"from both ends: they would separate {', '.join(finding.members)}")
    return None


__all__ = ["Station", "assemble", "diagnose", "drive_trials"]
