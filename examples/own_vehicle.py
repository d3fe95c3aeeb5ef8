"""What can my vehicle do, and how well does it fly?"""

import sys

import numpy as np

import wakewise as ww

name = sys.argv[1] if sys.argv[1:] else "bluerov2-heavy"  # or the path of a URDF, xacro, SDF, Stonefish or YAML file
vehicle = ww.load_vehicle(name)
thrusters, rank = len(vehicle.thrusters), np.linalg.matrix_rank(vehicle.allocation_matrix)
print(f"{vehicle.title}: {thrusters} thrusters, rank {rank} of 6, {thrusters - rank} thrusts to spare")
for k, spare in enumerate(vehicle.null_space.T, start=1):
    print(f"null space {k}, thrusts that cancel: {np.round(spare, 2)}")

parts = ww.Scenario.preset("quick", **{"mission.standoff_m": 0.8}).parts().replace(vehicle=vehicle)
print(f"hull's least clearance on the route: {parts.preflight.clearance_m:.2f} m")
print(ww.fly(parts, duration_s=float(sys.argv[2]) if sys.argv[2:] else None))
