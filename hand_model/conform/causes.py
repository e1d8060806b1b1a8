"""Layer 3: what each joint's difference is called."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .align import Alignment, align
from .coincidence import LEVER
from .features import Features, mirrored
from .joint_fit import Fit
from .pairing import Pairing
from .report import Finding
from .tree import Tree

ROUNDING_CAP = 1e-6
"""[m] A difference up to here passes where the files' own last digits explain it: six digits on a hand's length."""


def geometry_findings(
    a: Tree, b: Tree, given: Pairing, settled: Pairing, f: Features, at: Alignment, tolerance_m: float
) -> list[Finding]:
    """Name what differs in the lines, zeros and points. given: the pairing asked for; settled: after exchanges."""
    exchanged = _exchanged(a, b, given, settled)
    wrong = [k for k, fit in enumerate(at.fits) if not _passes(f, k, fit, tolerance_m)]
    rounded = _rounding(a, b, f, at, wrong)
    out = [*exchanged, *_order(a, b, f)]
    if rounded is not None:
        out.append(rounded[0])
        wrong = [k for k in wrong if k not in rounded[1]]
    for k in wrong:
        out += _joint_findings(a, b, f, k, at.fits[k], tolerance_m)
    for k, fit in enumerate(at.fits):
        if (
            k not in wrong
            and (rounded is None or k not in rounded[1])
            and not fit.seen
            and abs(fit.advance) > tolerance_m
        ):
            name = f.names[k][0]
            text = (
                f'the frame of the link beyond "{name}" sits {fit.advance * 1e3:.4g} mm along the axis: '
                "a convention or a displaced link, nothing farther out tells"
            )
            out.append(Finding("link_displaced", 2, (name,), text, {"along_mm": fit.advance * 1e3}, False))
    skipped = set() if rounded is None else rounded[1]
    out += _points(a, b, f, at, tolerance_m, skipped)
    return out + _written_short(f, at, wrong, skipped)


def mirror_finding(a: Tree, b: Tree, f: Features, at: Alignment) -> Finding | None:
    """A left hand against a right one: most axes lie elsewhere, and fall into place once b is reflected."""
    sizes = [_size(f, k, fit) for k, fit in enumerate(at.fits)]
    if 3 * sum(s > 1e-4 for s in sizes) < len(sizes):
        return None
    plain, reflected = _cost(f, at), _cost(f, align(mirrored(f)))
    if reflected > 0.5 * plain or plain - reflected < 20:
        return None
    text = f"{b.path.name} fits {a.path.name} only as its mirror image: one is a left hand, the other a right"
    return Finding("mirrored", 3, tuple(x for x, _ in f.names), text, {"unmirrored_mm": max(sizes) * 1e3})


def _cost(f: Features, at: Alignment) -> float:
    return float(sum(np.log1p((_size(f, k, fit) / 1e-6) ** 2) + 2 * (fit.sign < 0) for k, fit in enumerate(at.fits)))


def _size(f: Features, k: int, fit: Fit) -> float:
    """Difference of the two lines [m], angles weighed by LEVER."""
    return fit.shift + LEVER * fit.angle_rad


def _parts(f: Features, k: int, fit: Fit) -> dict[str, float]:
    """What differs, each as [m] at the farthest thing that the joint carries."""
    turn = fit.offset if not f.slide[k] else fit.offset / max(fit.reach, LEVER)
    return {
        "shift": fit.shift,
        "tilt": fit.angle_rad * fit.reach,
        "offset": abs(turn) * fit.reach,
        "advance": abs(fit.advance) if fit.seen else 0.0,
    }


def _bound(slack: np.ndarray, f: Features, k: int, reach: float) -> float:
    """[m] that the last written digits from the base to this joint may move its line and what it carries."""
    total, at = 0.0, k
    while at >= 0:
        arm = reach + float(np.linalg.norm(f.points_a[k] - f.points_a[at]))
        total += float(slack[at, 0] + slack[at, 1] * arm)
        at = f.parent[at]
    return total


def _passes(f: Features, k: int, fit: Fit, tolerance_m: float) -> bool:
    if fit.sign < 0:
        return False
    room = max(
        tolerance_m, min(ROUNDING_CAP, 2 * max(_bound(f.slack_a, f, k, fit.reach), _bound(f.slack_b, f, k, fit.reach)))
    )
    return max(_parts(f, k, fit).values()) <= room


def _rounding(a: Tree, b: Tree, f: Features, at: Alignment, wrong: Sequence[int]) -> tuple[Finding, set[int]] | None:
    """Differences that one file's last written digits account for, where they are too many to be a change by hand."""
    best: tuple[set[int], Tree, Tree, np.ndarray] | None = None
    for tree, other, slack in ((a, b, f.slack_a), (b, a, f.slack_b)):
        inside = {k for k in wrong if at.fits[k].sign > 0 and _within(f, k, at.fits[k], slack)}
        short = sum(_components(f, k, at.fits[k]) for k in inside)
        if inside and (len(inside) > 1 or short >= 4) and (best is None or len(inside) > len(best[0])):
            best = (inside, tree, other, slack)
    if best is None:
        return None
    inside, tree, other, slack = best
    names = tuple(f.names[k][0] for k in sorted(inside))
    moved = max(at.fits[k].shift for k in inside) * 1e3
    turned = float(np.degrees(max(max(at.fits[k].angle_rad, abs(at.fits[k].offset)) for k in inside)))
    place = max(float(slack[k, 0]) for k in inside) * 2 / np.sqrt(3) * 1e3
    text = (
        f"{tree.path.name} writes the numbers of {other.path.name} with fewer digits (to about {place:.2g} mm) at "
        f"{len(names)} joint(s), {', '.join(names)}: up to {moved:.3g} mm and {turned:.3g} deg"
    )
    return Finding(
        "numbers_rounded", 3, names, text, {"shift_mm": moved, "turn_deg": turned, "written_to_mm": place}
    ), inside


