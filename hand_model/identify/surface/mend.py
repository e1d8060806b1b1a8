"""Defects of a triangulation repaired: flipped and doubled faces, edges of more than two faces, pinched vertices,
crumbs, holes."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

HOLE_EDGES = 60  # of a longer rim the smallest filling is not looked for
LOOKS_ON = 0.3  # cosine between a filling and the surface around it from which the filling continues it


def mended(vertices: Array, faces: Faces, normals: Array) -> tuple[Array, Faces, Array, dict[str, int]]:
    """A manifold, outward-oriented surface without small holes, its normals, and how often each defect was repaired.

    vertices: (v, 3) [m]. normals: (v, 3) outward at the vertices. Vertices that no face needs are left out.
    """
    counts: dict[str, int] = {}
    faces, counts["flipped faces"] = _outwards(vertices, faces, normals)
    faces, counts["faces on edges of two others"] = _edge_manifold(vertices, faces)
    faces, counts["crumbs"] = _largest(faces)
    filled = 0
    while True:  # a filling may close the way round a pinched vertex
        vertices, faces, normals, split = _unpinched(vertices, faces, normals)
        counts["pinched vertices"] = counts.get("pinched vertices", 0) + split
        faces, more = _without_holes(vertices, faces, normals)
        filled += more
        if not more:
            break
    counts["holes"] = filled
    used, index = np.unique(faces, return_inverse=True)
    return vertices[used], index.reshape(-1, 3).astype(np.int64), normals[used], counts


def rims(faces: Faces) -> list[list[int]]:
    """Closed loops of the edges that have a face on one side only, along the missing faces' direction."""
    directed = {(int(a), int(b)) for a, b in directed_edges(faces)}
    following = {a: b for b, a in directed if (a, b) not in directed}
    loops = []
    while following:
        start, at = next(iter(following.items()))
        loop = [start]
        del following[start]
        while at != start:
            loop.append(at)
            if at not in following:
                return loops  # not a manifold: no loop
            at = following.pop(at)
        loops.append(loop)
    return loops


def directed_edges(faces: Faces) -> NDArray[np.int64]:
    """Edges (3 f, 2) as the faces run along them."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def face_normals(vertices: Array, faces: Faces) -> Array:
    """Normals (f, 3), as long as twice the face's area [m^2]."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def _outwards(vertices: Array, faces: Faces, normals: Array) -> tuple[Faces, int]:
    """Neighbouring faces turned alike, then every connected part turned to where most of its area's normals point."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    faces = faces[np.linalg.norm(face_normals(vertices, faces), axis=1) > 1e-12]
    if not len(faces):
        return faces, 0
    users: dict[tuple[int, int], list[tuple[int, bool]]] = defaultdict(list)
    for i, (a, b) in enumerate(directed_edges(faces).tolist()):
        users[min(a, b), max(a, b)].append((i % len(faces), a < b))
    pairs = {(u[0][0], u[1][0]): u[0][1] == u[1][1] for u in users.values() if len(u) == 2}  # True: one is flipped
    one, two = np.array(list(pairs), int).reshape(-1, 2).T
    graph = coo_matrix((np.ones(len(one)), (one, two)), (len(faces), len(faces))).tocsr()
    count, label = connected_components(graph, directed=False)
    vote = np.einsum("ij,ij->i", face_normals(vertices, faces), normals[faces].sum(1))
    turned = np.zeros(len(faces), bool)
    for part in range(count):
        order, before = breadth_first_order(graph, int(np.flatnonzero(label == part)[0]), directed=False)
        for k in order[1:]:
            b = before[k]
            turned[k] = turned[b] ^ (pairs[b, k] if (b, k) in pairs else pairs[k, b])
        if (vote[order] * np.where(turned[order], -1, 1)).sum() < 0:
            turned[order] ^= True
    faces = faces.copy()
    faces[turned] = faces[turned][:, ::-1]
    return faces, int(turned.sum())


def _edge_manifold(vertices: Array, faces: Faces) -> tuple[Faces, int]:
    """Best-shaped faces first; one that would run along a directed edge a second time is left out."""
    if not len(faces):
        return faces, 0
    longest = np.max(
        [np.linalg.norm(vertices[faces[:, i]] - vertices[faces[:, i - 1]], axis=1) for i in range(3)], axis=0
    )
    taken: set[tuple[int, int]] = set()
    kept = []
    for k in np.lexsort((np.arange(len(faces)), longest)):
        a, b, c = (int(v) for v in faces[k])
        edges = ((a, b), (b, c), (c, a))
        if not taken.intersection(edges):
            taken.update(edges)
            kept.append(k)
    return faces[np.sort(kept)], len(faces) - len(kept)


def _largest(faces: Faces) -> tuple[Faces, int]:
    """The part with most faces, parts being joined along edges."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    if not len(faces):
        return faces, 0
    owner = {(int(a), int(b)): i % len(faces) for i, (a, b) in enumerate(directed_edges(faces))}
    pairs = np.array([(i, owner[b, a]) for (a, b), i in owner.items() if (b, a) in owner], int).reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(faces), len(faces)))
    count, label = connected_components(graph, directed=False)
    return faces[label == np.bincount(label).argmax()], count - 1


