"""What must stay undisturbed: meshes from files, procedural corals, a target on the bed, the region round it.

Delicate features are found from the mesh or marked by a person, and may count more in the region than the rest.

Start reading in `target.py` (a mesh on its bed), `find.py` (a target by name) and `region.py` (points that stand for
its water). `corals.py` with `fields.py` grows corals, `mesh.py` reads files, `sampling.py` spreads points,
`distance.py` and `rays.py` measure, `delicate.py` and `marks.py` say what is delicate.
"""

from wakewise.targets.corals import coral, coral_kinds
from wakewise.targets.delicate import Delicacy, delicacy
from wakewise.targets.distance import MeshDistance
from wakewise.targets.find import find_target
from wakewise.targets.marks import Marks, read_marks, read_vertex_scores
from wakewise.targets.mesh import Mesh, load_mesh, read_mesh, write_mesh
from wakewise.targets.region import Measure, Region, region_measure, sample_region
from wakewise.targets.sampling import sampling_error_pct
from wakewise.targets.target import Target, place_on_bed

__all__ = [
    "Delicacy",
    "Marks",
    "Measure",
    "Mesh",
    "MeshDistance",
    "Region",
    "Target",
    "coral",
    "coral_kinds",
    "delicacy",
    "find_target",
    "load_mesh",
    "place_on_bed",
    "read_marks",
    "read_mesh",
    "read_vertex_scores",
    "region_measure",
    "sample_region",
    "sampling_error_pct",
    "write_mesh",
]
