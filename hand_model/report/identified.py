"""Sections about what was identified: axes and centres, encoder maps, linkages, repairs. From the hand alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import frame_covariance, joint_covariance, parallelism
from ..hand import EncoderMap, Finger, Hand, Joint
from ..published import mapping_rmse_deg
from .comparison import THUMBS, angle_cells, angle_words
from .page import Cell, Element, Section, folded, heading, listing, note, table
from .words import count, listed, number, span

Array = NDArray[np.float64]

ORDER = {1: "linear", 2: "quadratic", 3: "cubic", 4: "quartic"}


def axis_sd_deg(hand: Hand, joint: Joint) -> float:
    """Standard deviation of the axis in its worst direction [deg], the palm frame taken as known."""
    return float(np.rad2deg(worst_sd(joint_covariance(hand, joint)[:3, :3])))


def centre_sd_mm(hand: Hand, joint: Joint) -> float:
    """Standard deviation of the centre in its worst direction [mm], the palm frame taken as known."""
    return 1e3 * worst_sd(joint_covariance(hand, joint)[3:, 3:])


def worst_sd(covariance: Array) -> float:
    """Standard deviation in the worst direction."""
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))


def frame_words(hand: Hand) -> str:
    """What the landmarks leave open about the palm frame itself; empty where that is not known."""
    covariance = frame_covariance(hand)
    if not covariance.any():
        return ""
    turn, shift = np.rad2deg(worst_sd(covariance[:3, :3])), 1e3 * worst_sd(covariance[3:, 3:])
    return (
        f"the palm frame itself, from the probed landmarks, is uncertain by {number(turn)} deg and {number(shift)} mm"
    )


def axes_section(hand: Hand) -> Section:
    """Axes and centres with their uncertainty, the published method beside them."""
    joints = [(finger, joint) for finger in hand.fingers for joint in finger.joints]
    published = {(f, j): row for f, rows in hand.extra.get("published_method", {}).items() for j, row in rows.items()}
    rows = [_axis_row(hand, finger, joint, published.get((finger.name, joint.name), {})) for finger, joint in joints]
    columns = ["finger", "joint", "x", "y", "z", "± deg", "x", "y", "z", "± mm", "deg", "deg", "mm", "deg"]
    groups = [("", 2), ("axis", 4), ("centre [mm]", 4), ("arc", 1), ("published off by", 2), ("dominant axis off", 1)]
    body = [table(columns, rows, groups=groups, text_columns=2)]
    body.append(
        note(
            "Palm frame of the landmarks; ± is one standard deviation in the worst direction, "
            "the palm frame taken as known. Published method: axis by Gamage & Lasenby (2002), "
            "centre by Chang & Pollard (2007); dominant axis: Chang & Pollard's planar and radial cost; "
            "all on the same markers, as their distance from the maximum-likelihood chain (for the centre, "
            "across the axis)."
        )
    )
    parallel = parallelism(hand)
    if parallel:
        body.append(heading("Are the axes of a finger parallel?"))
        body.append(note(angle_words(parallel, "are parallel within their uncertainty")))
        columns = ["finger", "joints", "angle", "noise alone", "95 % interval", "thesis"]
        body.append(
            table(
                columns,
                [[r.finger, r.joint, *angle_cells(r)] for r in parallel],
                text_columns=2,
                caption="Degrees, in the form of table 4.11",
            )
        )
        if any(r.published_deg for r in parallel):
            body.append(note(THUMBS))
    return Section("axes", "Axes and centres", _axes_words(hand, joints, published), tuple(body))


def _axis_row(hand: Hand, finger: Finger, joint: Joint, old: Mapping[str, Any]) -> list[str | Cell]:
    sd = number(axis_sd_deg(hand, joint))
    cells: list[str | Cell] = [finger.name, joint.name, *(number(v, 4) for v in joint.axis_palm)]
    cells.append(Cell(f"{sd} not determined", "flag") if joint.degenerate else sd)
    cells += [number(1e3 * v) for v in joint.centre_palm] + [number(centre_sd_mm(hand, joint))]
    cells.append(number(old.get("arc_deg", np.rad2deg(np.ptp(joint.range_rad))), 0))
    if "failed" in old:
        return [*cells, Cell("fails", "flag"), Cell("–", "dim"), Cell("–", "dim")]
    off = old.get("centre_off_m")
    return [
        *cells,
        Cell(number(old.get("axis_off_deg")), "dim"),
        Cell(number(None if off is None else 1e3 * off), "dim"),
        Cell(number(old.get("dominant_axis_off_deg")), "dim"),
    ]


def _axes_words(
    hand: Hand, joints: list[tuple[Finger, Joint]], published: Mapping[tuple[str, str], Mapping[str, Any]]
) -> str:
    weak = [f"{f.name} {j.name}" for f, j in joints if j.degenerate]
    known = [j for _, j in joints if not j.degenerate]
    parts: list[str] = []
    if known:
        which = (
            f"{len(known)} of the {len(joints)} axes"
            if weak
            else f"All {len(joints)} axes"
            if joints[1:]
            else "The axis"
        )
        angle = number(max(axis_sd_deg(hand, j) for j in known))
        apart = {f"{f.name} {j.name}": centre_sd_mm(hand, j) for f, j in joints if not j.degenerate}
        worst = max(apart, key=lambda name: apart[name])
        verb = "is" if which == "The axis" else "are"
        parts.append(f"{which} {verb} known to {angle} deg or better within the palm (one standard deviation)")
        middle = number(float(np.median(list(apart.values()))))
        parts.append(f"centres to {middle} mm (median), {number(apart[worst])} mm at worst ({worst})")
    if weak:
        verb = "does not determine its axis" if len(weak) == 1 else "do not determine their axes"
        parts.append(f"the recorded {'arc' if len(weak) == 1 else 'arcs'} of {listed(weak)} {verb}")
    parts += filter(None, [frame_words(hand)])
    off = {k: row for k, row in published.items() if "axis_off_deg" in row}
    if off:
        worst = max(off, key=lambda k: off[k]["axis_off_deg"])
        far = number(1e3 * max(row["centre_off_m"] for row in off.values()), 1)
        parts.append(
            f"on the same markers the published method lands up to {number(off[worst]['axis_off_deg'], 1)} deg "
            f"({' '.join(worst)}, an arc of {number(off[worst]['arc_deg'], 0)} deg) and {far} mm away"
        )
    words = "; ".join(parts)
    return words[:1].upper() + words[1:] + "."


def maps_section(hand: Hand, pictures: tuple[Any, ...] = ()) -> Section | None:
    """RMSE of encoder counts to angle in the form of tables 4.5 to 4.8, the thesis's figures beside; None without a
    log.
    """
    fingers = [f for f in hand.fingers if f.encoder_maps]
    if not fingers:
        return None
    body = list(pictures)
    words = []
    for place in dict.fromkeys(j.name for f in fingers for j in f.joints):
        maps = [(f.name, m) for f in fingers for j, m in zip(f.joints, f.encoder_maps, strict=True) if j.name == place]
        body.append(_rmse_table(hand.side, place, maps))
        known = [r for name, _ in maps if (r := mapping_rmse_deg(hand.side, place, name))]
        beside = f" (thesis, cubic, fitted data: {span([r[2] for r in known])} deg)" if known else ""
        values = [chosen_deg(m.rmse_held_out_rad, m.coefficients) for _, m in maps]
        words.append(f"{place} angle within {span(values)} deg{beside}")
    body.append(
        note(
            "Fitted: on the cycles that it was fitted to, as the thesis reports it. Held out: on cycles left out in "
            "turn; "
            "it chooses the order (bold). Thesis: tables 4.5 to 4.8, another specimen in another laboratory."
        )
    )
    words = f"Encoder counts alone give the {listed(words)}: root mean square on held-out cycles, order chosen there."
    return Section("maps", "Encoder to angles", words, tuple(body))


def _rmse_table(side: str, place: str, maps: list[tuple[str, EncoderMap]]) -> Element:
    """One of the tables 4.5 to 4.8: rows fingers, columns orders; the thesis's figures where it has any."""
    orders = sorted({int(order) for _, m in maps for order in m.rmse_rad})
    theirs = {name: mapping_rmse_deg(side, place, name) for name, _ in maps}
    heads = ["fitted", "held out"] + ["thesis"] * any(theirs.values())
    rows = []
    for name, fitted in maps:
        row: list[str | Cell] = [name]
        for order in orders:
            kind = "best" if order == len(fitted.coefficients) - 1 else ""
            for errors in (fitted.rmse_rad, fitted.rmse_held_out_rad):
                row.append(Cell(number(np.rad2deg(errors.get(str(order), np.nan)), 3), kind))
            if "thesis" in heads:
                known = theirs[name] or ()
                row.append(Cell(number(known[order - 1] if 0 < order <= len(known) else None, 3), "dim"))
        rows.append(row)
    groups = [("", 1), *[(ORDER.get(order, f"order {order}"), len(heads)) for order in orders]]
    return table(["finger", *heads * len(orders)], rows, f"RMSE of encoder to {place} angle [deg]", groups)


