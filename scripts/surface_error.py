"""Errors of probed surfaces against the probed points and against the twin's true ones, as JSON.

    python scripts/surface_error.py --output surface_error.json [--seeds 0,1,2] [--side left] [--fingers index,ring]
    [--voxel-mm 5] python scripts/surface_error.py --session SESSION --output surface_error.json          (no truth:
    probed points only)

true_*: distance [mm] of points spread evenly over the true surface from the mesh; mesh_*: of the mesh's vertices from
the true surface; both in the recorded palm frame, so that the error of the frame itself is part of them.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from hand_model import identify, twin
from hand_model.hand import Hand
from hand_model.identify.surface import Surface, distance_to_mesh, identify_surfaces, summary_mm
from hand_model.identify.surface.solid import volume
from hand_model.identify.surface.triangulate import has_open3d
from hand_model.session import Session, read_session
from hand_model.twin.truth import SurfaceTruth


def main() -> None:
    """Record, identify, measure, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--session", type=Path, help="a recorded session instead of the twin")
    parser.add_argument("--seeds", default="0,1,2")
    parser.add_argument("--side", default="left", choices=("left", "right"))
    parser.add_argument("--fingers", default="index,ring", help="that the twin records (default: index,ring)")
    parser.add_argument("--voxel-mm", type=float, default=5.0)
    options = parser.parse_args()
    rows = []
    if options.session:
        session = read_session(options.session)
        rows = _measured(session, identify(session), options.voxel_mm / 1e3, {}, None)
    else:
        for seed in (int(s) for s in options.seeds.split(",")):
            truth = twin.bebionic(options.side, seed, options.fingers.split(","))
            with tempfile.TemporaryDirectory() as folder:
                twin.record(truth, Path(folder) / "session", seed, (), twin.Plan(surfaces=("all",), excitations=1))
                session = read_session(Path(folder) / "session")
                true = {s.segment: s for s in truth.surfaces}
                rows += _measured(session, identify(session), options.voxel_mm / 1e3, true, seed)
    options.output.write_text(
        json.dumps({"format": "surface-error/1", "voxel_mm": options.voxel_mm, "surfaces": rows}, indent=1) + "\n"
    )
    for row in rows:
        print({key: round(v, 3) if isinstance(v, float) else v for key, v in row.items() if not isinstance(v, dict)})


def _measured(
    session: Session, hand: Hand, voxel_m: float, true: dict[str, SurfaceTruth], seed: int | None
) -> list[dict[str, Any]]:
    rows = []
    for pivoting in (True, False) if has_open3d() else (False,):
        for surface in identify_surfaces(session, hand, voxel_m, pivoting):
            row: dict[str, Any] = {"seed": seed, "segment": surface.segment, "found": surface.found, "how": surface.how}
            if surface.found:
                row |= {f"probed_{key}": value for key, value in surface.error} | {"repairs": dict(surface.repairs)}
                row |= against(surface, true[surface.segment]) if surface.segment in true else {}
            rows.append({**row, "notes": " ".join(surface.notes)})
    return rows


def against(surface: Surface, true: SurfaceTruth) -> dict[str, Any]:
    """Errors [mm] of a surface against the ellipsoid that was swept, and the ratio of the volumes."""
    turn = (np.arange(4000) + 0.5) * np.pi * (1 + 5**0.5)
    height = 1 - 2 * (np.arange(4000) + 0.5) / 4000
    ring = np.sqrt(1 - height**2)
    sphere = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
    # as many points per area everywhere: the sphere's are stretched by this much
    area = true.radii_m.prod() * np.linalg.norm(sphere / true.radii_m, axis=1)
    chosen = np.random.default_rng(0).choice(len(sphere), 3000, p=area / area.sum())
    points = (sphere[chosen] * true.radii_m) @ true.axes_palm + true.centre_palm
    there = summary_mm(distance_to_mesh(points, surface.vertices, surface.faces))
    back = summary_mm(_from_ellipsoid((surface.vertices - true.centre_palm) @ true.axes_palm.T, true.radii_m))
    ratio = volume(surface.vertices, surface.faces) / (4 / 3 * np.pi * true.radii_m.prod())
    return (
        {f"true_{k}": v for k, v in there.items()}
        | {f"mesh_{k}": v for k, v in back.items()}
        | {"volume_ratio": float(ratio)}
    )


def _from_ellipsoid(points: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Distances (n,) [m] of points (n, 3) [m] from an ellipsoid about the origin, by bisection on the foot's multiplier
    (Eberly 2013)."""
    p = np.abs(points)
    low, high = np.full(len(p), -(radii.min() ** 2) * (1 - 1e-9)), np.linalg.norm(p * radii, axis=1) + 1e-12
    for _ in range(100):
        middle = (low + high) / 2
        outside = ((radii * p / (middle[:, None] + radii**2)) ** 2).sum(1) > 1
        low, high = np.where(outside, middle, low), np.where(outside, high, middle)
    return np.linalg.norm(p - radii**2 * p / (middle[:, None] + radii**2), axis=1)


if __name__ == "__main__":
    main()
