"""What a session has said so far: its fingers first, then its commands, then its drives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..background import Background
from ..effects import catalogue, outsiders
from ..effects.base import DriveState
from ..effects.spring_decoupling import comes_late, tips_over
from ..errors import SessionError
from ..session import Log, Session, check_session, moves
from .findings import Finding
from .finger import FingerReading, finger_calls
from .locate.angles import FingerAngles
from .locate.command import CommandFacts, command_facts, command_findings, delays, refused, sags_beneath
from .locate.course import FingerCourses
from .locate.decoupled import TRIFLE, pulls, while_driven, while_returning, without_excursions
from .locate.drive import dead_in, drive_states, drive_trials, frozen_share, opposes, stand_still, too_short
from .locate.encoder_error import encoder_corrections
from .locate.encoder_step import coarse, encoder_step
from .locate.gravity import with_gravity
from .locate.late_current import current_in_time
from .locate.markers import MarkerNaming
from .locate.measurement import beyond, dead_zone, echoes_command, is_measured, rests_on_command
from .locate.simulated import SimulatedDrive
from .magnitude import magnitude
from .name.balance import Balance
from .name.evidence import typical_coefficients
from .name.judgement import judged
from .name.station import Station, bring_together, told
from .weight import with_weights

REASON = 0.5  # of the size at which friction by load is plain: a soft controller falls behind by so much
WRONG_STAMPS = 0.1  # of the step between rows, by which times may be wrong: a speed is by a fiftieth then
LEFT_OUT = "those readings were left out"
FROZEN = 0.02  # of the time in motion: a current that stands still for more is no slip of a bus


class Heard:
    """What a session has said so far. found: findings with their weight. tell: called with a line per result; step:
    with nothing, after each."""

    def __init__(self, session: Session, tell: Callable[[str], None], step: Callable[[], None]) -> None:
        self.session, self.tell, self.step = session, tell, step
        self.notes = [*check_session(session, dead=True), *too_short(session)]
        self.fingers: dict[str, FingerAngles] = {}
        self.courses: dict[str, FingerCourses] = {}
        self.markers: dict[str, MarkerNaming] = {}
        self.stations: list[Station] = []
        distrusted, driven = _distrusted(session), drive_trials(session)
        steps = coarse({a: encoder_step([t.log() for t in trials]) for a, trials in driven.items()})
        self.unexplained = [
            *(_false_stamps(session, a, s) for a, s in distrusted.items()),
            *(_in_steps(session, a, s) for a, s in steps.items()),
        ]
        unmeasured = {a: why for a, trials in driven.items() if (why := _no_measurement([t.log() for t in trials]))}
        self.found: list[tuple[float, Finding]] = [
            refused(a, _finger_of(session, a), tuple(t.name for t in driven[a]), "position", why)
            for a, why in unmeasured.items()
        ]
        self.unread = (*distrusted, *steps, *unmeasured)  # actuators whose log is not believed

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
            if reading.markers is not None:
                self.markers[reading.finger] = reading.markers
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
            for a, states in drive_states(session, encoder_corrections(self.stations), self.unread, simulated).items()
        }
        self.notes += [note for states in drives.values() for note in stand_still(states)]
        for a, states in drives.items():
            share = frozen_share(states)
            if dead := dead_in(states):
                self.found.append(refused(a, _finger_of(session, a), dead, why=f"it {_still(share)}", fate=LEFT_OUT))
            elif share > FROZEN:
                self.unexplained.append(_unheard(session, a, "current", f"the current {_still(share)}: {LEFT_OUT}"))
        zones = {a: zone for a, states in drives.items() if (zone := dead_zone(states)) > 0}
        self.unexplained += [_dead(session, a, zone) for a, zone in zones.items()]
        drives = {a: beyond(states, zones[a]) if a in zones else states for a, states in drives.items()}
        drives = {a: states for a, states in drives.items() if states}
        for station in (s for s in self.stations if s.actuator in drives):
            named, states = station.standing("spring_decoupling"), drives[station.actuator]
            if named is not None and named.term.shape["form"] < 0.5:
                states = without_excursions(states, station.naming.balance.states, self.fingers[station.finger])
            elif named is not None and comes_late(named.term.shape):
                states = while_returning(states, named.term.shape["lag"])
            elif named is not None and not tips_over(named.term.shape) and pulls(station, TRIFLE):
                states = while_driven(states, named.term.shape["below"])
            drives[station.actuator] = states
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

    def listen_to_commands(
        self, drives: Mapping[str, tuple[DriveState, ...]], simulated: Mapping[str, SimulatedDrive]
    ) -> dict[str, CommandFacts]:
        """What the drives did of what they were told."""
        facts = _command(self.session, drives)
        self.found += command_findings(facts, self._fingers(facts), simulated)
        for _, finding in self.found:
            self.tell(finding.statement)
        return facts

    def listen_to_drives(
        self, drives: dict[str, tuple[DriveState, ...]], late: dict[str, bool], facts: Mapping[str, CommandFacts]
    ) -> None:
        """What the motors' currents say. late: whether each drive's current may be; facts: of their commands."""
        alone = {a: Balance(states).fit() for a, states in drives.items()}
        calls = []
        for actuator, states in drives.items():
            kinds = (*(e for e in catalogue("drive") if not e.warps or late[actuator]), *outsiders("drive"))
            effects = [e.among(states) for e in kinds]
            typical = typical_coefficients([fit for a, fit in alone.items() if a != actuator])
            calls.append(("current", _finger_of(self.session, actuator), actuator, None, states, effects, typical))
        for station in Background(judged, calls).results():
            self.step()
            self.stations.append(station)
            self.tell(station.line())
        self.stations, odd = with_weights(self.session, self.fingers, self.stations, calls)
        for _, finding in odd:
            self.tell(finding.statement)
        bring_together(self.stations)
        self.found = _without_settled_sags([*self.found, *odd], self.stations, facts)
        self._put_delays_right(facts)

    def _fingers(self, actuators: Iterable[str]) -> dict[str, str | None]:
        """Actuator -> its finger."""
        return {a: _finger_of(self.session, a) for a in actuators}

    def _put_delays_right(self, facts: Mapping[str, CommandFacts]) -> None:
        """How late a drive is was told by its current: not by as much, where that itself is late; and by as much, where
        that was thought to be late and is not."""
        channel_s = {
            s.actuator: float(told(s, f)["delay"])
            for s in self.stations
            if s.actuator in facts and (f := s.standing("current_channel_delay")) is not None
        }
        in_time = {
            s.actuator
            for s in self.stations
            if s.signal == "current"
            and s.actuator in facts
            and s.actuator not in channel_s
            and current_in_time(s.naming.balance, s.naming.fit)
        }
        if channel_s or in_time:
            late = delays(facts, self._fingers(facts), channel_s, in_time)
            self.found = [i for i in self.found if i[1].effect != "command_delay"] + late


def _without_settled_sags(
    found: list[tuple[float, Finding]], stations: Sequence[Station], facts: Mapping[str, CommandFacts]
) -> list[tuple[float, Finding]]:
    """Without losses of speed of drives whose current settles the matter: a reading that clips says little of the load
    on which such a sag is judged (it stands where strokes that stay below show it), one that the current shows, too, is
    named there, with a law to write, and friction that plainly grows with the load is a reason for a soft controller to
    fall behind."""
    settled = {
        s.actuator
        for s in stations
        if s.believed
        for f in s.kept
        if f.term.effect.clips
        and not sags_beneath(facts, s.actuator, f.term.shape["limit"])
        or f.term.effect.name == "drive_sag"
        or f.term.effect.name == "load_dependent_friction"
        and magnitude("load_dependent_friction", told(s, f)) > REASON
    }
    return [i for i in found if i[1].effect != "drive_sag" or i[1].where["actuator"] not in settled]


def _no_measurement(logs: list[Log]) -> str:
    """Why the position of a drive's logs is no measurement, "" where it is one."""
    if echoes_command(logs):
        return "it is at every new setpoint at once"
    if rests_on_command(logs):
        return "it rests on every setpoint to the count"
    return "" if any(moves(log.column("position")) for log in logs) else "it never moves"


