"""Targets that must stay undisturbed: meshes, procedural corals, the region of water round them, what is delicate.

- `target.py`: a target by name, and a mesh on its bed. `mesh.py`: triangle meshes and their files.
- `region.py`: weighted sample points of the region (quadrature of the disturbance).
- `corals.py`: procedural corals and soft targets, from signed distance fields (`fields.py`).
- `reef.py`: a procedural patch of reef, 2 x 2 m, from a height map.
- `fragility.py`: delicate features, found from the mesh or marked by a person.
- `elasticity.py`: bending of soft targets and their materials.
- `distance.py`: exact distance to a mesh; `rays.py`: first face on a ray.
"""

from wakewise.scene.targets.corals import coral, coral_kinds, soft_kinds, stony_kinds
from wakewise.scene.targets.distance import MeshDistance
from wakewise.scene.targets.elasticity import TISSUES, BendingModes, TissueProperties, turned_normals
from wakewise.scene.targets.fragility import Fragility, FragilityMarks, find_fragility, read_marks, read_vertex_scores
from wakewise.scene.targets.mesh import Mesh, load_mesh, read_mesh, write_mesh
from wakewise.scene.targets.region import DenseQuadrature, Region, region_measure, sample_region, sampling_error_pct
from wakewise.scene.targets.target import (
    Target,
    find_mesh,
    find_target,
    is_mesh_file,
    place_on_bed,
    procedural_kinds,
)

__all__ = [
    "TISSUES",
    "BendingModes",
    "DenseQuadrature",
    "Fragility",
    "FragilityMarks",
    "Mesh",
    "MeshDistance",
    "Region",
    "Target",
    "TissueProperties",
    "coral",
    "coral_kinds",
    "find_fragility",
    "find_mesh",
    "find_target",
    "is_mesh_file",
    "load_mesh",
    "place_on_bed",
    "procedural_kinds",
    "read_marks",
    "read_mesh",
    "read_vertex_scores",
    "region_measure",
    "sample_region",
    "sampling_error_pct",
    "soft_kinds",
    "stony_kinds",
    "turned_normals",
    "write_mesh",
]
