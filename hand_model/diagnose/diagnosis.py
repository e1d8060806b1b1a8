"""Session -> Findings: three stations, corrections of the recording before physics, one ranked list."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..background import Background, Pair, single_threaded
from ..effects import catalogue, outsiders
from ..effects.base import DriveState, least_delay
from ..errors import HandModelError, SessionError
from ..hand import Hand
from ..output import forget
from ..session import Log, Session, check_session, moves, read_session
from .assemble import assemble
from .findings import FILES, FOLDERS, Finding, Findings
from .finger import FingerReading, finger_calls
from .locate.angles import FingerAngles
from .locate.command import CommandFacts, command_facts, command_findings, refused, with_lateness
from .locate.course import FingerCourses
from .locate.decoupled import while_driven, without_excursions
from .locate.drive import (
    drive_states,
    drive_trials,
    opposes,
    too_short,
    with_gives,
)
from .locate.gravity import with_gravity
from .locate.measurement import echoes_command, is_measured, rests_on_command
from .locate.simulated import SimulatedDrive, delays_apart, simulated_drive
from .locate.stamps import Stamps, stamps
from .magnitude import magnitude
from .name.balance import Balance
from .name.evidence import gain, typical_coefficients
from .name.reread import reread
from .name.shapes import polish, scan
from .name.station import Station, judged
from .page import write_page
from .prove.correct import refuse_output, write_corrected
from .prove.improve import read_model, refuse_other, write_improved
from .prove.replays import Replay
from .weight import with_weights

REASON = 0.5  # of the size at which friction by load is plain: a soft controller falls behind by so much
EARLY = 3.0  # standard deviations by which answers that come before the command say so for sure
# log likelihood that a shift of a drive's current must bring: less, and its drive tells none (two standard deviations)
DELAY_TOLD = 2.0


@single_threaded()
def diagnose(
    session: Session | str | Path,
    model: Any = None,
    output: str | Path | None = None,
    say: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Findings:
    """Say what physics is missing from the declared model of a recorded hand, or of a rig (findings: `RigFindings`).

    session: a session or its folder. model: a Hand, a .hand file or a compiled folder into which the effects are
    written (what is missing is judged by the declared model fitted to the session itself); None identifies the
    session's own, False writes none; a rig brings its own. output: folder that gets `findings.json`, `report.html` and,
    where physics was named, `model_before` and `model`, compiled; where the recording was put right, `corrected`, a
    session. say: called with one line per result as it comes. progress:
    called with the share of the work that is done, 0 to 1.
    Raises SessionError for a session that breaks its format or a rig with a model, HandFileError for a model that is
    none or of another hand, HandModelError for an output that is a file or holds a `corrected` that no diagnosis wrote.
    """
    session = session if isinstance(session, Session) else read_session(session)
    if session.rig is not None:
        return _diagnosed_rig(session, model, output, say)
    hand = read_model(model) if model not in (None, False) else None
    if hand is not None:
        refuse_other(hand, session)
    tell = say or (lambda line: None)
    steps = iter(np.linspace(0, 1, len(session.fingers) + len(drive_trials(session)) + 2).tolist())

    def step() -> None:
        if progress is not None:
            progress(next(steps, 1.0))

    step()
    if output is not None:
        refuse_output(Path(output))
    heard = _Heard(session, tell, step)
    owned = output is not None and model is None
    read = [a for a in drive_trials(session) if a not in heard.unread]
    beside = (
        *(partial(simulated_drive, session, a) for a in read),
        *((partial(_identified, session),) if owned else ()),
    )
    told = heard.listen_to_fingers(beside)
    simulated = delays_apart({d.actuator: d for d in told[: len(read)] if d is not None})
    drives = heard.drives(simulated)
    facts = _command(session, drives)
    heard.found += command_findings(facts, {a: _finger_of(session, a) for a in facts}, simulated)
    for _, finding in heard.found:
        tell(finding.statement)
    heard.listen_to_drives(*_timed(drives, facts, simulated))
    stations = heard.stations
    findings = assemble(stations, heard.found, heard.notes, heard.unexplained)
    listed, written = reread(findings.findings, stations)
    findings = replace(findings, findings=listed)
    if output is not None:
        replays: tuple[Replay, ...] = ()
        forget(output, FOLDERS, FILES[0])
        if model is not False:
            known = told[-1] if owned else hand
            with Pair((findings, session, known, written, heard.courses, Path(output), tell)) as pair:
                (findings, replays), _ = pair.map(_written, ("model", "corrected"))
        write_page(findings, stations, replays, session.path.name, Path(output))
        findings.save(output)
    if progress is not None:
        progress(1.0)
    return findings


def _diagnosed_rig(
    session: Session, model: Any, output: str | Path | None, say: Callable[[str], None] | None
) -> Findings:
    """A rig's findings, its report written beside them."""
    from ..report.rig_findings import write_rig_findings
    from ..rig.diagnose import diagnose_rig

    if model not in (None, False):
        raise SessionError(f"{session.path}: a rig session brings its own model; another one is for sessions of a hand")
    findings = diagnose_rig(session, output, say, model is not False)
    if output is not None:
        write_rig_findings(session, findings, output)
    return findings


