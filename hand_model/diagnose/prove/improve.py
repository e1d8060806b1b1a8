"""The improved model: the hand as declared and with its named effects, both compiled; what the files' replay proves."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from ...effects import effect
from ...effects.base import DriveState
from ...errors import HandFileError
from ...hand import Coupling, Effect, EncoderMap, Estimate, Finger, Hand, Joint, Motor, load_hand
from ...session import Session
from ..findings import UNWRITTEN, Finding
from ..locate.course import FingerCourses
from ..locate.markers import HINGE
from ..weight import PULL
from .markers import COMPILED, marker_fit, of_folder
from .replays import Replay, errors_along, proved, untouched
from .write_course import with_chains, written_courses

MOTOR = {
    "inertia": ("inertia", "raw s^2/%"),
    "viscous": ("viscous", "raw s/%"),
    "coulomb": ("coulomb", "raw"),
    "spring": ("stiffness", "raw/%"),
    "preload": ("preload", "raw"),
}
# [raw, %]: a preload needs a spring; bristles without inertia cannot be simulated
LEAST = {"stiffness": 1e-6, "inertia": 2e-3}
OTHER_MARKERS = "the model's palm markers are not this session's, or elsewhere: nothing tells where its joints are"
REACHED = 200  # places over a driver's range
DRIVE_KEPT = ("gain", "damping")  # of an identified motor, beside what the balance fits


def read_model(model: Any) -> Hand:
    """A Hand from itself, a .hand file, or a compiled folder; raises HandFileError for anything else."""
    return model if isinstance(model, Hand) else load_hand(model)


def refuse_other(hand: Hand, session: Session) -> None:
    """Raise HandFileError where a hand is not the session's: of the other side, or without any of its fingers."""
    if hand.side != session.side:
        raise HandFileError(
            f"the model is a {hand.side} hand, and the session's is a {session.side} one; a model of this hand is needed"
        )
    fingers = [f.name for f in session.fingers]
    if not {f.name for f in hand.fingers} & set(fingers):
        raise HandFileError(
            f"the model has none of the session's fingers ({', '.join(fingers)}); a model of this hand is needed"
        )


def as_fitted(
    hand: Hand, stations: Sequence[Any], counts: Mapping[str, tuple[float, float]], fit: Callable[[Any], Any]
) -> Hand:
    """The hand with the coefficients of a fit of each station: motors, encoder maps, couplings.

    stations: those to take over. counts: actuator -> counts at 0 and 100 %. fit: of the naming or the reading of a
    station, the declared one or the one with effects.
    """
    motors = {m.actuator: m for m in hand.motors}
    fingers = {f.name: f for f in hand.fingers}
    for station in stations:
        declared = dict(fit(station.reading).declared)
        if station.signal == "current":
            declared["inertia"] = fit(station.naming).declared["inertia"]  # told by starts and stops alone
            motors[station.actuator] = _motor(
                station, declared, fit(station.reading).terms, counts[station.actuator], motors.get(station.actuator)
            )
        elif station.signal == "encoder":
            fingers[station.finger] = _with_map(fingers[station.finger], station, declared, counts[station.actuator])
        elif station.joint is not None:
            fingers[station.finger] = _with_coupling(fingers[station.finger], station, declared)
    return replace(hand, motors=tuple(motors.values()), fingers=tuple(fingers.values()))


def _motor(
    station: Any, declared: Mapping[str, float], terms: Sequence[Any], counts: tuple[float, float], was: Motor | None
) -> Motor:
    states = station.naming.balance.states
    declared = holding_weight(states, declared)
    values = {
        MOTOR[k][0]: Estimate(float(v), None, MOTOR[k][1], "diagnosis") for k, v in declared.items() if k in MOTOR
    }
    values |= {
        k: replace(values[k], value=least, origin="least that can be simulated")
        for k, least in LEAST.items()
        if values[k].value < least
    }
    if values["coulomb"].value > 0:
        # all friction acts through these bristles
        named = [t.shape["bristle_length"] for t in terms if t.effect.name == "presliding_friction"]
        give = named[0] if named else float(np.max(states[0].extra.get("give", np.zeros(1))))
        values["presliding"] = Estimate(
            give, None, "%", "diagnosis" if named else "diagnosis, common to the session's drives"
        )
    if was is not None:
        values |= {k: was.parameters[k] for k in DRIVE_KEPT if k in was.parameters}
    return Motor(station.actuator, *counts, values, station.naming.balance.sigma, tuple(s.trial for s in states))


