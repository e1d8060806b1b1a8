"""Sweeps -> Surfaces: one watertight mesh and its convex parts per probed segment."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...errors import IdentificationError
from ...hand import Hand
from ...session import Probe, Session, Trial
from ..probe import calibrated_probe
from .distance import distance_to_mesh, summary_mm
from .mend import mended
from .refine import refined
from .solid import CLOSED, closed, convex_parts
from .sweep import Cloud, resampled, swept
from .triangulate import triangulated

if TYPE_CHECKING:
    from ..identification import Identification

Array = NDArray[np.float64]
Faces = NDArray[np.int64]
Mesh = tuple[Array, Faces]

VOXEL_M = 0.005  # distance of the resampled points, as in the thesis


@dataclass(frozen=True)
class Surface:
    """A probed surface in the palm frame at rest. segment: "palm" or "<finger>/<joint>".

    vertices: (v, 3) [m], faces: (f, 3) counter-clockwise from outside, watertight; both empty where the sweep holds too
    little. parts: convex meshes for contact. how: what was done, by the names of methods. repairs: defect -> how often.
    error: distances [mm] of the probed points from the mesh. notes: one sentence each.
    """

    segment: str
    vertices: Array
    faces: Faces
    parts: tuple[Mesh, ...] = ()
    how: str = ""
    repairs: tuple[tuple[str, int], ...] = ()
    error: tuple[tuple[str, float], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def found(self) -> bool:
        """Whether the sweep gave a surface."""
        return len(self.faces) > 0

    def table(self) -> dict[str, Any]:
        """The surface as JSON can hold it, the way a Hand carries it in `extra["surfaces"]`."""
        return {
            **_plain((self.vertices, self.faces)),
            "parts": [_plain(part) for part in self.parts],
            "how": self.how,
            "repairs": dict(self.repairs),
            "error": dict(self.error),
        }


def identify_surfaces(
    session: Session, identified: Identification | Hand, voxel_m: float = VOXEL_M, pivoting: bool | None = None
) -> tuple[Surface, ...]:
    """Surfaces of all segments that the session's `surface` trials sweep, in the palm frame of the identified hand at
    rest.

    voxel_m: distance [m] to which the tip's path is resampled. pivoting: ball pivoting by Open3D (the extra `surface`),
    or the built-in Delaunay carving; None: what is installed. Trials for validation are left out. A segment whose
    sweeps hold too little comes back empty with a note that says so. Raises IdentificationError where the probe or the
    palm is unknown.
    """
    hand = identified if isinstance(identified, Hand) else identified.hand
    trials: dict[str, list[Trial]] = {}
    for trial in session.select("surface", validate=False):
        trials.setdefault(str(trial.segment), []).append(trial)
    if not trials:
        return ()
    probe = calibrated_probe(session)
    if probe is None or session.palm is None:
        raise IdentificationError(f"{session.path}: surface trials need [probe] and [palm] in the manifest")
    known = {"palm", *(f"{f.name}/{j.name}" for f in hand.fingers for j in f.joints)}
    return tuple(_surface(s, t, session, probe, hand, voxel_m, pivoting) for s, t in trials.items() if s in known)


def with_surfaces(hand: Hand, surfaces: Iterable[Surface]) -> Hand:
    """The hand with its surfaces in `extra["surfaces"]`, and their notes among its own."""
    found = tuple(surfaces)
    tables = {s.segment: s.table() for s in found if s.found}
    if not found:
        return hand
    extra = {**hand.extra, **({"surfaces": tables} if tables else {})}
    return replace(hand, extra=extra, notes=(*hand.notes, *(note for s in found for note in s.notes)))


def _surface(
    segment: str, trials: list[Trial], session: Session, probe: Probe, hand: Hand, voxel_m: float, pivoting: bool | None
) -> Surface:
    from scipy.spatial import QhullError

    try:
        return _from_cloud(segment, resampled(*swept(trials, session, probe, hand), voxel_m), voxel_m, pivoting)
    except IdentificationError as error:
        reason = str(error)
    except QhullError:  # all points on one plane to the last digit, or on one line
        reason = "its points enclose no volume"
    note = f"{segment}: no surface, shape and inertia stay the fallback's ({reason})"
    return Surface(segment, np.zeros((0, 3)), np.zeros((0, 3), np.int64), notes=(note,))


def _from_cloud(segment: str, cloud: Cloud, voxel_m: float, pivoting: bool | None) -> Surface:
    faces, method = triangulated(cloud.points_palm, cloud.normals, voxel_m, pivoting)
    vertices, faces, normals, repairs = mended(cloud.points_palm, faces, cloud.normals)
    vertices, faces = refined(vertices, faces, normals)
    vertices, faces, closing = closed(vertices, faces, cloud.points_palm, voxel_m)
    parts, split = convex_parts(vertices, faces, voxel_m)
    error = summary_mm(distance_to_mesh(cloud.raw_palm, vertices, faces))
    repairs = {"outliers": cloud.dropped, **repairs}
    how = f"{len(cloud.points_palm)} points {voxel_m * 1e3:g} mm apart; {method}; {closing}; contact: {split}"
    notes = () if closing == CLOSED else (f"{segment}: the sweep leaves the surface open; {closing}",)
    return Surface(segment, vertices, faces, parts, how, tuple(repairs.items()), tuple(error.items()), notes)


def _plain(mesh: Mesh) -> dict[str, Any]:
    return {"vertices": mesh[0].tolist(), "faces": mesh[1].tolist()}
