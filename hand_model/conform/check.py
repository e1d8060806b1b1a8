"""Two descriptions against each other: read, pair, align, name, and evaluate over random poses."""

from __future__ import annotations

import sys
import time
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import DescriptionError, HandModelError, did_you_mean
from .align import Alignment, align
from .causes import geometry_findings, mirror_finding
from .exchange import exchange
from .features import Features, features
from .lines import rotation_angle
from .mjcf import read_mjcf
from .pairing import Pairing, pair_automatically, read_pair
from .relations import relation_findings
from .report import CAUSES, ConformReport, Finding, JointRow, LinkRow
from .tree import Array, Tree, forward, inverse
from .urdf import parse_xml, read_urdf

TOLERANCE_M = 1e-7
"""1e-4 mm: what six written digits cost."""


def read(path: str | Path) -> Tree:
    """Read a URDF or an MJCF, told apart by the root element. Raises DescriptionError for anything else."""
    file = Path(path)
    root = parse_xml(file).getroot()
    if root.tag == "robot":
        return read_urdf(file, root)
    if root.tag == "mujoco":
        return read_mjcf(file, root)
    raise DescriptionError(f"{file}: neither a URDF (<robot>) nor an MJCF (<mujoco>), but <{root.tag}>")


def _check_options(accept: Collection[str], poses: int, tolerance_mm: float) -> None:
    unknown = set(accept) - set(CAUSES)
    if unknown:
        raise DescriptionError(f'no cause "{min(unknown)}"; {did_you_mean(min(unknown), CAUSES)}')
    if poses < 1 or tolerance_mm <= 0:
        raise DescriptionError(f"poses ({poses}) and tolerance_mm ({tolerance_mm}) should be positive")


def conform(
    a: str | Path,
    b: str | Path,
    pair: str | Path | None = None,
    *,
    poses: int = 1000,
    seed: int = 0,
    tolerance_mm: float = TOLERANCE_M * 1e3,
    accept: Collection[str] = (),
    engines: Collection[str] = (),
) -> ConformReport:
    """Compare two descriptions of one hand, in three layers: relations, frames, axes and points.

    a, b: paths of a URDF or MJCF each. pair: a pair.toml (see `read_pair`); without it names are paired automatically.
    poses: random poses within the limits that both share, seeded. tolerance_mm: [mm] on axes, and on the far ends of
    what they carry. accept: causes that are reported without deciding the verdict, such as "linear_mimic" where a URDF
    cannot do better.
    engines: "mujoco" and "pinocchio" evaluate the poses as well and must agree with this package's own kinematics to
    1e-9 m.
    Raises DescriptionError for what cannot be read or paired.
    """
    start = time.perf_counter()
    _check_options(accept, poses, tolerance_mm)
    tree_a, tree_b = read(a), read(b)
    given = read_pair(pair, tree_a, tree_b) if pair is not None else pair_automatically(tree_a, tree_b)
    f = features(tree_a, tree_b, given)
    at = align(f)
    reflected = mirror_finding(tree_a, tree_b, f, at)
    settled, f, at = (given, f, at) if reflected else exchange(f, given, tree_a, tree_b, at)
    given = _guessed(given, settled)
    values = sample(tree_a, tree_b, given, poses, seed)
    links = link_rows(tree_a, tree_b, given, settled, f, at, values)
    findings = relation_findings(tree_a, tree_b, settled, f, at)
    findings += (
        [reflected] if reflected else geometry_findings(tree_a, tree_b, given, settled, f, at, tolerance_mm * 1e-3)
    )
    findings = [replace(x, disagrees=False) if x.cause in accept else x for x in findings]
    ok = not any(x.disagrees for x in findings)
    explained = (
        _explained(tree_a, tree_b, settled, f, at, values) if not ok else max((r.rest_mm for r in links), default=0.0)
    )
    if ok and explained > max(20 * tolerance_mm, 2e-3) and not any(x.cause in accept for x in findings):
        text = f"{explained:.3g} mm remain at the far links over random poses, though every axis agrees"
        findings.append(Finding("unexplained", 3, (), text, {"rest_mm": explained}))
        ok = False
    evaluated = "this package's own kinematics"
    if engines:
        from .evaluate import verify

        evaluated += "; " + verify((tree_a, tree_b), values, dict(given.joints), engines)
    turn = np.degrees(rotation_angle(at.base[:3, :3]))
    return ConformReport(
        str(a),
        str(b),
        ok,
        tuple(findings),
        _joint_rows(tree_a, tree_b, given, f, at),
        tuple(links),
        given.base,
        tuple(at.base[:3, 3] * 1e3),
        float(turn),
        "pair.toml" if given.explicit else "automatic",
        given.unpaired,
        poses,
        evaluated,
        float(explained),
        time.perf_counter() - start,
        _warnings(tree_a, tree_b),
    )