def holding_weight(states: Sequence[DriveState], declared: Mapping[str, float]) -> Mapping[str, float]:
    """Declared coefficients whose preload and spring hold what a weight beside them pulls with in these recordings."""
    if PULL not in declared:
        return declared
    pull = np.concatenate([s.declared[:, s.declared_names.index(PULL)] for s in states])
    position = np.concatenate([s.position for s in states])
    seen = np.isfinite(pull) & np.isfinite(position)
    level, slope = declared[PULL] * Polynomial.fit(position[seen], pull[seen], 1).convert().coef
    return {**declared, "preload": declared["preload"] + level, "spring": declared["spring"] + slope}


def _with_map(finger: Finger, station: Any, declared: Mapping[str, float], counts: tuple[float, float]) -> Finger:
    """The encoder map of the proximal joint: proximal angle [deg] over the share of the range becomes radians. Its
    range holds what the map gives over the positions of the recordings, and so do those of the joints that follow."""
    coefficients = np.deg2rad([v for k, v in declared.items() if k.startswith("power_")])
    positions = np.concatenate([s.position[np.isfinite(s.position)] for s in station.naming.balance.states]) / 100
    angles = Polynomial(coefficients)(np.linspace(positions.min(), positions.max(), REACHED))
    finger = replace(
        finger,
        encoder_maps=(EncoderMap(*counts, coefficients, {}, {}), *finger.encoder_maps[1:]),
        joints=(_ranging(finger.joints[0], angles), *finger.joints[1:]),
    )
    return _following(finger)


def _following(finger: Finger) -> Finger:
    """The finger whose joints behind a coupling can go where their driver's range takes them."""
    joints = {j.name: j for j in finger.joints}
    for link in finger.couplings:
        driver_rad = np.linspace(*joints[link.driver].range_rad, REACHED)
        joints[link.follower] = _ranging(joints[link.follower], link.follower_rad(driver_rad))
    return replace(finger, joints=tuple(joints.values()))


def _ranging(joint: Joint, angle_rad: NDArray[np.float64]) -> Joint:
    """The joint whose range holds these angles too: a model may know more of it than this session."""
    low, high = joint.range_rad
    return replace(joint, range_rad=(min(low, float(angle_rad.min())), max(high, float(angle_rad.max()))))


def _with_coupling(finger: Finger, station: Any, declared: Mapping[str, float]) -> Finger:
    """The coupling of one joint: follower [deg] over powers of driver [deg] / scale becomes radians."""
    scale = float(station.naming.balance.states[0].extra["scale"][0])
    powers = [v for k, v in declared.items() if k.startswith("power_")]
    coefficients = Polynomial(np.deg2rad(powers))(Polynomial([0.0, np.rad2deg(1.0) / scale])).coef
    couplings = [
        c if c.follower != station.joint else Coupling(c.driver, c.follower, coefficients, {}, {})
        for c in finger.couplings
    ]
    return _following(replace(finger, couplings=tuple(couplings)))


def without_effects(hand: Hand, findings: Sequence[Finding]) -> Hand:
    """The hand without the effects that the findings name anew: its declared coefficients are fitted as if it had
    none."""
    named = {_seat(f.effect, f.where) for f in findings}
    return replace(hand, effects=tuple(e for e in hand.effects if _seat(e.effect, e.where) not in named))


def _seat(effect_name: str, where: Mapping[str, Any]) -> tuple[Any, ...]:
    return effect_name, *(where.get(key) for key in ("finger", "joint", "actuator"))


def with_effects(hand: Hand, findings: Sequence[Finding]) -> Hand:
    """The hand with the findings that are physics of its fingers."""
    physics = [f for f in findings if f.correction is None and f.where.get("finger") in {x.name for x in hand.fingers}]
    effects = tuple(
        Effect(f.effect, dict(f.where), {k: _estimate(v) for k, v in f.parameters.items() if np.isfinite(v["value"])})
        for f in physics
        if effect(f.effect).of_the_hand and f.held is None
    )
    return replace(hand, effects=(*hand.effects, *effects))


