"""Vehicles from other projects' files: URDF and xacro, SDF, Stonefish, allocation matrices.

Nothing of a file is executed, and nothing outside what it names is read. What could not be found is missing and said,
never guessed.

Start reading in `read.py` (`import_vehicle`: which reader takes a file) and `find.py` (a vehicle by library name, by
path, by format). Readers: `urdf.py`, `sdf.py`, `stonefish.py` with `stonefish.py`, `matrices.py` and
`safe_yaml_nodes.py` with `yaml_parameters.py`; formats from outside are found through the entry points
`wakewise.vehicle_formats`. Their helpers: `thruster_lists.py` and `thruster_lists.py` (thrusters in lists, with
`angles.py`), `wrench_rows.py` (what the rows of a matrix are), `thruster_checks.py` (what thrusters' names say),
`matrices.py` (keys that no reader took) and `thruster_checks.py` (what any vehicle must fulfil), `xacro*.py`,
`expressions.py` and `xacro_text.py` expand macros, `xml.py` and `packages.py` find files, `robot_description.py`,
`gazebo_thrusters.py` with `gazebo_thrusters.py`, `yaml_parameters.py`, `robot_description.py` and `parsed_vehicle.py`
put a vehicle together, `find.py` reads the matrix that a file states, to be held against its geometry.
"""

from wakewise.robot.importers.find import any_vehicle, compare_with, find_vehicle
from wakewise.robot.importers.read import import_vehicle, read_matrix

__all__ = [
    "any_vehicle",
    "compare_with",
    "find_vehicle",
    "import_vehicle",
    "read_matrix",
]