def main_check(
    a: str | Path,
    b: str | Path,
    pair: str | Path | None = None,
    *,
    fix: str | Path | None = None,
    json: bool = False,
    **options,
) -> int:
    """`hand-model check A B [--pair pair.toml] [--fix DIR] [--json]`: print the report; 0 agree, 1 disagree, 2 bad
    input.

    fix: a folder for corrected copies. options: as for `conform`.
    """
    try:
        report = conform(a, b, pair, **options)
        print(report.to_json() if json else report.text(), end="")
        if fix is not None and not report.ok:
            from .fix import write_fixed

            print(write_fixed(a, b, pair, fix, **options).text(), end="")
    except HandModelError as error:
        print(f"hand-model check: {error}", file=sys.stderr)
        return 2
    return 0 if report.ok else 1


def _guessed(given: Pairing, settled: Pairing) -> Pairing:
    """A pairing that rested on geometry alone takes the exchanges as its own; one that names gave keeps what they
    say."""
    before, after = dict(given.joints), dict(settled.joints)
    moved = {x for x in before if before[x] != after[x]}
    return settled if moved and all(given.how.get(x) == "geometry" for x in moved) else given


def sample(a: Tree, b: Tree, pairing: Pairing, count: int, seed: int) -> dict[str, Array]:
    """Random values (count,) [rad or m] of a's paired joints within the limits that both files allow (else within a's,
    else +-1)."""
    rng = np.random.default_rng(seed)
    out = {}
    for x, y in pairing.joints:
        la, lb = a.joint(x).limits, b.joint(y).limits
        low, high = la or lb or (-1.0, 1.0)
        if la and lb and max(la[0], lb[0]) < min(la[1], lb[1]):
            low, high = max(la[0], lb[0]), min(la[1], lb[1])
        centre, half = (low + high) / 2, min(abs(high - low) / 2, np.pi)
        out[x] = rng.uniform(centre - half, centre + half, count)
    return out


def link_rows(
    a: Tree, b: Tree, pairing: Pairing, settled: Pairing, f: Features, at: Alignment, values: Mapping[str, Array]
) -> list[LinkRow]:
    """Every link pair over the poses, joint values taken as they are under the given pairing; frames as the alignment
    has them."""
    partner = dict(pairing.joints)
    pairs = [p for p in pairing.links if p != pairing.base] or [
        (a.nodes[a.joint_node[x]].name, b.nodes[b.joint_node[y]].name)
        for x, y in pairing.joints
        if a.nodes[a.joint_node[x]].kind == b.nodes[b.joint_node[y]].kind == "link"
    ]
    in_a = forward(a, values, [a.node_of_link(x) for x, _ in pairs], a.node_of_link(pairing.base[0]))
    mapped = {partner[x]: v for x, v in values.items()}
    in_b = forward(b, mapped, [b.node_of_link(y) for _, y in pairs], b.node_of_link(pairing.base[1]))
    rows = [_link_row(x, y, one, other, at.base) for (x, y), one, other in zip(pairs, in_a, in_b, strict=True)]
    frames = _frames(f, at)
    partner_link = dict(settled.links)
    return [replace(r, frame_of=partner_link.get(r.a, r.b), **frames.get(r.a, {})) for r in rows]


