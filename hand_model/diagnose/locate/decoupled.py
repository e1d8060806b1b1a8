"""Whiles in which a finger has left its drive: what the motor's current shows then is no property of the drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...effects.base import DriveState, position_range
from ...effects.spring_decoupling import behind, spans
from ...errors import IdentificationError
from ...identify.clock import align
from ..magnitude import SLIGHT, channel_figures, magnitude
from ..name.balance import Balance
from ..name.evidence import gain, parameter_price, scale_of
from ..name.station import Station, told
from .angles import FingerAngles
from .excursions import whiles_below

Array = NDArray[np.float64]

BESIDE, MOST_S = 0.4, 1.0  # of an excursion's length, at most, on either side: it is seen from where it stands out
# of the size at which a finger's lead is plain: less leaves nearly all of the spring on its drive, and most of the range
# is worth more
TRIFLE = 0.12
LOOSE, RELEASED = 0.3, "released_spring"  # [%] that a finger is behind when its spring is off its drive
CORNER = 0.2  # of the way on which the finger stays behind, beyond its end


def pulls(station: Station, least: float = SLIGHT) -> bool:
    """Whether a finger is pulled off its drive, by at least that share of the size at which this is plain."""
    named = station.standing("spring_decoupling")
    if named is None:
        return False
    return magnitude("spring_decoupling", told(station, named), channel_figures(station.naming.balance.states)) >= least


def while_driven(states: Sequence[DriveState], below: float) -> tuple[DriveState, ...]:
    """A drive's states without the current where the finger does not follow it open, below that position [%] or a
    little beyond: the spring is not on it there, and no corner is sharp."""
    low, _ = position_range(tuple(states))
    driven_from = below + CORNER * max(below - low, 0.0)
    return tuple(replace(s, effort=np.where(s.position < driven_from, np.nan, s.effort)) for s in states)


def while_returning(states: Sequence[DriveState], lag_s: float) -> tuple[DriveState, ...]:
    """A drive's states where its finger comes open later than it: some of the spring may be off it while the finger is
    behind, and whatever share that is, is no property of the drive's friction. As they are where their current shows no
    such share."""
    held, loose = tuple(states), tuple(_loosened(s, lag_s) for s in states)
    balance, loosened = Balance(held), Balance(loose)
    fit, price = loosened.fit(), 0.5 * parameter_price(balance) / balance.inflation
    return loose if gain(balance, fit, balance.fit(), scale_of(loosened, fit)) > price else held


def _loosened(state: DriveState, lag_s: float) -> DriveState:
    """With a column for the share of the spring [%] that a finger that is behind takes off its drive."""
    loose = np.clip(behind(state, lag_s) / LOOSE, 0.0, 1.0) * state.position
    declared = np.column_stack([state.declared, loose])
    return replace(state, declared=declared, declared_names=(*state.declared_names, RELEASED))


def beside_excursions(states: Sequence[DriveState], ahead: Sequence[DriveState]) -> tuple[DriveState, ...]:
    """A linkage's states without whiles in which the joint before ran `ahead` of its drive (states of the encoder's
    balance): something held the finger then, and how the joint moved is told by no more than its markers."""
    found = {s.trial: spans(s) for s in ahead}
    return tuple(_without(s, found.get(s.trial, [])) for s in states)


def _during(time_s: Array, whiles: Sequence[Sequence[float]]) -> NDArray[np.bool_]:
    """Samples (n,) within or right beside one of the whiles [s]."""
    close = [np.abs(time_s - 0.5 * (a + b)) <= 0.5 * (b - a) + min(BESIDE * (b - a), MOST_S) for a, b in whiles]
    return np.any(close, axis=0) if close else np.zeros(len(time_s), bool)


def without_excursions(
    states: Sequence[DriveState], ahead: Sequence[DriveState], angles: FingerAngles
) -> tuple[DriveState, ...]:
    """A drive's states without the current of whiles in which the finger was ahead of it: it carried no spring then.

    ahead: states of the encoder's balance, with excursions. angles: of the finger; by them the clocks are aligned. What
    pushes a finger does so where no marker looks on, too: there the whiles are those in which the current lies low.
    """
    found = {s.trial: s for s in ahead if np.any(s.extra.get("ahead", np.zeros(1)) > 0)}
    records = {r.trial.name: r for r in angles.records}
    out = []
    for state in states:
        if state.trial in found and state.trial in records:
            record, flexed = records[state.trial], records[state.trial].angle_rad[:, 0]
            good = np.isfinite(flexed)
            try:
                clock = align(record.mocap.time_s[good], flexed[good], state.time_s, state.position, state.trial)
            except (
                IdentificationError
            ):  # seen only once its markers were put right: the whiles have no place in the log
                out.append(state)
                continue
            state = _without(state, [clock.log_time(np.array(span)) for span in spans(found[state.trial])])
        out.append(state)
    unseen = whiles_below(out, {s.trial for s in out if s.trial not in records})
    return tuple(_without(s, unseen.get(s.trial, [])) for s in out)


def _without(state: DriveState, whiles: Sequence[Sequence[float]]) -> DriveState:
    """A recording without the effort of whiles [s], and right beside them."""
    return replace(state, effort=np.where(_during(state.time_s, whiles), np.nan, state.effort))
