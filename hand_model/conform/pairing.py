"""Which joint and which link of one description is which of the other: by pair.toml, by name, by place in the tree."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..errors import DescriptionError, did_you_mean
from .tree import Tree, zero_lines, zero_poses

SYNONYMS = {
    "index": {"ff", "first", "fore", "forefinger", "idx", "if", "pointer"},
    "middle": {"mf", "mid", "long"},
    "ring": {"rf", "rng"},
    "little": {"lf", "pinky", "pnky", "pinkie", "small", "pf"},
    "thumb": {"th", "thmb", "tf"},
}
IGNORED = {"joint", "jnt", "j", "link", "body", "left", "right", "l", "r", "lh", "rh", "hand", "robot", "finger"}


@dataclass(frozen=True)
class Pairing:
    """What corresponds to what. base: (link of a, link of b). joints, links: (name in a, name in b).

    how: joint of a -> "pair.toml", "name", "tokens" or "geometry". explicit: a pair.toml settled it, so that names it
    leaves out correspond to nothing. unpaired: joints of a and of b that have no partner.
    """

    base: tuple[str, str]
    joints: tuple[tuple[str, str], ...]
    links: tuple[tuple[str, str], ...]
    how: dict[str, str]
    explicit: bool
    unpaired: tuple[tuple[str, ...], tuple[str, ...]]


def read_pair(path: str | Path, a: Tree, b: Tree) -> Pairing:
    """Read a pair.toml.

    `base = { mjcf = "...", urdf = "..." }` names the two bodies that poses are relative to; the tables `[joints]` and
    `[links]` hold lines `"name in the MJCF" = "name in the URDF"`. For two files of one format the keys of `base` are
    `a` and `b`, and the lines are `"name in b" = "name in a"`. Names left out correspond to nothing. Raises
    DescriptionError for unknown names.
    """
    file = Path(path)
    try:
        table = tomllib.loads(file.read_text())
    except OSError:
        raise DescriptionError(f"{file}: no such file; a pair.toml is needed") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DescriptionError(f"{file}: not TOML ({error})") from None
    key_a, key_b = (a.format, b.format) if a.format != b.format else ("a", "b")
    left_is_a = a.format == "mjcf" and b.format == "urdf"
    unknown = set(table) - {"urdf", "mjcf", "a", "b", "base", "joints", "links"}
    if unknown:
        raise DescriptionError(
            f'{file}: unknown key "{min(unknown)}"; {did_you_mean(min(unknown), ["base", "joints", "links"])}'
        )
    joints = _table(table, "joints", file, left_is_a)
    if not joints:
        raise DescriptionError(
            f'{file}: [joints] is missing or empty; a line reads "name in the MJCF" = "name in the URDF"'
        )
    links = _table(table, "links", file, left_is_a)
    for x, y in joints:
        a.joint(x), b.joint(y)
    for x, y in links:
        a.node_of_link(x), b.node_of_link(y)
    base = table.get("base", {})
    if base and (not isinstance(base, dict) or set(base) != {key_a, key_b}):
        raise DescriptionError(f'{file}: base should read {{ {key_a} = "...", {key_b} = "..." }}')
    names = (base[key_a], base[key_b]) if base else (_base(a, [x for x, _ in joints]), _base(b, [y for _, y in joints]))
    a.node_of_link(names[0]), b.node_of_link(names[1])
    return _finish(a, b, names, joints, links, dict.fromkeys((x for x, _ in joints), "pair.toml"), True)


def _table(table: dict, key: str, file: Path, left_is_a: bool) -> list[tuple[str, str]]:
    rows = table.get(key, {})
    if not isinstance(rows, dict) or not all(isinstance(v, str) for v in rows.values()):
        raise DescriptionError(f'{file}: [{key}] should hold lines "name" = "name"')
    twice = [name for name, n in Counter(rows.values()).items() if n > 1]
    if twice:
        raise DescriptionError(f'{file}: [{key}] pairs "{twice[0]}" twice')
    return [(k, v) if left_is_a else (v, k) for k, v in rows.items()]


def pair_automatically(a: Tree, b: Tree) -> Pairing:
    """Pair equal names, then equal tokens ("rh_FFJ3" and "index_joint_3"), then what is left by place in the tree and
    geometry."""
    names_a, names_b = [j.name for j in a.joints], [j.name for j in b.joints]
    if not names_a or not names_b:
        empty = a if not names_a else b
        raise DescriptionError(f"{empty.path}: no moving joint, so there is nothing to compare")
    pairs: dict[str, str] = {n: n for n in names_a if n in set(names_b)}
    how = dict.fromkeys(pairs, "name")
    for x, y in _by_tokens(
        [n for n in names_a if n not in pairs], [n for n in names_b if n not in set(pairs.values())]
    ):
        pairs[x], how[x] = y, "tokens"
    if len(pairs) < min(len(names_a), len(names_b)):
        for x, y in _by_geometry(a, b, pairs):
            pairs[x], how[x] = y, "geometry"
    joints = [(n, pairs[n]) for n in names_a if n in pairs]
    if not joints:
        raise DescriptionError(
            f"{a.path} and {b.path}: no joint of one could be paired with one of the other; give a pair.toml"
        )
    base = (_base(a, [x for x, _ in joints]), _base(b, [y for _, y in joints]))
    common = [(n, n) for n in a.link_node if n in b.link_node and n != "world"]
    rest_a = [n for n in a.link_node if n not in b.link_node]
    common += _by_tokens(rest_a, [n for n in b.link_node if n not in a.link_node])
    return _finish(a, b, base, joints, common, how, False)


def _finish(a: Tree, b: Tree, base, joints, links, how, explicit: bool) -> Pairing:
    """Keep links that hang on paired joints, and give each joint the link that it moves where no name pairs one."""
    partner = dict(joints)
    kept = []
    for x, y in links:
        owner_x, owner_y = owner(a, a.node_of_link(x)), owner(b, b.node_of_link(y))
        if explicit or (owner_x is not None and partner.get(owner_x) == owner_y) or (x, y) == base:
            kept.append((x, y))
    have = {owner(a, a.node_of_link(x)) for x, _ in kept}
    for x, y in joints:
        node_x, node_y = a.nodes[a.joint_node[x]], b.nodes[b.joint_node[y]]
        if x not in have and not explicit and node_x.kind == node_y.kind == "link":
            kept.append((node_x.name, node_y.name))
    left = tuple(j.name for j in a.joints if j.name not in partner)
    right = tuple(j.name for j in b.joints if j.name not in set(partner.values()))
    return Pairing(tuple(base), tuple(joints), tuple(kept), how, explicit, (left, right))


def owner(tree: Tree, index: int) -> str | None:
    """The joint that moves a node last: its own or its nearest ancestor's; None for what is fixed to the root."""
    return next((tree.nodes[i].joint.name for i in tree.ancestors(index) if tree.nodes[i].joint), None)


