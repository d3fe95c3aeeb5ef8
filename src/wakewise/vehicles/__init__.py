"""Vehicles: cited parameter files, what follows from their geometry, how they move in water, and how thrusters respond.

Body frame B is FRD. A positive thrust pushes the vehicle along the thruster's axis and sends the jet the other way.
"""

from wakewise.vehicles.actuators import electrical_power_W, saturate, scale_to_limits, thruster_lag
from wakewise.vehicles.check import (
    ARDUSUB_VECTORED_6DOF,
    WRENCH_AXES,
    MixingDisagreement,
    achievable_wrench,
    allocation_rank,
    failure_rank,
    mixing_disagreements,
    null_space_names,
)
from wakewise.vehicles.describe import describe
from wakewise.vehicles.drawing import drawing_svg
from wakewise.vehicles.dynamics import (
    RigidBody,
    acceleration,
    compile_body,
    coriolis_wrench,
    damping_wrench,
    restoring_wrench,
    rigid_body_mass,
    step_rk4,
)
from wakewise.vehicles.hydrodynamics import Hydrodynamics
from wakewise.vehicles.library import load_vehicle, vehicle_names
from wakewise.vehicles.perturbation import perturbed
from wakewise.vehicles.thruster import Thruster
from wakewise.vehicles.vehicle import Provenance, Vehicle

__all__ = [
    "ARDUSUB_VECTORED_6DOF",
    "WRENCH_AXES",
    "Hydrodynamics",
    "MixingDisagreement",
    "Provenance",
    "RigidBody",
    "Thruster",
    "Vehicle",
    "acceleration",
    "achievable_wrench",
    "allocation_rank",
    "compile_body",
    "coriolis_wrench",
    "damping_wrench",
    "describe",
    "drawing_svg",
    "electrical_power_W",
    "failure_rank",
    "load_vehicle",
    "mixing_disagreements",
    "null_space_names",
    "perturbed",
    "restoring_wrench",
    "rigid_body_mass",
    "saturate",
    "scale_to_limits",
    "step_rk4",
    "thruster_lag",
    "vehicle_names",
]
