"""
Wake models along and across a jet
==================================

The wake models that a controller can use, for one thruster of 76 mm diameter at 5 N. `paper` is the model of the paper
as printed: with its reference distance of 1 m it is far too fast near the thruster, so its speeds are printed below.
"""

import matplotlib.pyplot as plt
import numpy as np

import wakewise as ww

AREA_M2, THRUST_N = 0.25 * np.pi * 0.076**2, 5.0
distance = np.linspace(0.1, 1.5, 200)
figure, (along, across) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for name in ("jet", "fitted", "linear", "paper-calibrated"):
    model = ww.wake_model(name)
    along.plot(distance, model.speed(distance, 0.0 * distance, THRUST_N, AREA_M2), label=name)
    radius = np.linspace(0.0, 0.3, 200)
    across.plot(radius, model.speed(0.5 + 0.0 * radius, radius, THRUST_N, AREA_M2), label=name)
along.set(xlabel="distance along the axis (m)", ylabel="water speed (m/s)", title="on the axis", ylim=(0.0, None))
across.set(xlabel="distance from the axis (m)", title="0.5 m from the thruster", ylim=(0.0, None))
along.legend(frameon=False)

# %%
# The model as printed, on the axis:

paper = ww.wake_model("paper").speed(distance, 0.0 * distance, THRUST_N, AREA_M2)
for x in (0.2, 0.5, 1.0):
    print(f"{x:.1f} m: {np.interp(x, distance, paper):.1f} m/s")
