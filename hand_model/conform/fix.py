"""Corrected copies where the cause is mechanical: numbers, zeros, signs, limits and couplings of one file from the
other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import DescriptionError
from ..output import new_file
from .align import align
from .check import conform, read
from .edit import MjcfEditor, UrdfEditor, editor, relative
from .exchange import exchange
from .features import Features, features
from .joint_fit import Fit
from .pairing import Pairing, owner, pair_automatically, read_pair
from .relations import COUPLING_TOLERANCE, LIMIT_TOLERANCE, resolved
from .report import ConformReport
from .tree import Array, Tree, inverse, zero_poses

CHANGE_M = 1e-7
"""[m or rad] Smaller changes are the writer's digits and leave the file's own numbers alone."""


@dataclass(frozen=True)
class Fixed:
    """Corrected copies and how they compare. changed: one sentence each. left: what no mechanical change can settle."""

    a: Path
    b: Path
    pair: Path
    changed: tuple[str, ...]
    left: tuple[str, ...]
    report: ConformReport

    def text(self) -> str:
        """For a terminal."""
        out = ["", f"Corrected copies in {self.pair.parent}: {self.a.name}, {self.b.name}, {self.pair.name}"]
        out += [f"   {line}" for line in self.changed] + [f"   left: {line}" for line in self.left]
        verdict = "agree" if self.report.ok else f"still disagree ({', '.join(self.report.causes)})"
        return "\n".join([*out, f"The corrected copies {verdict}."]) + "\n"


def write_fixed(
    a: str | Path, b: str | Path, pair: str | Path | None, folder: str | Path, correct: str | None = None, **options
) -> Fixed:
    """Write corrected copies of two descriptions and the pairing that their axes show, and compare them again.

    The geometry, zeros, signs and limits of one file are taken from the other: of the file whose numbers are rounded,
    else of the URDF (which has no `ref` to lose), else of a; `correct` ("a" or "b") says otherwise. A coupling that one
    file lacks is added to it. Which file describes the real hand is not decided here. Raises DescriptionError where a
    file cannot be changed in place, or would be overwritten.
    """
    tree_a, tree_b = read(a), read(b)
    given = read_pair(pair, tree_a, tree_b) if pair is not None else pair_automatically(tree_a, tree_b)
    settled, _, _ = exchange(features(tree_a, tree_b, given), given, tree_a, tree_b)
    before = conform(a, b, pair, **{**options, "engines": ()})
    side = correct or _side(before, tree_a, tree_b)
    if side not in ("a", "b"):
        raise DescriptionError(f'correct is "a" or "b", not "{side}"')
    target, reference = (tree_a, tree_b) if side == "a" else (tree_b, tree_a)
    pairing = settled if side == "a" else _swapped(settled)
    out = Path(folder)
    places = {"a": out / tree_a.path.name, "b": out / tree_b.path.name}
    if places["a"] == places["b"]:
        places = {s: out / f"{s}_{p.name}" for s, p in places.items()}
    if any(p.resolve() == t.path.resolve() for t in (tree_a, tree_b) for p in places.values()):
        raise DescriptionError(f"{out}: this folder holds the originals; name another one for the corrected copies")
    if "mirrored" in before.causes:
        raise DescriptionError(f"{a} and {b}: a left and a right hand; no number here can be corrected")
    edits = editor(target), editor(reference)
    changed, left = _correct(target, reference, pairing, edits)
    if dict(settled.joints) != dict(given.joints):
        changed.append("pair.toml: the joints under the names that their axes belong to")
    (edits[0].write(places[side]), edits[1].write(places["b" if side == "a" else "a"]))
    pair_file = out / "pair.toml"
    _write_pair(pair_file, tree_a, tree_b, settled)
    report = conform(places["a"], places["b"], pair_file, **options)
    return Fixed(places["a"], places["b"], pair_file, tuple(changed), tuple(left), report)


def _side(report: ConformReport, a: Tree, b: Tree) -> str:
    for finding in report.findings:
        if finding.cause == "numbers_rounded" and finding.disagrees and finding.layer == 3:
            return "b" if finding.text.startswith(f"{b.path.name} writes") else "a"
    return "b" if b.format == "urdf" and a.format == "mjcf" else "a"


def _swapped(p: Pairing) -> Pairing:
    joints, links = tuple((y, x) for x, y in p.joints), tuple((y, x) for x, y in p.links)
    how = {y: p.how.get(x, "") for x, y in p.joints}
    return Pairing((p.base[1], p.base[0]), joints, links, how, p.explicit, (p.unpaired[1], p.unpaired[0]))


def _correct(
    target: Tree, reference: Tree, pairing: Pairing, edits: tuple[UrdfEditor | MjcfEditor, UrdfEditor | MjcfEditor]
) -> tuple[list[str], list[str]]:
    f = features(target, reference, pairing)
    at = align(f)
    fits = {x: fit for (x, _), fit in zip(f.names, at.fits, strict=True)}
    moved = _place(target, f, at.base, fits, pairing, edits[0])
    changed = [f"{target.path.name}: origin and axis of {', '.join(moved)} from {reference.path.name}"] if moved else []
    limits = []
    for x, y in pairing.joints:
        mine, other = target.joint(x).limits, reference.joint(y).limits
        if (mine is None) != (other is None) or (mine and np.abs(np.subtract(mine, other)).max() > LIMIT_TOLERANCE):
            edits[0].limit(x, other)
            limits.append(x)
    if limits:
        changed.append(f"{target.path.name}: limits of {', '.join(limits)} from {reference.path.name}")
    said, left = _couple(target, reference, pairing, fits, set(moved), edits)
    return changed + said, left


def _place(
    target: Tree, f: Features, base: Array, fits: Mapping[str, Fit], pairing: Pairing, edit: UrdfEditor | MjcfEditor
) -> list[str]:
    """Move every link to where the reference has it, in its own frame convention; the joints' axes become the
    reference's."""
    root = target.node_of_link(pairing.base[0])
    old = zero_poses(target, root)
    new, moved = old.copy(), []
    lines = {
        x: (base[:3, :3] @ w, base[:3, :3] @ p + base[:3, 3])
        for (x, _), w, p in zip(f.names, f.axes_b, f.points_b, strict=True)
    }
    tips = _fixed_points(target, f, base)
    for i, node in enumerate(target.nodes):
        holder = _holder(target, i, fits)
        if holder is not None:
            new[i] = base @ inverse(fits[holder].carry) @ old[i]
        if i in tips:
            new[i][:3, 3] = tips[i]
        axis = point = None
        if node.joint and node.joint.name in lines:
            w, p = lines[node.joint.name]
            axis, point = new[i][:3, :3].T @ w, new[i][:3, :3].T @ (p - new[i][:3, 3])
            point = node.joint.point - (node.joint.point - point) @ (np.eye(3) - np.outer(axis, axis))
            if target.format == "urdf" and node.joint.kind == "hinge":
                if np.linalg.norm(point) > CHANGE_M:
                    edit.displace(i, -point)
                    new[i][:3, 3] += new[i][:3, :3] @ point
                point = np.zeros(3)
        if node.parent < 0 or i in target.ancestors(root):
            continue
        origin, zero = relative(new[node.parent], new[i]), relative(old[node.parent], old[i])
        same = np.abs(origin - zero).max() < CHANGE_M
        if axis is not None:
            same = (
                same
                and np.abs(axis - node.joint.axis).max() < CHANGE_M
                and np.abs(point - node.joint.point).max() < CHANGE_M
            )
        if not same:
            edit.place(i, origin, axis, point)
            moved.append(node.joint.name if node.joint else node.name)
    return moved


