"""Probed surfaces that a hand carries: visual meshes, convex parts for contact and, where watertight, mass properties
in place of the fallback.

`hand.extra["surfaces"]` maps "palm" or "<finger>/<joint>" to {"vertices": (v, 3) [m] in the palm frame at rest,
"faces": (f, 3) counter-clockwise from outside, "parts": convex meshes of the same form, optional, "how", "error":
optional, see identify.surface}.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import HandFileError, did_you_mean
from ..hand import Hand
from .clearance import PALM, Key
from .shape import DENSITY, Inertia

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """A triangle mesh: vertices (v, 3) [m], faces (f, 3). parts: convex meshes for contact. how: where it comes
    from."""

    vertices: Array
    faces: NDArray[np.int64]
    parts: tuple[Surface, ...] = ()
    how: str = ""

    @property
    def watertight(self) -> bool:
        """Whether every edge is shared by two faces that run along it in opposite directions, and the inside has
        volume."""
        edges = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        there = {(int(a), int(b)) for a, b in edges}
        return len(there) == len(edges) and all((b, a) in there for a, b in there) and mesh_inertia(self).mass > 0

    def shifted(self, origin: Array) -> Surface:
        """The surface seen from another origin (3,) [m]."""
        return Surface(self.vertices - origin, self.faces, tuple(p.shifted(origin) for p in self.parts), self.how)


def surfaces(hand: Hand) -> Mapping[Key, Surface]:
    """Surfaces of the hand's segments, {(finger, joint): Surface}, the palm under ("", "palm"); those of absent fingers
    are left out.

    Raises HandFileError for a segment that no such hand has the form of, or a mesh that is none.
    """
    keys = {"palm": PALM} | {f"{f.name}/{j.name}": (f.name, j.name) for f in hand.fingers for j in f.joints}
    found = {}
    for name, table in hand.extra.get("surfaces", {}).items():
        if name not in keys:
            if name.split("/")[0] in {f.name for f in hand.fingers} or "/" not in name:
                raise HandFileError(f'surface "{name}" belongs to no segment; {did_you_mean(name, keys)}')
            continue
        whole = _mesh(name, table)
        parts = tuple(_mesh(f"{name}, part {i}", part) for i, part in enumerate(table.get("parts", ())))
        found[keys[name]] = Surface(whole.vertices, whole.faces, parts, _how(table))
    return found


def _mesh(name: str, table: Any) -> Surface:
    try:
        vertices, faces = np.array(table["vertices"], float), np.array(table["faces"], np.int64)
    except (KeyError, TypeError, ValueError):
        raise HandFileError(f'surface "{name}" needs "vertices" and "faces" of three numbers each') from None
    sizes = vertices.ndim == 2 and faces.ndim == 2 and vertices.shape[1] == faces.shape[1] == 3 and len(faces) > 3
    if not (sizes and np.isfinite(vertices).all() and faces.min() >= 0 and faces.max() < len(vertices)):
        raise HandFileError(
            f'surface "{name}" is no mesh: vertices (v, 3), finite, and four or more faces (f, 3) into them'
        )
    return Surface(vertices, faces)


def _how(table: Mapping[str, Any]) -> str:
    error = table.get("error", {})
    names = (("median_mm", "median"), ("p95_mm", "95 %"), ("max_mm", "largest"))
    said = ", ".join(f"{text} {error[key]:.2f} mm" for key, text in names if key in error)
    return "; ".join(
        part for part in (str(table.get("how", "")), said and f"probed points off the mesh: {said}") if part
    )


def mesh_inertia(surface: Surface, density: float = DENSITY) -> Inertia:
    """Mass properties of the inside at uniform density [kg/m^3], by signed tetrahedra (Tonon 2004)."""
    anchor = surface.vertices.mean(0)
    a, b, c = (surface.vertices[surface.faces[:, i]] - anchor for i in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    total = float(volume.sum())
    if abs(total) < 1e-18:
        return Inertia(0.0, anchor, np.zeros((3, 3)))
    centre = (volume[:, None] * (a + b + c) / 4).sum(0) / total
    corners = np.stack([a, b, c], axis=1)
    summed = corners.sum(1)
    # integral of x x' over a tetrahedron with one corner at the origin
    second = (np.einsum("nki,nkj->nij", corners, corners) + np.einsum("ni,nj->nij", summed, summed)) / 20
    moment = (volume[:, None, None] * second).sum(0) - total * np.outer(centre, centre)
    tensor = density * (np.trace(moment) * np.eye(3) - moment)
    return Inertia(density * total, anchor + centre, (tensor + tensor.T) / 2)