def _within(f: Features, k: int, fit: Fit, slack: np.ndarray) -> bool:
    parent = f.parent[k]
    before = slack[parent] if parent >= 0 else np.zeros(2)
    arm = float(np.linalg.norm(f.points_a[k] - (f.points_a[parent] if parent >= 0 else 0.0)))
    length = 1.05 * (slack[k, 0] + before[0] * (parent >= 0) + (slack[k, 1] + before[1]) * arm)
    turn = 1.05 * (slack[k, 1] + before[1])
    return (
        fit.shift <= length
        and fit.angle_rad <= turn
        and abs(fit.offset) <= 2 * turn + length / LEVER
        and abs(fit.advance) <= 2 * length
    )


def _components(f: Features, k: int, fit: Fit) -> int:
    """How many independent numbers of a joint differ: two across the axis, its two tilts, its zero, its place along."""
    across = np.abs(fit.gap) > 1e-8
    return int(min(across.sum(), 2)) + 2 * (fit.angle_rad > 1e-7) + (abs(fit.offset) > 1e-7) + (abs(fit.advance) > 1e-8)


def _joint_findings(a: Tree, b: Tree, f: Features, k: int, fit: Fit, tolerance_m: float) -> list[Finding]:
    name, partner = f.names[k]
    label = f'"{name}"' if name == partner else f'"{name}" (= "{partner}")'
    parts, out = _parts(f, k, fit), []
    if fit.sign < 0:
        mirrored_limits = ""
        la, lb = a.joint(name).limits, b.joint(partner).limits
        if la and lb:
            follow = np.allclose(la, (-lb[1], -lb[0]), atol=1e-5)
            mirrored_limits = "; the limits are turned over with it" if follow else "; the limits are not turned over"
        out.append(Finding("sign_flipped", 3, (name,), f"{label} turns the other way{mirrored_limits}", {"sign": -1.0}))
    if parts["shift"] > tolerance_m and parts["shift"] >= 0.2 * LEVER * fit.angle_rad:
        out.append(_shifted(a, b, f, k, fit, label))
    if parts["tilt"] > tolerance_m and LEVER * fit.angle_rad > 0.2 * parts["shift"]:
        angle = float(np.degrees(fit.angle_rad))
        text = f"the axis of {label} is tilted by {angle:.4g} deg" + (
            f" ({fit.angle_rad * fit.reach * 1e3:.3g} mm at its far end)"
        )
        out.append(Finding("axis_tilted", 3, (name,), text, {"angle_deg": angle, "shift_mm": fit.shift * 1e3}))
    small = 0.05 * (fit.angle_rad + fit.shift / LEVER)
    if parts["offset"] > tolerance_m and abs(fit.offset) > small:
        out.append(_offset(a, b, f, k, fit, label))
    if parts["advance"] > tolerance_m and abs(fit.advance) > 0.05 * fit.shift:
        text = f"what {label} carries sits {fit.advance * 1e3:+.4g} mm along its axis"
        out.append(Finding("link_displaced", 3, (name,), text, {"along_mm": fit.advance * 1e3}))
    return out