def _unpinched(vertices: Array, faces: Faces, normals: Array) -> tuple[Array, Faces, Array, int]:
    """A vertex in which several fans of faces meet becomes one vertex per fan."""
    at: dict[int, list[int]] = defaultdict(list)
    for k, face in enumerate(faces):
        for v in face:
            at[int(v)].append(k)
    faces, extra, copies = faces.copy(), len(vertices), []
    for v, around in sorted(at.items()):
        for fan in _fans(v, around, faces)[1:]:
            for k in fan:
                faces[k][faces[k] == v] = extra
            copies.append(v)
            extra += 1
    return np.concatenate([vertices, vertices[copies]]), faces, np.concatenate([normals, normals[copies]]), len(copies)


def _fans(vertex: int, around: list[int], faces: Faces) -> list[list[int]]:
    others = {k: {int(v) for v in faces[k]} - {vertex} for k in around}
    fans, left = [], list(around)
    while left:
        fan, open_ = [left.pop(0)], True
        while open_:
            reach = set().union(*(others[k] for k in fan))
            joined = [k for k in left if others[k] & reach]
            fan += joined
            left = [k for k in left if k not in joined]
            open_ = bool(joined)
        fans.append(sorted(fan))
    return sorted(fans, key=lambda fan: (-len(fan), fan))


def _without_holes(vertices: Array, faces: Faces, normals: Array) -> tuple[Faces, int]:
    """Holes that a filling closes in the direction of the surface around them; the rim of an open surface stays."""
    filled = 0
    for loop in rims(faces):
        if len(loop) > HOLE_EDGES or len(set(loop)) < len(loop):
            continue
        taken = {(int(a), int(b)) for a, b in directed_edges(faces)}
        filling = _smallest_filling(vertices, loop, taken)
        if filling is None:
            continue
        across = face_normals(vertices, filling)
        around = normals[loop].mean(0)
        area = np.linalg.norm(across, axis=1).sum()
        if across.sum(0) @ around > LOOKS_ON * area * np.linalg.norm(around) and np.linalg.norm(around) > LOOKS_ON:
            faces, filled = np.concatenate([faces, filling]), filled + 1
    return faces, filled


def _smallest_filling(vertices: Array, loop: list[int], taken: set[tuple[int, int]]) -> Faces | None:
    """Triangulation of a loop with the least area that uses no edge of the mesh twice (Barequet & Sharir 1995)."""
    n = len(loop)
    p = vertices[loop]
    cost, split = np.zeros((n, n)), np.zeros((n, n), int)
    for gap in range(2, n):
        for i in range(n - gap):
            j = i + gap
            inner = np.arange(i + 1, j)
            area = np.linalg.norm(np.cross(p[inner] - p[i], p[j] - p[i]), axis=1)
            total = cost[i, inner] + cost[inner, j] + area
            edge = (loop[i], loop[j])
            doubled = gap < n - 1 and (edge in taken or edge[::-1] in taken)
            best = int(np.argmin(total))
            cost[i, j], split[i, j] = np.inf if doubled else total[best], inner[best]
    if not np.isfinite(cost[0, n - 1]):
        return None
    out, left = [], [(0, n - 1)]
    while left:
        i, j = left.pop()
        if j - i >= 2:
            k = int(split[i, j])
            out.append((loop[i], loop[k], loop[j]))
            left += [(i, k), (k, j)]
    return np.array(out, np.int64)
