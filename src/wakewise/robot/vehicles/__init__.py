"""Vehicles: cited parameter files, what follows from their geometry, and how they move in water (Fossen, 6 DOF).

Body frame B is FRD. A positive thrust pushes the vehicle along the thruster's axis and sends the jet the other way.

Start reading in `vehicle.py`, the record of a vehicle.

| concern | modules |
|---|---|
| parameter files | `library.py`, `library_data/` (a file per source), `vehicle_file.py`, `draft.py`, `completion.py` |
| equations of motion | `dynamics.py`; `fossen.py` as readable matrices, `kernels.py` and `semi_implicit.py` compiled |
| derivatives, many vehicles at once | `jacobians.py`, `batch.py` |
| rank, null space, wrong signs | `check.py`, `mixing.py`; in words: `describe.py` |
| the vehicle that the tank flies | `perturbation.py` |
| floats and lead | `ballast.py` |

Thrusters are in `wakewise.robot.thrusters`, readers of other projects' files in `wakewise.robot.importers`.
"""

from wakewise.robot.vehicles.batch import pack_bodies, step_batch
from wakewise.robot.vehicles.check import (
    achievable_wrench,
    actuation,
    allocation_rank,
    failure_rank,
    failures,
    null_space_names,
)
from wakewise.robot.vehicles.completion import blank_fields, completed, plausible, unit_of
from wakewise.robot.vehicles.describe import ParameterRow, check_report, describe, parameters, summary_line
from wakewise.robot.vehicles.draft import ThrusterDraft, VehicleDraft
from wakewise.robot.vehicles.dynamics import (
    RigidBody,
    acceleration,
    compile_body,
    coriolis_wrench,
    damping_wrench,
    restoring_wrench,
    step_rk4,
    step_semi_implicit,
)
from wakewise.robot.vehicles.hydrodynamics import DragCase, Hydrodynamics
from wakewise.robot.vehicles.jacobians import acceleration_jacobians, step_rk4_jacobians, step_semi_implicit_jacobians
from wakewise.robot.vehicles.library import draft_names, draft_yaml, load_draft, load_vehicle, vehicle_names
from wakewise.robot.vehicles.mixing import (
    ARDUSUB_VECTORED,
    ARDUSUB_VECTORED_6DOF,
    compare_matrix,
    compare_with_ardusub,
    mixing_disagreements,
)
from wakewise.robot.vehicles.perturbation import drag_coefficients, perturbed, possible_drags, with_drag, with_each_drag
from wakewise.robot.vehicles.vehicle import TiltJoint, Vehicle

__all__ = [
    "ARDUSUB_VECTORED",
    "ARDUSUB_VECTORED_6DOF",
    "DragCase",
    "Hydrodynamics",
    "ParameterRow",
    "RigidBody",
    "ThrusterDraft",
    "TiltJoint",
    "Vehicle",
    "VehicleDraft",
    "acceleration",
    "acceleration_jacobians",
    "achievable_wrench",
    "actuation",
    "allocation_rank",
    "blank_fields",
    "check_report",
    "compare_matrix",
    "compare_with_ardusub",
    "compile_body",
    "completed",
    "coriolis_wrench",
    "damping_wrench",
    "describe",
    "draft_names",
    "draft_yaml",
    "drag_coefficients",
    "failure_rank",
    "failures",
    "load_draft",
    "load_vehicle",
    "mixing_disagreements",
    "null_space_names",
    "pack_bodies",
    "parameters",
    "perturbed",
    "plausible",
    "possible_drags",
    "restoring_wrench",
    "step_batch",
    "step_rk4",
    "step_rk4_jacobians",
    "step_semi_implicit",
    "step_semi_implicit_jacobians",
    "summary_line",
    "unit_of",
    "vehicle_names",
    "with_drag",
    "with_each_drag",
]