def chosen_deg(errors_rad: Mapping[str, float], coefficients: Any) -> float:
    """RMSE [deg] of the order that was chosen; nan where it is not known."""
    return float(np.rad2deg(errors_rad.get(str(len(coefficients) - 1), np.nan)))


def coupling_section(hand: Hand) -> Section | None:
    """Linkages: polynomial, order, error; None where no finger has any."""
    links = [(f, c) for f in hand.fingers for c in f.couplings]
    if not links:
        return None
    rows: list[list[str | Cell]] = []
    bends = []
    for finger, c in links:
        low, high = next(j.range_rad for j in finger.joints if j.name == c.driver)
        driver = np.linspace(low, high, 200)
        angle = np.rad2deg(c.follower_rad(driver))
        bends.append(np.abs(angle - np.polyval(np.polyfit(driver, angle, 1), driver)).max())
        order = len(c.coefficients) - 1
        rows.append(
            [
                finger.name,
                f"{c.follower} of {c.driver}",
                ORDER.get(order, str(order)),
                _polynomial(c.coefficients),
                f"{number(angle[0], 1)} to {number(angle[-1], 1)}",
                number(bends[-1]),
                number(chosen_deg(c.rmse_rad, c.coefficients), 3),
                Cell(number(chosen_deg(c.rmse_held_out_rad, c.coefficients), 3), "best"),
            ]
        )
    held = [v for _, c in links if np.isfinite(v := chosen_deg(c.rmse_held_out_rad, c.coefficients))]
    follows = (
        f" follows the driven joint within {span(held)} deg on held-out cycles" if held else " moves each driven joint"
    )
    conclusion = (
        f"One polynomial per linkage, monotonic over the recorded range,{follows}; a straight line, all that a URDF's "
        f"mimic can say, would be off by up to {number(max(bends), 1)} deg."
    )
    columns = [
        "finger",
        "linkage",
        "order",
        "follower [rad] of driver q [rad]",
        "range [deg]",
        "bend [deg]",
        "fitted [deg]",
        "held out [deg]",
    ]
    return Section("linkages", "Linkages", conclusion, (table(columns, rows, text_columns=4),))


