"""Vehicles: cited parameter files, what follows from their geometry, how they move in water, and how thrusters respond.

Body frame B is FRD. A positive thrust pushes the vehicle along the thruster's axis and sends the jet the other way.
"""

from wakewise.vehicles.actuators import electrical_power_W, saturate, scale_to_limits, thruster_lag
from wakewise.vehicles.check import (
    WRENCH_AXES,
    achievable_wrench,
    actuation,
    allocation_rank,
    failure_rank,
    failures,
    null_space_names,
)
from wakewise.vehicles.describe import check_report, describe, summary_line
from wakewise.vehicles.draft import CurveChoice, ThrusterDraft, VehicleDraft
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
    step_semi_implicit,
)
from wakewise.vehicles.energy import Energy, Power, mechanical_energy, mechanical_power
from wakewise.vehicles.find import compare_with, find_vehicle
from wakewise.vehicles.hydrodynamics import Hydrodynamics
from wakewise.vehicles.jacobians import (
    AccelerationJacobians,
    LinearisedStep,
    acceleration_jacobians,
    step_rk4_jacobians,
    step_semi_implicit_jacobians,
)
from wakewise.vehicles.lag_fit import LagFit, identify_lag
from wakewise.vehicles.library import draft_names, draft_yaml, load_draft, load_vehicle, vehicle_names
from wakewise.vehicles.mixing import (
    ARDUSUB_VECTORED,
    ARDUSUB_VECTORED_6DOF,
    Comparison,
    Disagreement,
    compare_matrix,
    compare_with_ardusub,
    mixing_disagreements,
)
from wakewise.vehicles.page import vehicle_page
from wakewise.vehicles.parameters import Parameter, parameters
from wakewise.vehicles.perturbation import perturbed
from wakewise.vehicles.rotor_lag import (
    FirstOrderLag,
    LagModel,
    RotorLag,
    SecondOrderLag,
    SplitLag,
    delay_step,
)
from wakewise.vehicles.step_file import read_step
from wakewise.vehicles.thrust_curve import CurveSide, ThrustCurve, curve_names, library_curve, load_curve
from wakewise.vehicles.thrust_drawing import curve_svg
from wakewise.vehicles.thrust_table import read_thrust_table
from wakewise.vehicles.thruster import Thruster
from wakewise.vehicles.thruster_facts import curve_facts, lag_facts
from wakewise.vehicles.vehicle import Provenance, Vehicle

__all__ = [
    "ARDUSUB_VECTORED",
    "ARDUSUB_VECTORED_6DOF",
    "WRENCH_AXES",
    "AccelerationJacobians",
    "Comparison",
    "CurveChoice",
    "CurveSide",
    "Disagreement",
    "Energy",
    "FirstOrderLag",
    "Hydrodynamics",
    "LagFit",
    "LagModel",
    "LinearisedStep",
    "Parameter",
    "Power",
    "Provenance",
    "RigidBody",
    "RotorLag",
    "SecondOrderLag",
    "SplitLag",
    "ThrustCurve",
    "Thruster",
    "ThrusterDraft",
    "Vehicle",
    "VehicleDraft",
    "acceleration",
    "acceleration_jacobians",
    "achievable_wrench",
    "actuation",
    "allocation_rank",
    "check_report",
    "compare_matrix",
    "compare_with",
    "compare_with_ardusub",
    "compile_body",
    "coriolis_wrench",
    "curve_facts",
    "curve_names",
    "curve_svg",
    "damping_wrench",
    "delay_step",
    "describe",
    "draft_names",
    "draft_yaml",
    "drawing_svg",
    "electrical_power_W",
    "failure_rank",
    "failures",
    "find_vehicle",
    "identify_lag",
    "lag_facts",
    "library_curve",
    "load_curve",
    "load_draft",
    "load_vehicle",
    "mechanical_energy",
    "mechanical_power",
    "mixing_disagreements",
    "null_space_names",
    "parameters",
    "perturbed",
    "read_step",
    "read_thrust_table",
    "restoring_wrench",
    "rigid_body_mass",
    "saturate",
    "scale_to_limits",
    "step_rk4",
    "step_rk4_jacobians",
    "step_semi_implicit",
    "step_semi_implicit_jacobians",
    "summary_line",
    "thruster_lag",
    "vehicle_names",
    "vehicle_page",
]
