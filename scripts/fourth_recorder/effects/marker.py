"""Effects of markers. Lengths in mm, angles in rad, times as shares of a trial."""

from __future__ import annotations

from dataclasses import asdict

from ..hand import PALM_LABELS
from ..hidden import MarkerSlip, MarkerSwap, PalmSlip, SupportSlip
from .draw import Drawn, Site

SWAPPED = ((0, 1), (0, 2), (1, 2), (3, 4), (3, 5), (4, 5), (1, 3), (2, 4))  # of a finger's six


def scaled(direction: tuple[float, float, float], length: float) -> tuple[float, float, float]:
    """A vector of a length."""
    x, y, z = direction
    return x * length, y * length, z * length


def marker_slip(site: Site) -> Drawn:
    """A marker that shifts during each trial."""
    form = site.form
    segment, index = form.index("segment", 2), form.index("index", 3)
    direction = form.direction("direction")
    length = site.size * form.between("length", 1.0, 2.2)
    frame = form.keep("frame", lambda: "palm" if form.rng.random() < 0.5 else "segment")
    slip = MarkerSlip(segment, index, form.between("begin", 0.2, 0.7), scaled(direction, length), frame)
    label = site.finger.labels[3 * segment + index]
    return Drawn(markers={"slip": slip}, figures=asdict(slip), joint=segment, marker=label)


def support_slip(site: Site) -> Drawn:
    """A markers' support that turns on its segment during each trial."""
    form = site.form
    segment = form.index("segment", 2)
    axis = form.direction("axis")
    angle = site.size * form.sign("sign") * form.between("angle", 0.03, 0.08)
    slip = SupportSlip(segment, form.between("begin", 0.2, 0.7), axis, angle)
    return Drawn(markers={"support": slip}, figures=asdict(slip), joint=segment)


def palm_marker_slip(site: Site) -> Drawn:
    """A marker of the palm that shifts during each trial."""
    form = site.form
    index = form.index("index", 3)
    direction = form.direction("direction")
    length = site.size * form.between("length", 1.0, 2.5)
    slip = PalmSlip(index, form.between("begin", 0.2, 0.7), scaled(direction, length))
    return Drawn(markers={"palm": slip}, figures=asdict(slip), marker=PALM_LABELS[index])


def marker_swap(site: Site) -> Drawn:
    """Two markers of a finger that are taken for each other for a while."""
    form = site.form
    first, second = SWAPPED[form.index("pair", len(SWAPPED))]
    swap = MarkerSwap(first, second, form.between("begin", 0.15, 0.7), site.size * form.between("length", 0.04, 0.15))
    labels = site.finger.labels
    figures = {"markers": [labels[first], labels[second]], "begin": swap.begin, "length": swap.length}
    return Drawn(markers={"swap": swap}, figures=figures, marker=labels[first])
