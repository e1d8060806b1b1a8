"""Marker station: labels that were exchanged for a while -> a finding."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...identify.chain import propagate
from ...identify.likelihood import OUTLIER_LIMIT
from ..findings import Finding, weighed
from .angles import FingerAngles

CORRECTION = "the labels are put right while they were exchanged"
SWAP_FRAMES = 5  # shorter exchanges are ghosts


def swaps(angles: FingerAngles) -> list[tuple[float, Finding]]:
    """One finding of all labels of a finger that were exchanged, with its weight; none where none were."""
    whiles = {
        labels: found
        for labels in {frozenset(s.labels) for r in angles.records for s in r.swaps}
        if (found := _exchanged(angles, labels))
    }
    if not whiles:
        return []
    lasting = {labels: sum(end - begin for _, begin, end in found) for labels, found in whiles.items()}
    order = sorted(whiles, key=lambda names: (-lasting[names], sorted(names)))
    labels = order[0]
    joint = next((s.name for s in angles.finger.segments if labels & set(s.markers)), None)
    _, begin, end = max(whiles[labels], key=lambda w: w[2] - w[1])
    names, trials = sorted(labels), sorted({trial for trial, _, _ in whiles[labels]})
    where = {
        "finger": angles.finger.name,
        "joint": joint,
        "actuator": None,
        "signal": "markers",
        "marker": names[0],
        "markers": names,
        "trials": trials,
        "region": {"time": [begin, end], "unit": "s"},
        "share_of_mismatch": 1.0,
    }
    parameters = {
        name: {"value": value, "unit": "s"}
        for name, value in (("begin", begin), ("end", end), ("lasting", sum(lasting.values())))
    }
    fit = {
        "metric": "marker_rmse",
        "unit": "m",
        **_proof(angles, frozenset().union(*whiles), trials),
        "noise_floor": angles.noise_m,
        "ci95_reduction": None,
        "held_out": [],
        "engine": "chain fitted to the markers, in-sample",
    }
    text = "; ".join(f"{' and '.join(sorted(pair))} are exchanged {_spans(whiles[pair])}" for pair in order) + "."
    weight = _displaced(angles, names, sum(lasting.values()))
    return [
        (
            weight,
            Finding("marker_swap", ("marker_swap",), 1.0, (), where, text, parameters, fit, None, CORRECTION),
        )
    ]


def _exchanged(angles: FingerAngles, labels: frozenset[str]) -> list[tuple[str, float, float]]:
    """Recording, begin and end [s, of that recording] of each while in which `labels` are exchanged; pieces of one
    while, between which they are hardly seen, are one. None where labels come and go all the time: that is a marker's
    noise that reaches its neighbour."""
    out, flickers = [], 0
    for record in angles.records:
        seen = np.isfinite(
            record.data.position_world[:, [record.data.labels.index(name) for name in sorted(labels)], 0]
        ).all(1)
        pieces = [s for s in record.swaps if frozenset(s.labels) == labels]
        lasting = [s for s in pieces if s.stop - s.start + 1 >= SWAP_FRAMES]
        flickers += len(pieces) - len(lasting)
        joined: list[tuple[int, int]] = []
        for piece in lasting:
            apart = not joined or seen[joined[-1][1] + 1 : piece.start].sum() >= SWAP_FRAMES
            joined = [*joined, (piece.start, piece.stop)] if apart else [*joined[:-1], (joined[-1][0], piece.stop)]
        out += [(record.trial.name, float(record.mocap.time_s[a]), float(record.mocap.time_s[b])) for a, b in joined]
    return out if len(out) > flickers else []


def _spans(whiles: Sequence[tuple[str, float, float]], most: int = 3) -> str:
    spans = [f"from {begin:.1f} to {end:.1f} s of {trial}" for trial, begin, end in whiles[:most]]
    return ", ".join(spans) + (f" and {len(whiles) - most} times more" if len(whiles) > most else "")


def _displaced(angles: FingerAngles, labels: list[str], lasting_s: float) -> float:
    """Weight of an exchange of labels, as a robust likelihood sees it: a wrong label is no more than an outlier,
    however far away the right one is, and tells nothing."""
    share = min(lasting_s / sum(float(np.ptp(r.mocap.time_s)) for r in angles.records), 1.0)
    lost = share * len(labels) / len(angles.records[0].data.labels)  # of all readings
    size = OUTLIER_LIMIT * np.sqrt(lost / 3)
    return weighed(float(size), float(size / max(lost, 1e-9)))


def _proof(angles: FingerAngles, labels: frozenset[str], trials: Sequence[str]) -> dict[str, float]:
    """Error per coordinate [m] of markers from the places that the chain gives them, with labels as recorded and as put
    right, over whole recordings."""
    before, after = [], []
    for record in (r for r in angles.records if r.trial.name in trials):
        sound = np.isfinite(record.angle_rad[:, 0])
        mine = [record.data.labels.index(label) for label in sorted(labels)]
        expected = propagate(angles.chain, record.data.body, record.pose.angle_rad)[0]
        for errors, seen in ((before, record.mocap.markers(record.data.labels)), (after, record.data.position_world)):
            errors.append((record.pose.to_palm(seen) - expected)[sound][:, mine])
    return {
        name: float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2)))
        for name, errors in (("before", before), ("after", after))
    }
