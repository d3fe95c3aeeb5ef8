"""Vehicles of other projects: URDF, xacro, Gazebo SDF, Stonefish and YAML files read safely into drafts.

Files are read as data: nothing in them is executed, nothing outside their own folders is opened, and what they do not
say stays unsaid. Every fault is an `InputError` that names file and line.
"""

from wakewise.vehicles.importers.found import FRAME_CHOICES, THRUST_CHOICES
from wakewise.vehicles.importers.read import import_vehicle, read_matrix

__all__ = ["FRAME_CHOICES", "THRUST_CHOICES", "import_vehicle", "read_matrix"]
