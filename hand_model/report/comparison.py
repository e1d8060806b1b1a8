"""The thesis's three checks as tables (4.9 to 4.11) and sentences, for a page and for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..checks import JointRow, mirror, parallelism, repeatability
from ..hand import Hand
from .page import Cell, Section, note, page, table
from .words import count, number

COLUMNS = (
    "finger",
    "joint",
    "angle",
    "noise alone",
    "95 % interval",
    "thesis",
    "distance",
    "noise alone",
    "95 % interval",
)


def angle_cells(row: JointRow) -> list[str | Cell]:
    """Angle, what noise alone gives, interval, the thesis's figure [deg]."""
    low, high = np.rad2deg(row.angle.ci95)
    value = number(np.rad2deg(row.angle.value))
    return [
        Cell(f"{value} (arc too short)", "flag") if row.degenerate else Cell(value, "best" if row.angle.real else ""),
        number(np.rad2deg(row.angle.noise)),
        f"{number(low)} to {number(high)}",
        Cell(number(row.published_deg), "dim"),
    ]


def distance_cells(row: JointRow) -> list[str | Cell]:
    """Distance of the centres, what noise alone gives, interval [mm]."""
    if row.distance is None:
        return []
    low, high = 1e3 * row.distance.ci95[0], 1e3 * row.distance.ci95[1]
    value = number(1e3 * row.distance.value)
    return [
        Cell(value, "best" if row.distance.real else ""),
        number(1e3 * row.distance.noise),
        f"{number(low)} to {number(high)}",
    ]


def angle_words(rows: Sequence[JointRow], agree: str) -> str:
    """`9 of 12 pairs of axes are parallel within their uncertainty; median angle 0.8 deg, largest 3.1 deg (index);
    thesis ...`.
    """
    same = sum(not row.angle.real for row in rows)
    worst = max(rows, key=lambda row: row.angle.value)
    middle = np.rad2deg(np.median([row.angle.value for row in rows]))
    words = f"{same} of {count(len(rows), 'pair')} of axes {agree}; median angle {number(middle)} deg, largest "
    words += f"{number(np.rad2deg(worst.angle.value))} deg ({worst.finger} {worst.joint})"
    known = [row.published_deg for row in rows if row.published_deg is not None]
    return words + (
        f"; thesis: median {number(float(np.median(known)))} deg, largest {number(max(known))} deg." if known else "."
    )


THUMBS = "Thesis: table 4.11, its two thumb rows exchanged, as they belong to each other's axes in tables 4.1 and 4.2."


@dataclass(frozen=True)
class Check:
    """One of the three checks. words: its sentence. meaning: what is compared. caption: of its table."""

    name: str
    title: str
    words: str
    meaning: str
    caption: str
    rows: tuple[JointRow, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """Headings of the table."""
        return COLUMNS if self.rows[0].distance else COLUMNS[:6]

    def cells(self) -> list[list[str | Cell]]:
        """Rows of the table."""
        return [[r.finger, r.joint, *angle_cells(r), *distance_cells(r)] for r in self.rows]


def checks(a: Hand, b: Hand) -> tuple[Check, ...]:
    """Repeatability (same side) or mirror relation (both sides) of two hands, then the parallelism of each."""
    if a.side == b.side:
        rows, number_, agree = repeatability(a, b), "4.9", "repeat within their uncertainty"
        name, title = "repeatability", "Repeatability between two sessions"
        meaning = "Thesis: two captures of its left hand."
    else:
        rows, number_, agree = mirror(a, b), "4.10", "are mirror images within their uncertainty"
        name, title = "mirror", "Left hand, reflected, against the right"
        meaning = "Reflected across the palm's x-z plane. Thesis: its two hands, from tables 4.1 and 4.2."
    far = [row.distance for row in rows if row.distance is not None]
    words = (
        angle_words(rows, agree)
        + f" {sum(not d.real for d in far)} of {count(len(far), 'centre')} agree within their uncertainty; "
    )
    words += (
        f"median distance {number(1e3 * float(np.median([d.value for d in far])))} mm, largest "
        f"{number(1e3 * max(d.value for d in far))} mm."
    )
    caption = f"Degrees and millimetres, in the form of table {number_}; bold: more than the uncertainty explains"
    found = [Check(name, title, words, meaning, caption, rows)]
    for hand, label in ((a, "first"), (b, "second")):
        rows = parallelism(hand)
        if rows:
            title = f"Parallelism, {label} hand ({hand.name}, {hand.side})"
            words = angle_words(rows, "are parallel within their uncertainty")
            meaning = (
                "Angle between the axes of one finger; the palm frame's own uncertainty, shared by both, is left out. "
                + THUMBS
            )
            found.append(
                Check(f"parallelism-{label}", title, words, meaning, "Degrees, in the form of table 4.11", rows)
            )
    return tuple(found)


def comparison_page(a: Hand, b: Hand) -> bytes:
    """The checks as a page."""
    sections = [
        Section(c.name, c.title, c.words, (table(c.columns, c.cells(), c.caption, text_columns=2), note(c.meaning)))
        for c in checks(a, b)
    ]
    return page(
        f"{a.name} ({a.side}) and {b.name} ({b.side})",
        "The thesis's checks of identified hands, each with its uncertainty.",
        (),
        sections,
    )


def comparison_text(a: Hand, b: Hand) -> str:
    """The checks for a terminal."""
    from .text import columns

    return "\n\n".join(f"{c.title}\n{c.words}\n\n{columns(c.columns, c.cells(), 2)}" for c in checks(a, b))
