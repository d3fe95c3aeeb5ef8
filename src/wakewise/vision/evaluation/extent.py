"""Area and volume of what of a mesh stands clear of the bed: what biologists ask of a coral, and ask to repeat."""

from __future__ import annotations

import numpy as np

from wakewise.vision.evaluation.cloud_to_surface import Crop, MeshArrays


def area_and_volume(mesh: MeshArrays, crop: Crop) -> tuple[float, float]:
    """Area in m2 and volume in m3 of the part of a mesh that counts; zeros where none does.

    The volume is the flux of (0, 0, z - z0) through the surface, z0 the height at which it is cut: of that field the
    divergence is 1 and the flux through the cut is zero, so a mesh that is open there needs no lid. A mesh that is
    closed is cut likewise. Faces are counter-clockwise seen from outside; without a bed z0 is the lowest corner.

    Parameters
    ----------
    mesh : MeshArrays
        In the world, z down.
    crop : Crop
        Its bed says what counts; its box does not cut.
    """
    corners = mesh.vertices_m[mesh.faces]
    if crop.bed_z_m is None:
        cut_m, kept = float(corners[:, :, 2].max(initial=-np.inf)), corners
    else:
        cut_m = crop.bed_z_m - crop.clearance_m
        kept = corners[crop.above_bed(corners.mean(axis=1))]
    if len(kept) == 0:
        return 0.0, 0.0
    normal = 0.5 * np.cross(kept[:, 1] - kept[:, 0], kept[:, 2] - kept[:, 0])  # as long as the face's area
    area = float(np.linalg.norm(normal, axis=1).sum())
    volume = float(((kept[:, :, 2].mean(axis=1) - cut_m) * normal[:, 2]).sum())
    return area, abs(volume)