def _shifted(a: Tree, b: Tree, f: Features, k: int, fit: Fit, label: str) -> Finding:
    name, parent = f.names[k][0], f.parent[k]
    text = f"the axis of {label} is shifted by {fit.shift * 1e3:.4g} mm"
    figures = {"shift_mm": fit.shift * 1e3, "angle_deg": float(np.degrees(fit.angle_rad))}
    text += "; the links beyond move with it" if fit.follows else "; the links beyond stay in place"
    if fit.follows and parent >= 0:
        way = f.points_a[k] - f.points_a[parent]
        length = float(np.linalg.norm(way))
        if length > 1e-6:
            before = float(np.linalg.norm(way - fit.gap))
            figures |= {"length_a_mm": length * 1e3, "length_b_mm": before * 1e3}
            if abs(length - before) > 0.9 * fit.shift:
                text += f" (link length {before * 1e3:.4f} mm in {b.path.name}, {length * 1e3:.4f} mm in {a.path.name})"
    opposite = _opposite(a, b, f, k)
    return Finding("axis_shifted", 3, (name,), text + opposite, figures)


def _opposite(a: Tree, b: Tree, f: Features, k: int) -> str:
    """One coordinate of the two origins equal but for its sign: the commonest slip between a left and a right hand."""
    x, y = (t.nodes[t.joint_node[n]].origin[:3, 3] for t, n in ((a, f.names[k][0]), (b, f.names[k][1])))
    turned = [i for i in range(3) if abs(x[i] + y[i]) < 1e-9 and abs(x[i]) > 1e-6]
    same = [i for i in range(3) if abs(x[i] - y[i]) < 1e-9]
    if len(turned) == 1 and len(same) == 2:
        i = turned[0]
        lines = (
            f"{a.path.name}:{a.nodes[a.joint_node[f.names[k][0]]].line}, "
            f"{b.path.name}:{b.nodes[b.joint_node[f.names[k][1]]].line}"
        )
        return f"; the sign of its origin's {'xyz'[i]} is turned over, {x[i]:g} against {y[i]:g} m ({lines})"
    return ""


def _offset(a: Tree, b: Tree, f: Features, k: int, fit: Fit, label: str) -> Finding:
    name, partner = f.names[k]
    if f.slide[k]:
        return Finding(
            "offset_dropped",
            3,
            (name,),
            f"the zero of {label} differs by {fit.offset * 1e3:.4g} mm",
            {"offset_mm": fit.offset * 1e3},
        )
    degrees = float(np.degrees(fit.offset))
    refs = a.joint(name).ref, b.joint(partner).ref
    text = f"the zeros of {label} differ by {degrees:+.4f} deg"
    for tree, ref, joint, other in ((b, refs[1], partner, a), (a, refs[0], name, b)):
        if ref and abs(abs(fit.offset) - abs(ref)) < 1e-6:
            text += f': {tree.path.name} has ref="{ref:g}" rad, {other.path.name} has dropped it'
    if not fit.seen:
        text += "; seen in the link's own frame only, as no axis or named point lies farther out"
        if abs(abs(degrees) - 90 * round(abs(degrees) / 90)) < 1e-6:
            text += " (a multiple of 90 deg: it may be a frame's convention)"
    lower = a.joint(name).limits, b.joint(partner).limits
    figures = {"offset_rad": fit.offset, "offset_deg": degrees}
    if all(lower) and abs(lower[0][0] - lower[1][0]) > 1e-6:
        figures["lower_limits_apart_deg"] = float(np.degrees(lower[0][0] - lower[1][0]))
    return Finding("offset_dropped", 3, (name,), text, figures)