class _Heard:
    """What a session has said so far. found: findings with their weight. tell: called with a line per result; step:
    with nothing, after each."""

    def __init__(self, session: Session, tell: Callable[[str], None], step: Callable[[], None]) -> None:
        self.session, self.tell, self.step = session, tell, step
        self.notes = [*check_session(session, dead=True), *too_short(session)]
        self.fingers: dict[str, FingerAngles] = {}
        self.courses: dict[str, FingerCourses] = {}
        self.stations: list[Station] = []
        distrusted = _distrusted(session)
        self.unexplained = [_false_stamps(session, a, s) for a, s in distrusted.items()]
        unmeasured = {
            a: why for a, trials in drive_trials(session).items() if (why := _no_measurement([t.log() for t in trials]))
        }
        self.found: list[tuple[float, Finding]] = [
            refused(a, _finger_of(session, a), tuple(t.name for t in drive_trials(session)[a]), "position", why)
            for a, why in unmeasured.items()
        ]
        self.unread = (*distrusted, *unmeasured)  # actuators whose log is not believed

    def listen_to_fingers(self, beside: tuple[Callable[[], Any], ...] = ()) -> list[Any]:
        """What the cameras say of each finger. beside: further calls, made where a core is free meanwhile; what they
        return."""
        calls, done = finger_calls(self.session, self.unread), []
        for reading in Background(_made, [(call,) for call in (*calls, *beside)]).results():
            if not isinstance(reading, FingerReading):
                done.append(reading)
                continue
            self.step()
            for line in reading.lines:
                self.tell(line)
            self.stations += reading.stations
            self.found += reading.found
            self.unexplained += reading.unexplained
            self.notes += reading.notes
            if reading.angles is not None:
                self.fingers[reading.finger] = reading.angles
            if reading.courses is not None:
                self.courses[reading.finger] = reading.courses
        return done

    def drives(self, simulated: dict[str, SimulatedDrive]) -> dict[str, tuple[DriveState, ...]]:
        """The drives' balances while they carry their fingers, encoders put right; those whose current is no
        measurement are refused.

        Raises SessionError where a drive's signs contradict each other.
        """
        session = self.session
        drives = {
            a: with_gravity(session, self.fingers, states)
            for a, states in drive_states(session, _encoder_corrections(self.stations), self.unread, simulated).items()
        }
        for station in (s for s in self.stations if s.believed and s.actuator in drives):
            for term in (f.term for f in station.kept if f.term.effect.name == "spring_decoupling"):
                states = drives[station.actuator]
                drives[station.actuator] = (
                    while_driven(states, term.shape["below"])
                    if term.shape["form"] > 0.5
                    else without_excursions(states, station.naming.balance.states, self.fingers[station.finger])
                )
        for actuator in [a for a, states in drives.items() if not is_measured(states)]:
            self.found.append(
                refused(actuator, _finger_of(session, actuator), tuple(s.trial for s in drives.pop(actuator)))
            )
        for actuator in (a for a, states in drives.items() if opposes(states)):
            raise SessionError(
                f'{session.path}: actuator "{actuator}": friction would drive the motion; `position` must increase with flexion and '
                "positive `current` drive flexion, and one of them has the other sign"
            )
        return drives

    def listen_to_drives(self, drives: dict[str, tuple[DriveState, ...]], late: dict[str, bool]) -> None:
        """What the motors' currents say. late: whether each drive's current may be."""
        alone = {a: Balance(states).fit() for a, states in drives.items()}
        calls = []
        for actuator, states in drives.items():
            effects = [*(e for e in catalogue("drive") if not e.warps or late[actuator]), *outsiders("drive")]
            typical = typical_coefficients([fit for a, fit in alone.items() if a != actuator])
            calls.append(("current", _finger_of(self.session, actuator), actuator, None, states, effects, typical))
        for station in Background(judged, calls).results():
            self.step()
            self.stations.append(station)
            self.tell(station.line())
        self.stations, odd = with_weights(self.session, self.fingers, self.stations, calls)
        for _, finding in odd:
            self.tell(finding.statement)
        self.found = _without_settled_sags([*self.found, *odd], self.stations)


