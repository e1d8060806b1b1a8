"""Whiles in which a label sits on something else: a reflection takes a marker's name, and gives it back.

A marker that slips stays where it slipped to; one that comes back was another. Told by the distances between the
markers of one segment, which nothing that moves a segment changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label, uniform_filter1d

from ...identify.chain import ChainData

Array = NDArray[np.float64]

FRAMES = 15  # over which a distance is averaged
LIMIT, LEAST_M = 8.0, 5e-4  # standard deviations of such a mean from the usual distance, and at least
LONGEST_S = 6.0  # of a while: what lasts longer is no ghost
# before and after a while, from half a second to two, it is within half of that limit
NEAR_S, FAR_S, USUAL = 0.5, 2.0, 0.5
ABRUPT = 0.4  # of the largest departure is there, and gone, from one mean to the next: a label jumps


def ghosts(data: ChainData, time_s: Array) -> NDArray[np.bool_]:
    """Frames (n,) of a recording in which a distance within one segment has left its usual value and comes back to
    it."""
    out = np.zeros(len(time_s), bool)
    for first in range(len(data.body)):
        for second in range(first + 1, len(data.body)):
            if data.body[first] == data.body[second]:
                out |= _excursions(
                    np.linalg.norm(data.position_world[:, first] - data.position_world[:, second], axis=1), time_s
                )
    return out


def _excursions(distance: Array, time_s: Array) -> NDArray[np.bool_]:
    seen = np.isfinite(distance)
    if seen.sum() < 4 * FRAMES:
        return np.zeros(len(distance), bool)
    usual = float(np.median(distance[seen]))
    noise = float(np.median(np.abs(np.diff(distance[seen])))) / (0.6745 * np.sqrt(2))
    share = uniform_filter1d(seen.astype(float), FRAMES, mode="nearest")
    mean = uniform_filter1d(np.where(seen, distance - usual, 0.0), FRAMES, mode="nearest") / np.maximum(share, 0.3)
    away = np.abs(mean) / max(LIMIT * noise / np.sqrt(FRAMES), LEAST_M)
    runs, count = label((away > 1) & (share > 0.3))
    out = np.zeros(len(distance), bool)
    for here in (np.flatnonzero(runs == run) for run in range(1, count + 1)):
        begin, end = time_s[here[0]], time_s[here[-1]]
        aside = [
            away[slice(*np.searchsorted(time_s, span))]
            for span in ((begin - FAR_S, begin - NEAR_S), (end + NEAR_S, end + FAR_S))
        ]
        returns = all(len(a) and np.median(a) < USUAL for a in aside)
        jumps = min(_jump(distance, here[0]), _jump(distance, here[-1] + 1)) > ABRUPT * float(
            np.max(np.abs(mean[here]))
        )
        out[here] = returns and jumps and end - begin < LONGEST_S
    return binary_dilation(out, iterations=FRAMES // 2)


def _jump(distance: Array, at: int) -> float:
    """Change of the mean distance [m] from just before a frame to just after it, zero where either is not seen."""
    sides = [part[np.isfinite(part)] for part in (distance[max(at - FRAMES, 0) : at], distance[at : at + FRAMES])]
    return abs(float(sides[0].mean() - sides[1].mean())) if all(map(len, sides)) else 0.0
