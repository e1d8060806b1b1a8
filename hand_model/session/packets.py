"""Rows that arrive in packets: several share one moment, which is when they arrived and not when they were read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TOGETHER = 0.1  # of the mean step between rows: rows that come so soon after each other came in one packet
OFTEN = 0.2  # share of the steps within packets, from which a log is stamped so
LONGEST = 1.5  # times the usual step: a packet after a pause was read shortly before it arrived


def spread_packets(time_s: Array) -> tuple[Array, float] | None:
    """Times (n,) at which rows were read, and how many came in a packet on average; None for a log that is not stamped
    in packets.

    time_s: (n,) [s], not decreasing. Rows are taken to be read at even intervals since the last packet arrived, the last
    one of each when it did.
    """
    steps = np.diff(time_s)
    if len(steps) < 2 or not (time_s[-1] > time_s[0]):
        return None
    inside = steps < TOGETHER * (time_s[-1] - time_s[0]) / len(steps)
    if inside.mean() < OFTEN:
        return None
    packet = np.r_[0, np.cumsum(~inside)]
    rows = np.bincount(packet)
    arrived = time_s[np.cumsum(rows) - 1]
    between = np.diff(arrived) / rows[1:]
    usual = float(np.median(between))
    step = np.r_[usual, np.where(between > LONGEST * usual, usual, between)]
    left = np.cumsum(rows)[packet] - 1 - np.arange(len(time_s))  # rows of the same packet that come after
    return arrived[packet] - left * step[packet], float(rows.mean())
