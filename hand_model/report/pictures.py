"""The pictures of a replay, one small drawing each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..hand import Finger
from ..replay import TrialResiduals
from .style import INK, MUTED, PAPER, SERIES, drawing

Array = NDArray[np.float64]

# Points shown of a cloud; more say no more and make the page heavy.
POINTS = 350


def box_statistics(values: Array) -> dict[str, Any]:
    """Median, quartiles and whole range of values (n,), as matplotlib's `bxp` takes them."""
    q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
    return {"med": median, "q1": q1, "q3": q3, "whislo": values.min(), "whishi": values.max(), "fliers": []}


def boxes(
    groups: Mapping[str, Mapping[str, Array]], label: str, colours: Mapping[str, str], top: float | None = None
) -> bytes:
    """Box plots (median, quartiles, range): groups along the axis, one colour per series in each. colours: series ->
    colour.
    """
    with drawing() as d:
        names = list(groups)
        series = [s for s in colours if any(s in g for g in groups.values())]
        width = 0.78 / max(len(series), 1)
        for j, name in enumerate(series):
            shown = [(i, groups[g][name]) for i, g in enumerate(names) if name in groups[g] and len(groups[g][name])]
            if not shown:
                continue
            line = {"color": colours[name], "linewidth": 0.9}
            d.axes.bxp(
                [box_statistics(v) for _, v in shown],
                positions=[i + (j - (len(series) - 1) / 2) * width for i, _ in shown],
                widths=width * 0.72,
                showfliers=False,
                showcaps=False,
                patch_artist=True,
                boxprops={"facecolor": colours[name], "edgecolor": "none", "linewidth": 0},
                whiskerprops=line,
                medianprops={"color": PAPER, "linewidth": 1.4},
                manage_ticks=False,
            )
        d.axes.set_xticks(range(len(names)), names)
        d.axes.grid(axis="x", visible=False)
        d.axes.set_ylim(0, top)
        d.axes.set_ylabel(label)
    return d.svg


def encoder_map(finger: Finger, trials: Sequence[TrialResiduals]) -> bytes:
    """Angles that the markers show over encoder counts with the maps through them; below, what the maps leave."""
    with drawing(height=3.3, panels=(2.2, 1)) as d:
        top, below = d.panels
        for k, (joint, fitted) in enumerate(zip(finger.joints, finger.encoder_maps, strict=True)):
            colour = SERIES[k % len(SERIES)]
            counts, angle = _cloud(trials, k)
            span = np.linspace(*np.sort([fitted.counts_open, fitted.counts_close]), 80)
            top.plot(span, np.rad2deg(fitted.angle_rad(span)), color=colour, linewidth=0.8)
            top.plot(counts[::4], np.rad2deg(angle[::4]), "o", color=colour, markersize=2.6, markeredgewidth=0)
            at = 0.45 * (fitted.counts_close - fitted.counts_open) + fitted.counts_open
            place = {"ha": "right", "va": "bottom"} if k == 0 else {"ha": "left", "va": "top"}
            top.annotate(
                joint.name,
                (at, np.rad2deg(fitted.angle_rad(np.array([at]))[0])),
                (-5, 3) if k == 0 else (5, -3),
                textcoords="offset points",
                color=colour,
                **place,
            )
            below.plot(
                counts,
                np.rad2deg(angle - fitted.angle_rad(counts)),
                "o",
                color=colour,
                markersize=1.7,
                markeredgewidth=0,
                alpha=0.75,
            )
        below.axhline(0, color=MUTED, linewidth=0.7)
        below.set_xlabel("encoder [counts]")
        top.set_ylabel("angle [deg]")
        below.set_ylabel("left [deg]")
    return d.svg


def _cloud(trials: Sequence[TrialResiduals], joint: int) -> tuple[Array, Array]:
    counts = np.concatenate([t.counts for t in trials])
    angle = np.concatenate([t.angle_rad[:, joint] for t in trials])
    known = np.flatnonzero(np.isfinite(counts) & np.isfinite(angle))
    if len(known) == 0:
        return np.zeros(0), np.zeros(0)
    # Even along the range: the ends, where the finger rests, would hold most points otherwise.
    order = known[np.argsort(counts[known], kind="stable")]
    bins = np.linspace(counts[order[0]], counts[order[-1]], POINTS + 1)
    first = np.unique(np.clip(np.searchsorted(counts[order], bins), 0, len(order) - 1))
    return counts[order[first]], angle[order[first]]


def correlation(trials: Sequence[TrialResiduals], reach_s: float = 3.0) -> bytes:
    """Correlation of angle and encoder over the lag, about the offset found, one line per trial."""
    with drawing() as d:
        for i, trial in enumerate(t for t in trials if t.clock is not None):
            lag = trial.clock.lags_s - trial.clock.offset_s
            near = (np.abs(lag) <= reach_s) & (trial.clock.correlation > -1)
            keep = np.flatnonzero(near)[:: max(1, int(near.sum() / 200))]
            d.axes.plot(lag[keep], trial.clock.correlation[keep], color=SERIES[i % len(SERIES)], linewidth=0.9)
        d.axes.axvline(0, color=MUTED, linewidth=0.7, linestyle=(0, (3, 2)))
        d.axes.set_xlabel("lag less the offset found [s]")
        d.axes.set_ylabel("correlation")
    return d.svg


def overlay(finger: Finger, trial: TrialResiduals) -> bytes:
    """Proximal angle from the markers and from the aligned encoder over the fastest stretch of a trial."""
    with drawing() as d:
        through = finger.encoder_maps[0].angle_rad(trial.counts)
        window = _busiest(trial.time_s, through)
        t = trial.time_s[window]
        keep = slice(None, None, max(1, len(t) // POINTS))
        d.axes.plot(
            t[keep],
            np.rad2deg(trial.angle_rad[window, 0])[keep],
            ".",
            color=SERIES[0],
            markersize=3,
            markeredgewidth=0,
            label="markers",
        )
        d.axes.plot(t[keep], np.rad2deg(through[window])[keep], color=INK, linewidth=0.9, label="encoder, aligned")
        d.axes.set_xlabel("mocap time [s]")
        d.axes.set_ylabel(f"{finger.joints[0].name} angle [deg]")
    return d.svg


def _busiest(time_s: Array, value: Array, length_s: float = 4.0) -> slice:
    """The stretch of that length in which the value travels farthest."""
    step = float(np.median(np.diff(time_s)))
    n = min(len(value), max(2, round(length_s / step)))
    travel = np.concatenate([[0.0], np.cumsum(np.nan_to_num(np.abs(np.diff(value))))])
    start = int(np.argmax(travel[n - 1 :] - travel[: len(travel) - n + 1]))
    return slice(start, start + n)
