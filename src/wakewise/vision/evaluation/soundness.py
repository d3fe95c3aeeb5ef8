"""Faults of a mesh that figures suffer from: faces that come twice, edges of many faces, faces without area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.vision.evaluation.cloud_to_surface import MeshArrays


@dataclass(frozen=True, kw_only=True)
class MeshFaults:
    """Counts, of a mesh whose corners at one place are one.

    duplicate_faces: faces beyond the first over the same three corners, whichever way round. crowded_edges: edges of
    three and more faces, where no surface has an inside (non-manifold); duplicates count as one face. flat_faces:
    without area. open_edges: edges of one face, as at the rim of a scan.
    """

    duplicate_faces: int
    crowded_edges: int
    flat_faces: int
    open_edges: int

    def words(self) -> list[str]:
        """What is wrong and what it does to the figures; a rim is nothing wrong."""
        out = []
        if self.duplicate_faces:
            out.append(f"{self.duplicate_faces} faces come twice, their area counts twice in completeness")
        if self.crowded_edges:
            out.append(f"{self.crowded_edges} edges belong to more than two faces (non-manifold): there is no inside")
        if self.flat_faces:
            out.append(f"{self.flat_faces} faces have no area and count for nothing")
        return out


def mesh_faults(mesh: MeshArrays) -> MeshFaults:
    """Count the faults of a mesh."""
    _, number = np.unique(np.asarray(mesh.vertices_m), axis=0, return_inverse=True)
    faces = np.sort(number.reshape(-1)[np.asarray(mesh.faces)], axis=1)
    flat = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2])
    once = np.unique(faces[~flat], axis=0)
    edges = np.concatenate([once[:, [0, 1]], once[:, [1, 2]], once[:, [0, 2]]])
    count = np.unique(edges, axis=0, return_counts=True)[1] if len(edges) else np.zeros(0, dtype=np.int64)
    return MeshFaults(
        duplicate_faces=int((~flat).sum()) - len(once),
        crowded_edges=int((count > 2).sum()),
        flat_faces=int(flat.sum()),
        open_edges=int((count == 1).sum()),
    )
