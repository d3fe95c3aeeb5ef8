"""
Wake models along and across a jet
==================================

The wake models that a controller can use, for one thruster of 76 mm diameter at 5 N. `paper` is the model of the paper
as printed: with its reference distance of 1 m it is far too fast near the thruster, so its speeds are printed below.
"""

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

import wakewise as ww

AREA_M2, THRUST_N = 0.25 * np.pi * 0.076**2, 5.0


def speed(
    name: str, along_m: NDArray[np.float64], across_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Water speed (m/s) of a jet along north; speed grows with the square root of thrust."""
    points = np.column_stack([along_m, across_m, np.zeros(len(along_m))])
    north = np.array([[1.0, 0.0, 0.0]])
    of_root = ww.wake_model(name).unit_velocity(
        points, np.zeros((1, 3)), north, np.array([AREA_M2])
    )
    return np.asarray(THRUST_N**0.5 * np.linalg.norm(of_root[0], axis=1))


distance, radius = np.linspace(0.1, 1.5, 200), np.linspace(0.0, 0.3, 200)
figure, (along, across) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for name in ("jet", "fitted", "linear", "paper-calibrated"):
    along.plot(distance, speed(name, distance, 0.0 * distance), label=name)
    across.plot(radius, speed(name, 0.5 + 0.0 * radius, radius), label=name)
along.set(
    xlabel="distance along the axis (m)",
    ylabel="water speed (m/s)",
    title="on the axis",
    ylim=(0.0, None),
)
across.set(
    xlabel="distance from the axis (m)",
    title="0.5 m from the thruster",
    ylim=(0.0, None),
)
along.legend(frameon=False)

# %%
# The model as printed, on the axis:

for x in (0.2, 0.5, 1.0):
    print(f"{x:.1f} m: {speed('paper', np.array([x]), np.zeros(1))[0]:.1f} m/s")