def _distrusted(session: Session) -> dict[str, float]:
    """Actuators the times of whose rows are wrong by so much of a step [s], even where they were evened, that no
    dynamics can be read from them."""
    wrong = {}
    for actuator, trials in drive_trials(session).items():
        logs = [t.log() for t in trials]
        left = float(np.median([log.stamps_wrong_s for log in logs]))
        if left > WRONG_STAMPS * float(np.median([np.median(np.diff(log.time_s)) for log in logs])):
            wrong[actuator] = left
    return wrong


def _false_stamps(session: Session, actuator: str, wrong_s: float) -> dict[str, Any]:
    shape = (
        f"the rows' time stamps do not follow the motion (off by some {1e3 * wrong_s:.2g} ms even where they are evened): "
        "speed, current and encoder against time were not judged"
    )
    return _unheard(session, actuator, "log", shape)


def _in_steps(session: Session, actuator: str, step: float) -> dict[str, Any]:
    shape = (
        f"the encoder reads in steps of {100 * step:.1f} % of its range, while another of this hand reads finely: speed, "
        "current and encoder were not judged"
    )
    return _unheard(session, actuator, "position", shape)


def _still(share: float) -> str:
    return f"stands still while the motor moves, {100 * share:.0f} % of the time"


def _dead(session: Session, actuator: str, zone: float) -> dict[str, Any]:
    shape = f"the current reads zero below {zone:.0f} raw: {LEFT_OUT}"
    return _unheard(session, actuator, "current", shape)


def _unheard(session: Session, actuator: str, signal: str, shape: str) -> dict[str, Any]:
    """A channel of a drive that is not believed, or not all of it, as an entry of what is unexplained."""
    where = {"finger": _finger_of(session, actuator), "joint": None, "actuator": actuator, "signal": signal}
    return {"where": where, "share_of_mismatch": 1.0, "shape": shape}


def _made(call: Callable[[], Any]) -> Any:
    return call()


def _command(session: Session, drives: Mapping[str, tuple[DriveState, ...]]) -> dict[str, CommandFacts]:
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
