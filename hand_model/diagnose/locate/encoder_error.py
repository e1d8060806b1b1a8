"""Encoder error: positions and counts put right for the periodic errors that were named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...session import Session
from ..name.station import Station
from .angles import ranges_of_counts


def counts_corrected(session: Session, stations: Sequence[Station]) -> dict[str, Callable[[Any], Any]]:
    """Actuator -> correction of its encoder's counts."""

    def of(correct: Callable[[Any], Any], low: float, high: float) -> Callable[[Any], Any]:
        return lambda counts: low + (high - low) * correct(100 * (counts - low) / (high - low)) / 100

    counts = ranges_of_counts(session)
    return {a: of(correct, *counts[a]) for a, correct in encoder_corrections(stations).items()}


def encoder_corrections(stations: Sequence[Station]) -> dict[str, Callable[[Any], Any]]:
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
