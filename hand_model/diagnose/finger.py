"""What the cameras say of each finger: markers on rigid segments first, then encoder against segment, then segment
against segment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from ..effects import catalogue, outsiders
from ..effects.base import DriveState
from ..errors import IdentificationError
from ..session import Finger, Session
from ..session.check import on_a_line
from .findings import Finding
from .locate.angles import (
    FingerAngles,
    Step,
    encoder_states,
    expected_angles,
    finger_angles,
    linkage_states,
    ranges_of_counts,
)
from .locate.course import FingerCourses, finger_courses, follows
from .locate.decoupled import beside_excursions
from .locate.lasting_noise import camera_drift, long_means
from .locate.markers import HINGE, MarkerNaming, corrected_angles, name_markers, tilt
from .locate.slips import marker_findings, steps, with_steps
from .locate.slips import unexplained as unexplained_of
from .locate.turned import Turned, turned_finding, turned_support
from .name.interval import declared_sd
from .name.judgement import judged
from .name.station import Station
from .prove.markers import OWN, marker_fit, of_chain
from .unrelated import Regression, together


@dataclass(frozen=True)
class FingerReading:
    """One finger seen by the cameras. stations: encoder and linkages, in this order. found: of its markers, each with
    its weight.
    angles: None where nothing could be read, and notes say why. markers: what they tell. lines: for a progress display.
    courses: of joints that are no plain hinges."""

    finger: str
    angles: FingerAngles | None = None
    stations: tuple[Station, ...] = ()
    found: tuple[tuple[float, Finding], ...] = ()
    unexplained: tuple[dict[str, Any], ...] = ()
    notes: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()
    courses: FingerCourses | None = None
    markers: MarkerNaming | None = None


def finger_calls(session: Session, unread: tuple[str, ...] = ()) -> list[Callable[[], FingerReading]]:
    """What reads every finger of a session with flexion trials before cameras, one call each.

    unread: actuators whose counts are not believed.
    """
    from ..identify.identification import palm_shape

    if session.palm is None or not any(t.mocap_path for t in session.select("flexion")):
        return []
    try:
        shape = palm_shape(session)
    except IdentificationError as error:
        return [partial(FingerReading, "palm", notes=(str(error),))]
    counts = {a: c for a, c in ranges_of_counts(session).items() if a not in unread}
    drift = camera_drift(session)
    return [partial(_reading, session, finger, shape, counts, drift) for finger in session.fingers]


def _reading(
    session: Session, finger: Finger, shape: Any, counts: dict[str, tuple[float, float]], drift: float
) -> FingerReading:
    if _on_a_line(session, finger):  # `check_session` notes it
        return FingerReading(finger.name)
    try:
        seen = finger_angles(session, finger, shape)
    except IdentificationError as error:
        return FingerReading(finger.name, notes=(str(error),))
    try:
        return _judged(finger, seen, counts, drift)
    except IdentificationError as error:
        return FingerReading(finger.name, seen, notes=(str(error),))


def _on_a_line(session: Session, finger: Finger) -> bool:
    """Whether the markers of one of a finger's segments are, so that how the segment turns about it is not seen."""
    return any(
        on_a_line(trial.mocap().markers(segment.markers), hinged=True)
        for trial in session.select("flexion", finger.name)
        if trial.mocap_path is not None
        for segment in finger.segments
        if len(segment.markers) >= 3
    )


def _parted(encoder: Station | None) -> bool:
    """Whether the clocks of markers and log part, so that the log tells nothing of a follower."""
    return encoder is not None and any(f.term.effect.signal == "log" for f in encoder.outsiders)


def _follower(
    angles: FingerAngles, joint: int, moments: list[Step], encoder: Station | None, logged: bool
) -> tuple[tuple[DriveState, ...], Turned | None]:
    """Recordings of a joint's angle against that of the joint before it, and a support that turned there. encoder: the
    station of that joint, where it has one; logged: whether logs are believed."""
    expected = expected_angles(encoder.naming) if encoder is not None else {}
    driven = encoder.naming.balance.states if encoder is not None else ()
    states = linkage_states(angles, joint, moments, expected, logged)
    turned = turned_support(states, driven)
    if turned is not None:
        states = linkage_states(angles, joint, [*moments, *turned.steps], expected, logged)
    if states and encoder is not None and _leaves(encoder):
        states = beside_excursions(states, driven)
    return states, turned