def _frames(f: Features, at: Alignment) -> dict[str, dict]:
    """The constant transform from each link's frame in a to its frame in b, once exchanges and offsets are taken
    out."""
    out = {}
    for k, some in f.frames.items():
        carry = at.base if k < 0 else at.fits[k].carry
        for pose_a, pose_b, name, _, _ in some:
            between = inverse(pose_a) @ carry @ pose_b
            out[name] = {
                "frame_mm": tuple(float(v) for v in between[:3, 3] * 1e3),
                "frame_deg": float(np.degrees(rotation_angle(between[:3, :3]))),
            }
    return out


def _link_row(x: str, y: str, one: tuple[Array, Array], other: tuple[Array, Array], base: Array) -> LinkRow:
    """a's pose against the base times b's: the difference as it is, its constant part, and the rest."""
    ra, pa = one
    rb, pb = base[:3, :3] @ other[0], other[1] @ base[:3, :3].T + base[:3, 3]
    raw = pa - pb
    turned = np.swapaxes(ra, -1, -2)
    relative, local = turned @ rb, -(turned @ raw[..., None])[..., 0]
    u, _, vt = np.linalg.svd(relative.mean(0))
    mean = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    shift = np.median(local, axis=0)
    rest = np.linalg.norm(local - shift, axis=-1)
    return LinkRow(
        x,
        y,
        y,
        tuple(float(v) for v in shift * 1e3),
        float(np.degrees(rotation_angle(mean))),
        float(np.linalg.norm(raw, axis=-1).max() * 1e3),
        float(np.degrees(rotation_angle(relative).max())),
        float(rest.max() * 1e3),
        float(np.degrees(rotation_angle(mean.T @ relative).max())),
    )


def _explained(a: Tree, b: Tree, pairing: Pairing, f: Features, at: Alignment, values: Mapping[str, Array]) -> float:
    """[mm] left at the links with exchanges, signs and offsets undone: what the remaining causes account for."""
    fits = {x: fit for (x, _), fit in zip(f.names, at.fits, strict=True)}
    partner = dict(pairing.joints)
    links = [p for p in pairing.links if p != pairing.base]
    if not links:
        return 0.0
    mapped = {partner[x]: fits[x].sign * (v + fits[x].offset) for x, v in values.items()}
    in_a = forward(a, values, [a.node_of_link(x) for x, _ in links], a.node_of_link(pairing.base[0]))
    in_b = forward(b, mapped, [b.node_of_link(y) for _, y in links], b.node_of_link(pairing.base[1]))
    rows = (_link_row(x, y, p, q, at.base) for (x, y), p, q in zip(links, in_a, in_b, strict=True))
    return max(row.rest_mm for row in rows)


def _joint_rows(a: Tree, b: Tree, pairing: Pairing, f: Features, at: Alignment) -> tuple[JointRow, ...]:
    before = dict(pairing.joints)
    rows = []
    for (x, y), fit in zip(f.names, at.fits, strict=True):
        how = pairing.how.get(x, "") if before[x] == y else "its axis"
        rows.append(
            JointRow(
                x,
                y,
                how,
                float(np.degrees(fit.angle_rad)),
                fit.shift * 1e3,
                fit.sign,
                float(np.degrees(fit.offset)),
                a.joint(x).limits,
                b.joint(y).limits,
            )
        )
    return tuple(rows)


def _warnings(a: Tree, b: Tree) -> tuple[str, ...]:
    out = []
    for tree in (a, b):
        out += tree.warnings
        if tree.missing_meshes:
            out.append(
                f"{tree.path.name}: {len(tree.missing_meshes)} mesh file(s) missing, such as {tree.missing_meshes[0]}; "
                "kinematics need none"
            )
    return tuple(out)