def _polynomial(coefficients: Any) -> str:
    text = ""
    for power, value in enumerate(coefficients):
        sign = "−" if value < 0 else "+" if text else ""
        unit = "" if power == 0 else " q" if power == 1 else f" q{'²³⁴⁵'[power - 2]}"
        text += f" {sign} {abs(value):.4f}{unit}" if text else f"{sign}{abs(value):.4f}{unit}"
    return text


def repairs_section(hand: Hand) -> Section:
    """What was put right in the recordings before anything was fitted, and what a user should know."""
    items = []
    for r in hand.extra.get("repairs", []):
        markers = listed(r["markers"])
        if r["kind"] == "swap":
            items.append(
                f"{r['trial']}: {markers} carried each other's label from {r['from_s']:.2f} to {r['to_s']:.2f} s; "
                "put right."
            )
        else:
            items.append(
                f"{r['trial']}: {markers} moved by {1e3 * r['shift_m']:.2f} mm on its segment at {r['at_s']:.2f} s; "
                "two epochs fitted."
            )
    swaps = sum(r["kind"] == "swap" for r in hand.extra.get("repairs", []))
    slips = len(items) - swaps
    if items:
        conclusion = (
            f"{count(swaps, 'exchange')} of labels and {count(slips, 'slipped marker')} were found in the "
            "recordings and corrected; the files are untouched."
        )
    else:
        conclusion = "No exchanged label and no slipped marker was found in the recordings that were fitted."
    body = [listing(items)] if items else []
    if hand.notes:
        body += [heading("Notes"), listing(hand.notes)]
    hashes = [f"{file}  {sha}" for file, sha in hand.provenance.items()]
    body.append(
        folded(f"SHA-256 of the {count(len(hashes), 'file')} that the hand was identified from", listing(hashes))
    )
    return Section("repairs", "Repairs and origin", conclusion, tuple(body))
