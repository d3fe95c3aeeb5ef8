"""What must stay undisturbed: meshes from files, procedural corals, a target on the bed, the region round it.

Delicate features are found from the mesh or marked by a person, and may count more in the region than the rest.

Start reading in `target.py` (a mesh on its bed), `target.py` (a target by name) and `region.py` (points that stand for
its water). `corals.py` and `corals.py` with `fields.py` grow corals, `mesh.py` reads files, `region.py` spreads points,
`distance.py` and `rays.py` measure, `fragility.py` and `fragility.py` say what is delicate. `elasticity.py` with
`elasticity.py` says how a soft one bends, `elasticity.py` what it is made of.
"""

from wakewise.scene.targets.corals import coral, coral_kinds, soft_kinds, stony_kinds
from wakewise.scene.targets.distance import MeshDistance
from wakewise.scene.targets.elasticity import TISSUES, BendingModes, TissueProperties, turned_normals
from wakewise.scene.targets.fragility import Fragility, FragilityMarks, find_fragility, read_marks, read_vertex_scores
from wakewise.scene.targets.mesh import Mesh, load_mesh, read_mesh, write_mesh
from wakewise.scene.targets.region import DenseQuadrature, Region, region_measure, sample_region, sampling_error_pct
from wakewise.scene.targets.target import Target, find_mesh, find_target, is_mesh_file, place_on_bed

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