def _estimate(entry: Mapping[str, Any]) -> Estimate:
    ci = entry.get("ci95")
    return Estimate(
        float(entry["value"]), None if ci is None else (float(ci[0]), float(ci[1])), str(entry["unit"]), "diagnosis"
    )


def written(before: Path, after: Path, finding: Finding, fingers: Collection[str]) -> dict[str, Any]:
    """`model` of a finding, {"native", "mjcf", "urdf", "callback"}: where the files of the folder `before`, which hold
    no effect, get it, or where those of `after` have what comes from hand.json (a course). fingers: of the model, which
    may lack the finding's."""
    from lxml import etree

    if finding.where.get("finger") not in fingers:
        return {**UNWRITTEN, "callback": None, "note": absent(finding)}
    values = {k: v["value"] for k, v in finding.parameters.items()}
    kind = effect(finding.effect)
    urdf = "not expressible: kept in hand.json"
    if not kind.of_the_hand or finding.held is not None:
        note = finding.held or kind.unwritten
        return {"native": False, "mjcf": None, "urdf": "not expressible", "callback": None, "note": note}
    if kind.law(values) is not None:
        call = "hand_model.effects_on(model, folder)"
        return {"native": False, "mjcf": None, "urdf": urdf, "callback": call}
    folder = after if kind.station == "markers" else before
    for file in sorted(f for f in folder.glob("*.xml") if not f.name.startswith("scene")):
        place = kind.write_mjcf(etree.parse(str(file)).getroot(), finding.where, values)
        if place is not None:
            return {"native": True, "mjcf": place, "urdf": urdf, "callback": None}
    return {
        "native": False,
        "mjcf": None,
        "urdf": urdf,
        "callback": None,
        "note": kind.unwritten or "no element of MJCF holds it: kept in hand.json",
    }


def absent(finding: Finding) -> str:
    """What a model lacks that holds nothing of a finding."""
    return f"the model has no {finding.where.get('finger') or 'finger of it'}"


def write_improved(
    hand: Hand,
    findings: Sequence[Finding],
    stations: Sequence[Any],
    counts: Mapping[str, tuple[float, float]],
    output: Path,
    courses: Mapping[str, FingerCourses] | None = None,
) -> tuple[tuple[Finding, ...], tuple[Replay, ...]]:
    """Compile the hand as declared into `output`/model_before and with its effects into `output`/model; the findings,
    saying where each is written and what replaying the two says, and the replays. courses: finger -> those of its
    joints.

    Raises HandModelError where the hand cannot be compiled. Nothing is written where no finding is physics of the hand.
    """
    from ...compile import compile

    hand = without_effects(hand, findings)
    known = {f.name for f in hand.fingers}
    touched = [s for s in stations if s.finger in known and any(s.names(f) for f in findings if f.correction is None)]
    crooked = written_courses(hand, findings, courses or {})
    # other chains, other angles: what maps them is as this session has it, too
    maps = [s for s in stations if s.finger in crooked and s.signal != "current" and s not in touched]
    hand = as_fitted(hand, maps, counts, lambda source: source.declared)
    before = with_chains(as_fitted(hand, touched, counts, lambda source: source.declared), crooked, lambda c: c.plain)
    after = with_chains(as_fitted(hand, touched, counts, lambda source: source.fit), crooked, lambda c: c.coursed)
    after = with_effects(after, findings)
    if not any(f.correction is None for f in findings):
        return tuple(findings), ()
    compile(before, output / "model_before")
    compile(after, output / "model")
    named = [(f, next((s for s in stations if s.names(f)), None)) for f in findings]
    files = output / "model_before", output / "model"
    errors = errors_along([(s, untouched(f, s)) for f, s in named if f.correction is None], *files)
    fits = {
        name: marker_fit(c, *(of_folder(f, name, c.labels) for f in files), COMPILED) for name, c in crooked.items()
    }
    out, replays = [], []
    for finding, station in named:
        if finding.correction is None:
            finding = replace(finding, model=written(*files, finding, known))
            fit, replay = proved(finding, station, errors)
            if finding.effect in HINGE:
                note = OTHER_MARKERS if finding.where["finger"] in known else absent(finding)
                fit = fits.get(finding.where["finger"], {**finding.fit, "note": note})
            finding = replace(finding, fit=fit)
            replays += [] if replay is None else [replace(replay, finding=finding)]
        out.append(finding)
    return tuple(out), tuple(replays)
