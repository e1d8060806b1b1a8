"""Surfaces from probe sweeps: resampled, triangulated, mended, closed, split into convex parts."""

from .distance import distance_to_mesh, summary_mm
from .surface import VOXEL_M, Surface, identify_surfaces, with_surfaces

__all__ = ["VOXEL_M", "Surface", "distance_to_mesh", "identify_surfaces", "summary_mm", "with_surfaces"]
