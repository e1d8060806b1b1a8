"""A weight on a hand that never turns: its drive's preload is odd and its spring bent, and a weight explains both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..session import Session
from .locate.angles import FingerAngles
from .locate.gravity import in_one_pose
from .locate.preload import preload_findings
from .name.naming import Named
from .name.selection import EVIDENCE_LEAST
from .name.station import Station, judged

BENT, WEIGHT = "nonlinear_spring", "gravity_load"


def with_weights(
    session: Session, fingers: Mapping[str, FingerAngles], stations: Sequence[Station], calls: Sequence[tuple[Any, ...]]
) -> list[Station]:
    """The stations, those of drives on which a weight pulls judged anew.

    calls: what `judged` was given for each drive's current. Two effects in one drive must together be likelier than the
    one that explains both by as much as any further effect must bring.
    """
    out = list(stations)
    for actuator in [f.where["actuator"] for _, f in preload_findings(stations)]:
        at = next(i for i, s in enumerate(out) if s.signal == "current" and s.actuator == actuator)
        bent = _kept(out[at], BENT)
        signal, finger, _, joint, states, effects, typical = next(c for c in calls if c[2] == actuator)
        states = in_one_pose(session, fingers, states) if bent is not None else None
        if bent is None or states is None:
            continue
        left = [e for e in effects if e.name != BENT]
        other = judged(signal, finger, actuator, joint, states, left, typical)
        weight = _kept(other, WEIGHT)
        changed = [*out[:at], other, *out[at + 1 :]]
        odd = {f.where["actuator"] for _, f in preload_findings(changed)}
        if weight is not None and weight.evidence > bent.evidence - EVIDENCE_LEAST and actuator not in odd:
            out = changed
    return out


def _kept(station: Station, name: str) -> Named | None:
    return next((f for f in station.kept if f.term.effect.name == name), None) if station.believed else None