def _exchanged(a: Tree, b: Tree, given: Pairing, settled: Pairing) -> list[Finding]:
    before, after = dict(given.joints), dict(settled.joints)
    moved = [x for x, _ in given.joints if before[x] != after[x]]
    if not moved:
        return []
    by = {y: x for x, y in given.joints}
    groups: list[list[str]] = []
    for x in moved:
        if not any(x in g for g in groups):
            cycle, at = [x], by[after[x]]
            while at != x and at not in cycle:
                cycle.append(at)
                at = by[after[at]]
            groups.append(cycle)
    rows = "; ".join(f'"{x}" is "{after[x]}", not "{before[x]}"' for x in moved)
    who = ", ".join(" and ".join(f'"{n}"' for n in g) for g in groups)
    text = f"exchanged: {who}; by their axes {rows}"
    return [Finding("joints_exchanged", 3, tuple(moved), text, {"joints": float(len(moved))})]


def _order(a: Tree, b: Tree, f: Features) -> list[Finding]:
    out = []
    for k, (x, y) in enumerate(f.names):
        p, q = f.parent[k], f.parent_b[k]
        if p != q:
            said = [f'on "{f.names[i][s]}"' if i >= 0 else "on the base" for i, s in ((p, 0), (q, 1))]
            text = (
                f'the order of the chain differs: "{x}" sits {said[0]} in {a.path.name}, '
                f'"{y}" {said[1]} in {b.path.name}'
            )
            out.append(Finding("joints_exchanged", 3, (x,), text))
    return out


def _points(a: Tree, b: Tree, f: Features, at: Alignment, tolerance_m: float, skipped: set[int]) -> list[Finding]:
    """Fixed links and sites that both files name: tips, sensors, mounting points."""
    out = []
    for k, rows in f.frames.items():
        carry = at.base if k < 0 else at.fits[k].carry
        for x, y, name, partner, own in rows:
            if own or k in skipped:
                continue
            gap = float(np.linalg.norm(x[:3, 3] - carry[:3, :3] @ y[:3, 3] - carry[:3, 3]))
            slack = sum(t.nodes[t.node_of_link(n)].slack_m for t, n in ((a, name), (b, partner)))
            if k >= 0:
                slack += max(_bound(f.slack_a, f, k, at.fits[k].reach), _bound(f.slack_b, f, k, at.fits[k].reach))
            if gap > max(tolerance_m, min(ROUNDING_CAP, 2 * slack)):
                label = f'"{name}"' if name == partner else f'"{name}" (= "{partner}")'
                text = (
                    f"{label} sits {gap * 1e3:.4g} mm elsewhere on its link: another length of the last link, "
                    "or another point"
                )
                out.append(Finding("link_displaced", 3, (name,), text, {"shift_mm": gap * 1e3}))
    return out


def _written_short(f: Features, at: Alignment, wrong: Sequence[int], skipped: set[int]) -> list[Finding]:
    rest = [k for k in range(len(at.fits)) if k not in wrong and k not in skipped]
    worst = max((max(_parts(f, k, at.fits[k]).values()) for k in rest), default=0.0) * 1e3
    if worst < 1e-6:
        return []
    text = f"differences up to {worst:.2g} mm, as small as the last written digits"
    return [Finding("numbers_rounded", 3, (), text, {"shift_mm": worst}, False)]
