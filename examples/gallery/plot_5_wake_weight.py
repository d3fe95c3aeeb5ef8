"""
Weight of wash in the allocation
================================

`w_disturbance` sets how much thrust may be spent to spare the target. Each point is the exact minimum for one weight,
for the same wrench and pose. The curve is the Pareto front: no allocation of this wrench lies below it.
"""

import matplotlib.pyplot as plt
import numpy as np

import wakewise as ww

parts = ww.Scenario.preset("quick", vehicle="bluerov2-heavy").parts()
rov, region, pose, wrench = (
    parts.vehicle,
    parts.region,
    [-0.6, 0.0, 1.3, 0.0, 0.0, 0.6],
    [-8, 0, 2, 0, 0, 0],
)
norms, speeds = [], []
for weight in np.geomspace(1e2, 1e6, 30):
    T = ww.allocate(
        rov, wrench, pose, region, w_disturbance=weight, w_effort=1.0, w_previous=0.0
    ).thrusts_N
    norms.append((T @ T) ** 0.5)
    speeds.append(
        1e3 * (ww.disturbance(rov, T, pose, region) / region.weights.sum()) ** 0.5
    )

figure, ax = plt.subplots(layout="constrained")
ax.plot(norms, speeds, ".-")
ax.set(
    xlabel="norm of the thrusts (N)",
    ylabel="rms water speed at the target by the wake model (mm/s)",
)
ax.set_ylim(bottom=0.0)