def _regression(signal: str, finger: Finger, joint: int, states: tuple[DriveState, ...]) -> Regression:
    """A station of a finger's angles, judged among the effects of its kind."""
    kind = "encoder" if signal == "encoder" else "linkage"
    effects = [*catalogue(kind), *outsiders(kind)]

    def judge(told: tuple[DriveState, ...]) -> Station:
        return judged(signal, finger.name, finger.actuator, finger.segments[joint].name, told, effects)

    return Regression(judge(states), states, judge)


def _told(station: Station) -> dict[str, tuple[float, float]]:
    """Declared coefficients of a station's balance, each with its standard deviation."""
    fit = station.naming.fit
    sd = declared_sd(station.naming.balance, fit)
    return {name: (value, sd.get(name, 0.0)) for name, value in fit.declared.items()}


def _leaves(encoder: Station) -> bool:
    """Whether a finger is found to run ahead of its drive for a while."""
    named = encoder.standing("spring_decoupling")
    return named is not None and named.term.shape["form"] < 0.5


def _held_out(
    seen: FingerAngles, markers: MarkerNaming
) -> tuple[MarkerNaming, tuple[tuple[float, Finding], ...], FingerCourses | None]:
    """What markers tell, its findings, and courses of joints that are no plain hinges, with their fit; without the joints
    that follow a course where recordings kept out are no better with it."""
    found = tuple(marker_findings(seen, markers))
    courses = finger_courses(seen, markers, {(f.effect, f.where["joint"]) for _, f in found if f.effect in HINGE})
    if courses is None:
        return markers, found, None
    fit = marker_fit(courses, of_chain(courses.plain, courses.body), of_chain(courses.coursed, courses.body), OWN)
    # a weak one is sure by the recordings that it is learned from, and need not be by those kept out
    if fit["held_out"] and fit["after"] >= fit["before"]:
        left = replace(markers, found=tuple(e for e in markers.found if not follows(e)))
        return left, tuple(marker_findings(seen, left)), None
    names = [s.name for s in seen.finger.segments]
    coursed = {(e.effect, names[e.body - 1]) for e in markers.found if follows(e)}
    return (
        markers,
        tuple((w, replace(f, fit=fit) if (f.effect, f.where["joint"]) in coursed else f) for w, f in found),
        courses,
    )


def _judged(finger: Finger, seen: FingerAngles, counts: dict[str, tuple[float, float]], drift: float) -> FingerReading:
    markers, found, courses = _held_out(seen, name_markers(seen, drift))
    names = ", ".join(f.effect for _, f in found) or "consistent"
    lines = [f"{finger.name} markers: {names} (p {markers.p_before:.2g} -> {markers.p_after:.2g})"]
    angles, moments = corrected_angles(seen, markers), steps(markers)
    regressions: list[Regression] = []
    states = encoder_states(angles, *counts[finger.actuator], moments) if finger.actuator in counts else ()
    if states:
        regressions.append(_regression("encoder", finger, 0, states))
    encoder = regressions[0].station if regressions else None
    logged = finger.actuator in counts and not _parted(encoder)
    turns: list[tuple[float, Finding]] = []
    for joint in range(1, len(finger.segments)):
        states, turned = _follower(angles, joint, moments, encoder if joint == 1 else None, logged)
        if turned is not None:
            turns.append(turned_finding(turned, finger.name, finger.segments[joint].name))
        if states:
            regressions.append(_regression("markers", finger, joint, states))
    stations = [r.station for r in regressions]
    if encoder is not None and len(regressions) == 2:
        stations = list(together(*regressions, lambda driver: _follower(angles, 1, moments, driver, logged)[0]))
    tilt_deg = tilt(markers)
    for station in stations:
        station.tilt, station.swaying = tilt_deg, long_means(drift)
    lines += [s.line() for s in stations]
    found = with_steps(found, seen, markers, {s.joint: _told(s) for s in stations}) if moments else found
    return FingerReading(
        finger.name,
        seen,
        tuple(stations),
        (*found, *turns),
        tuple(unexplained_of(seen, markers)),
        (),
        tuple(lines),
        courses,
        markers,
    )