def parent_joint(tree: Tree, name: str) -> str | None:
    """The joint before `name` on the way from the root; None for the first."""
    parent = tree.nodes[tree.joint_node[name]].parent
    return owner(tree, parent) if parent >= 0 else None


def _base(tree: Tree, joints: Sequence[str]) -> str:
    """The deepest link that all of the joints hang on."""
    paths = [tree.ancestors(tree.nodes[tree.joint_node[n]].parent)[::-1] for n in joints]
    shared = [row[0] for row in zip(*paths, strict=False) if len(set(row)) == 1]
    index = shared[-1]
    while tree.nodes[index].kind != "link":
        index = tree.nodes[index].parent
    return tree.nodes[index].name


def tokens(name: str) -> tuple[str, ...]:
    """A name's words, sorted, without those that every hand carries, fingers under one name each."""
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", name.replace(".0", "")).lower()
    spaced = re.sub(r"(?<=[a-z])j(?=\d)", " j", spaced)  # FFJ4: first finger, joint 4
    words = re.findall(r"[a-z]+|\d+", spaced)
    words = [next((k for k, v in SYNONYMS.items() if w == k or w in v), w) for w in words]
    return tuple(sorted(w for w in words if w not in IGNORED))


def _by_tokens(left: Sequence[str], right: Sequence[str]) -> list[tuple[str, str]]:
    keys_l, keys_r = {n: tokens(n) for n in left}, {n: tokens(n) for n in right}
    count_l, count_r = Counter(keys_l.values()), Counter(keys_r.values())
    of = {k: n for n, k in keys_r.items()}
    return [(n, of[k]) for n, k in keys_l.items() if k and count_l[k] == 1 and count_r.get(k) == 1]


def _by_geometry(a: Tree, b: Tree, fixed: dict[str, str]) -> list[tuple[str, str]]:
    """Match the two joint trees top down: equal shape first, then the distance between axes in the base frame at
    zero."""
    sides = []
    for tree in (a, b):
        names = [j.name for j in tree.joints]
        base = tree.link_node[_base(tree, names)]
        poses = zero_poses(tree, base)
        axes, points = zero_lines(tree, base, names, poses)
        children: dict[str | None, list[str]] = {None: []} | {n: [] for n in names}
        for n in names:
            children[parent_joint(tree, n)].append(n)
        sides.append((children, dict(zip(names, axes, strict=True)), dict(zip(names, points, strict=True))))
    (kids_a, axes_a, points_a), (kids_b, axes_b, points_b) = sides
    taken = set(fixed.values())

    def cost(x: str, y: str) -> tuple[float, list[tuple[str, str]]]:
        if fixed.get(x, y) != y or (y in taken and fixed.get(x) != y):
            return 1e3, []
        gap = points_a[x] - points_b[y]
        gap = gap - (gap @ axes_a[x]) * axes_a[x]
        turn = 0.03 * np.arccos(np.clip(abs(axes_a[x] @ axes_b[y]), 0, 1))
        own = 0.0 if fixed.get(x) == y else float(np.log1p(np.hypot(np.linalg.norm(gap), turn) / 1e-3))
        below, inner = assign(kids_a[x], kids_b[y])
        return own + below, [(x, y), *inner]

    def assign(xs: list[str], ys: list[str]) -> tuple[float, list[tuple[str, str]]]:
        if not xs or not ys:
            return 6.0 * (len(xs) + len(ys)), []
        table = [[cost(x, y) for y in ys] for x in xs]
        rows, columns = linear_sum_assignment([[c for c, _ in row] for row in table])
        chosen = [table[i][j] for i, j in zip(rows, columns, strict=True)]
        return sum(c for c, _ in chosen) + 6.0 * abs(len(xs) - len(ys)), [p for _, inner in chosen for p in inner]

    _, found = assign(kids_a[None], kids_b[None])
    return [(x, y) for x, y in found if x not in fixed and y not in taken]