def _without_settled_sags(
    found: list[tuple[float, Finding]], stations: Sequence[Station]
) -> list[tuple[float, Finding]]:
    """Without losses of speed of drives whose current settles the matter: a reading that clips says little of the load
    on which such a sag is judged, one that the current shows, too, is named there, with a law to write, and friction
    that plainly grows with the load is a reason for a soft controller to fall behind."""
    settled = {
        s.actuator
        for s in stations
        if s.believed
        for which, f in ((s.naming.fit.terms.index(f.term), f) for f in s.kept)
        if f.term.effect.clips
        or f.term.effect.name == "drive_sag"
        or f.term.effect.name == "load_dependent_friction"
        and magnitude("load_dependent_friction", _values(s.parameters[which])) > REASON
    }
    return [i for i in found if i[1].effect != "drive_sag" or i[1].where["actuator"] not in settled]


def _values(parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    return {name: entry["value"] for name, entry in parameters.items()}


def _timed(
    drives: dict[str, tuple[DriveState, ...]], facts: dict[str, CommandFacts], simulated: dict[str, SimulatedDrive]
) -> tuple[dict[str, tuple[DriveState, ...]], dict[str, bool]]:
    """The drives with what is known of their current's lateness, and whether each may be late."""
    timed = with_lateness(drives, facts, simulated)
    late = _delays_apart(drives, timed)
    in_time = [a for a in drives if not late[a]]
    if 0 < len(in_time) < len(drives):  # at a reversal a late current looks like a give, an early one like none
        timed = with_lateness(with_gives(drives, in_time), facts, simulated)
    return timed, late


def _no_measurement(logs: list[Log]) -> str:
    """Why the position of a drive's logs is no measurement, "" where it is one."""
    if echoes_command(logs):
        return "it is at every new setpoint at once"
    if rests_on_command(logs):
        return "it rests on every setpoint to the count"
    return "" if any(moves(log.column("position")) for log in logs) else "it never moves"


def _distrusted(session: Session) -> dict[str, Stamps]:
    """Actuators whose logs' time stamps do not belong to their rows: no dynamics can be read from them."""
    judged = {a: stamps([t.log() for t in trials]) for a, trials in drive_trials(session).items()}
    return {a: s for a, s in judged.items() if s is not None and not s.believed}


def _false_stamps(session: Session, actuator: str, judged: Stamps) -> dict[str, Any]:
    where = {"finger": _finger_of(session, actuator), "joint": None, "actuator": actuator, "signal": "log"}
    return {
        "where": where,
        "share_of_mismatch": 1.0,
        "shape": f"the rows' time stamps do not follow the motion (off by some {1e3 * judged.wrong_s:.0f} ms, as if given in "
        "packets): speed, current and encoder against time were not judged",
    }


def _counts_corrected(session: Session, stations: list[Station]) -> dict[str, Callable[[Any], Any]]:
    """Actuator -> correction of its encoder's counts."""
    from .locate.angles import ranges_of_counts

    def of(correct: Callable[[Any], Any], low: float, high: float) -> Callable[[Any], Any]:
        return lambda counts: low + (high - low) * correct(100 * (counts - low) / (high - low)) / 100

    counts = ranges_of_counts(session)
    return {a: of(correct, *counts[a]) for a, correct in _encoder_corrections(stations).items()}


def _written(results: tuple[Any, ...], what: str) -> Any:
    """What of a diagnosis goes into folders of its own."""
    if what == "model":
        return _modelled(*results)
    findings, session, _, stations, _, output, _ = results
    return write_corrected(session, findings.findings, _counts_corrected(session, stations), output)


def _made(call: Callable[[], Any]) -> Any:
    return call()


def _identified(session: Session) -> Hand | HandModelError:
    """The session's own hand, or why it has none."""
    from ..identify import identify

    try:
        return identify(session, compared=False)
    except HandModelError as error:
        return error


def _modelled(
    findings: Findings,
    session: Session,
    hand: Hand | HandModelError,
    stations: list[Station],
    courses: dict[str, FingerCourses],
    output: Path,
    tell: Callable[[str], None],
) -> tuple[Findings, tuple[Replay, ...]]:
    """The findings with the model that holds them written, and its replays."""
    from .locate.angles import ranges_of_counts

    if not any(f.correction is None for f in findings.findings):
        return findings, ()
    try:
        if isinstance(hand, HandModelError):
            raise hand
        tell(f"writing {output / 'model'}")
        named, replays = write_improved(hand, findings.findings, stations, ranges_of_counts(session), output, courses)
    except HandModelError as error:
        return replace(findings, notes=(*findings.notes, f"no model was written: {error}")), ()
    return replace(findings, findings=named), replays


def _encoder_corrections(stations: list[Station]) -> dict[str, Callable[[Any], Any]]:
    """Actuator -> correction of its position [%] for a periodic encoder error: the recording is put right before
    physics."""
    out: dict[str, Callable[[Any], Any]] = {}
    for station in stations:
        for named in station.naming.found:
            if named.term.effect.name == "encoder_periodic_error" and station.believed and station.actuator is not None:
                slope = float(np.median(np.concatenate([s.slope for s in station.naming.balance.states])))
                before = out.get(station.actuator)
                out[station.actuator] = _periodic(
                    named.term.shape["period"],
                    named.amplitudes["sine"] / slope,
                    named.amplitudes["cosine"] / slope,
                    before,
                )
    return out


def _periodic(period: float, sine: float, cosine: float, further: Callable[[Any], Any] | None) -> Callable[[Any], Any]:
    def correct(position: Any) -> Any:
        phase = 2 * np.pi * position / period
        base = position if further is None else further(position)
        return base + sine * np.sin(phase) + cosine * np.cos(phase)

    return correct


def _delays_apart(
    drives: dict[str, tuple[DriveState, ...]], timed: dict[str, tuple[DriveState, ...]]
) -> dict[str, bool]:
    """Whether each drive's current may be delayed: a delay that all drives of a session share is how the log is read.
    Answers to commands tell a late or an early current better than the balance does, and must bear it out. timed: the
    drives with what these answers tell, which says nothing yet to the balance."""
    best: dict[str, float] = {}
    for actuator, states in drives.items():
        balance = Balance(states)
        delay = next(e for e in catalogue("drive") if e.warps)
        fit = scan(balance, delay, ())
        polished = None if fit is None else polish(balance, fit, 0)
        told = polished is not None and gain(balance, polished, balance.fit()) > DELAY_TOLD
        best[actuator] = polished.terms[0].shape["delay"] if told else 0.0
    step = {a: float(np.median(np.diff(s[0].time_s))) for a, s in drives.items()}
    # a lone drive cannot tell how the log is read from what its own channel does: twice as much is asked of it
    common, least = (min(best.values(), key=abs), 0.75) if len(best) > 1 else (0.0, 2.0)
    late = {a: s[0].extra["late"] for a, s in timed.items() if "late" in s[0].extra}

    def borne_out(actuator: str) -> bool:
        x, bound = best[actuator] - common, least * step[actuator]
        if actuator not in late:
            return abs(x) > bound
        if (told_to := least_delay(timed[actuator])) < bound:
            told = float(late[actuator][0])  # and to the side to which the balance would shift it
            return abs(told) > told_to and told * best[actuator] >= 0
        if late[actuator][0] < -max(bound, EARLY * late[actuator][1]):
            return True
        if x >= -bound:
            return float(late[actuator][0]) > bound
        others = [float(np.sum(value)) for a, value in late.items() if a != actuator]
        return not others or max(others) - late[actuator][0] > bound  # who is early answers before the others

    return {a: borne_out(a) for a in best}


def _command(session: Session, drives: dict[str, tuple[DriveState, ...]]) -> dict[str, CommandFacts]:
    facts = {}
    for actuator, trials in drive_trials(session).items():
        logs = {t.name: t.log() for t in trials}
        states = drives.get(actuator, ())
        currents = tuple(_current_at(s.time_s, logs[s.trial]) for s in states)
        if states:
            facts[actuator] = command_facts(states, currents)
    return facts


def _current_at(time_s: Any, log: Log) -> Any:
    """Current (n,) at times (n,), lost samples bridged."""
    seen = np.isfinite(log.column("current"))
    return np.interp(time_s, log.time_s[seen], log.column("current")[seen]) if seen.any() else np.zeros(len(time_s))


def _finger_of(session: Session, actuator: str) -> str | None:
    return next((f.name for f in session.fingers if f.actuator == actuator), None)