def _fixed_points(target: Tree, f: Features, base: Array) -> dict[int, Array]:
    """Fixed links and sites that both name: node of the target -> (3,) [m] where the reference has it."""
    rows = (row for some in f.frames.values() for row in some if not row[4])
    return {target.node_of_link(x): base[:3, :3] @ pose_b[:3, 3] + base[:3, 3] for _, pose_b, x, _, _ in rows}


def _holder(tree: Tree, index: int, fits: Mapping[str, Fit]) -> str | None:
    name = owner(tree, index)
    while name is not None and name not in fits:
        parent = tree.nodes[tree.joint_node[name]].parent
        name = owner(tree, parent) if parent >= 0 else None
    return name


def _couple(
    target: Tree, reference: Tree, pairing: Pairing, fits: Mapping[str, Fit], moved: set[str], edits
) -> tuple[list[str], list[str]]:
    """Give both files one law per follower: the reference's where it has one, else the target's in the new
    coordinates."""
    partner, back = dict(pairing.joints), {y: x for x, y in pairing.joints}
    changed, left = [], []
    for x, y in pairing.joints:
        mine, other = target.joint(x).coupling, reference.joint(y).coupling
        if mine is None and other is None:
            continue
        if other is not None:
            driver, law = _law(reference, y)
            changes = mine is None or len(resolved(target, x)[1]) > 1 or not _same(target, x, back.get(driver), law)
            if changes and not edits[0].couple(x, back.get(driver), law):
                left.append(f'"{x}": a mimic is a straight line, {reference.path.name} has a polynomial')
            elif changes:
                changed.append(f'{target.path.name}: "{x}" follows as in {reference.path.name}')
            continue
        driver, law = _law(target, x)
        if driver is not None and driver not in partner:
            left.append(f'"{x}" follows "{driver}", which has no partner')
            continue
        if (
            driver is not None
            and reference.joint(partner[driver]).coupling
            and resolved(reference, partner[driver])[0] == y
        ):
            edits[0].couple(x, None, None)
            changed.append(f'{target.path.name}: "{x}" no longer follows "{driver}"')
            continue
        law = _recast(law, fits[x], fits.get(driver))
        edits[0].couple(x, driver, law)
        if edits[1].couple(y, partner.get(driver), law):
            changed.append(f'{reference.path.name}: "{y}" follows "{partner.get(driver)}" as in {target.path.name}')
        else:
            left.append(f'"{y}": a mimic is a straight line, {target.path.name} has a polynomial')
    return changed, left


