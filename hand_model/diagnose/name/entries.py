"""What a station says, as entries of the findings: names, what none explains, and the channel's row."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..findings import UNWRITTEN, Finding, weighed
from .interval import held_out
from .naming import Named
from .station import Station, told

# How before and after were computed, said in the findings: no compiled file is involved until one is replayed.
ENGINE = {
    "current": "inverse dynamics of the motor's balance, motion as recorded",
    "encoder": "encoder map, motion as recorded",
    "markers": "linkage polynomial, motion as recorded",
}


def finding_of(station: Station, named: Named, share: float, size: float) -> tuple[float, Finding]:
    """The finding of one effect, with its weight. size: over the noise of one reading."""
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
        "signal": effect.signal or station.signal,
        "marker": None,
        "trials": [s.trial for s in naming.balance.states],
        # of the figures that the statement tells
        "region": effect.region(naming.balance.states, station.reading.fit.terms[which].shape),
        "share_of_mismatch": share * station.claimed,
    }
    top = named.rivals[0].evidence
    weights = np.exp(np.array([r.evidence for r in named.rivals] + [0.0]) - max(top, 0.0))
    weights = weights / weights.sum()
    alternatives = tuple(
        (r.name, float(p))
        for r, p in zip(named.rivals, weights[:-1], strict=True)
        if r.name != effect.name and p > 1e-3 and r.fit.terms[-1].effect.listed
    )[:4]
    unit = naming.balance.states[0].effort_unit
    fit = {
        "metric": f"{station.signal}_rmse",
        "unit": unit,
        **held_out(station.reading, which),
        "engine": ENGINE[station.signal],
    }
    members = named.members if effect.name in named.members else (effect.name, *named.members)
    recording = getattr(effect, "correction", None)
    model = None if recording else dict(UNWRITTEN)
    return weighed(size, station.contrast), Finding(
        effect.name,
        members,
        named.probability,
        alternatives,
        where,
        effect.statement(where, values),
        parameters,
        fit,
        model,
        recording,
    )


def outsider_of(station: Station, named: Named) -> dict[str, Any]:
    """The unexplained entry of what no table of effects names, with what it looks like."""
    entry = unexplained_of(station, named.share * station.claimed)
    said = named.term.effect.statement(entry["where"], told(station, named)).removesuffix(".")
    return {**entry, "shape": f"no known effect, but {said}"}


def unexplained_of(station: Station, share: float) -> dict[str, Any]:
    """The entry of what no name explains, with what it varies with."""
    return {
        "where": {
            "finger": station.finger,
            "joint": station.joint,
            "actuator": station.actuator,
            "signal": station.signal,
        },
        "share_of_mismatch": share,
        "shape": f"varies with {station.naming.after.telling}",
    }


def unrepeated_of(station: Station) -> dict[str, Any]:
    """The entry of what changes from one while to the next at the same place, speed and direction."""
    wander = station.naming.wander
    length = 0.0 if wander is None else wander.length_s
    span = f"over whiles of {length:.1g} s" if np.isfinite(length) else "from stroke to stroke"
    entry = unexplained_of(station, station.wander**2 / (1 + station.wander**2))
    return {**entry, "shape": f"does not repeat: changes {span} by {station.wander:.1f} times the noise"}


def channel_of(station: Station, stands: bool) -> dict[str, Any]:
    """The channel's row of the findings. stands: whether its names do. effects: those that stand in it; p_before,
    p_after: of the lack-of-fit test; noise: in the unit of its effort."""
    n = station.naming
    return {
        "finger": station.finger,
        "joint": station.joint,
        "signal": station.signal,
        "p_before": n.before.p,
        "p_after": n.after.p,
        "varies_with": n.before.telling,
        "noise": n.balance.sigma,
        "effects": [f.term.effect.name for f in station.kept] if stands else [],
        "explained": station.explained,
    }
