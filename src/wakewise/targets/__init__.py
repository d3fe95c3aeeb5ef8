"""What must stay undisturbed: meshes from files, procedural corals, a target on the bed, and the region round it."""

from wakewise.targets.corals import coral, coral_kinds
from wakewise.targets.distance import MeshDistance
from wakewise.targets.mesh import Mesh, load_mesh, read_mesh, write_mesh
from wakewise.targets.region import Region, sample_region
from wakewise.targets.target import Target, place_on_bed

__all__ = [
    "Mesh",
    "MeshDistance",
    "Region",
    "Target",
    "coral",
    "coral_kinds",
    "load_mesh",
    "place_on_bed",
    "read_mesh",
    "sample_region",
    "write_mesh",
]