def _law(tree: Tree, name: str) -> tuple[str | None, Array]:
    """The free driver at the end of a chain, and the polynomial of its absolute value that the follower takes."""
    driver, chain = resolved(tree, name)
    total = np.polynomial.Polynomial([0.0, 1.0])
    for c in chain:
        total = np.polynomial.Polynomial(c.coefficients)(total - c.driver_ref) + c.follower_ref
    return driver, np.atleast_1d(total.trim(1e-300).coef)


def _same(tree: Tree, name: str, driver: str | None, law: Array) -> bool:
    own_driver, own = _law(tree, name)
    q = np.linspace(-2.0, 2.0, 101)
    return (
        own_driver == driver
        and np.abs(np.polynomial.polynomial.polyval(q, own) - np.polynomial.polynomial.polyval(q, law)).max()
        < COUPLING_TOLERANCE / 10
    )


def _recast(law: Array, follower: Fit, driver: Fit | None) -> Array:
    """A law between the target's old coordinates, in the reference's: q_reference = sign (q_target + offset)."""
    if driver is None:
        return np.array([follower.sign * (law[0] + follower.offset)])
    inner = np.polynomial.Polynomial([-driver.offset, driver.sign])
    total = follower.sign * (np.polynomial.Polynomial(law)(inner) + follower.offset)
    return np.atleast_1d(total.coef)


def _write_pair(path: Path, a: Tree, b: Tree, p: Pairing) -> None:
    keys = (a.format, b.format) if a.format != b.format else ("a", "b")
    left_is_a = a.format == "mjcf" and b.format == "urdf"
    rows = [f'base = {{ {keys[0]} = "{p.base[0]}", {keys[1]} = "{p.base[1]}" }}']
    for table, pairs in (("joints", p.joints), ("links", p.links)):
        rows += ["", f"[{table}]"] + [f'"{x}" = "{y}"' if left_is_a else f'"{y}" = "{x}"' for x, y in pairs]
    with new_file(path) as staging:
        staging.write_text("\n".join(rows) + "\n")
