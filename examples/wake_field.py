"""What do a vehicle's jets do to the water round a target, with the least thrusts and with the gentle ones?"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import wakewise as ww

parts = ww.Scenario.preset("quick", vehicle="bluerov2-heavy").parts()
rov, region, pose = parts.vehicle, parts.region, [-0.6, 0.0, 1.3, 0.0, 0.0, 0.6]  # m and rad, as in one_wrench.py
wrench = [-8, 0, 2, 0, 0, 0]  # 8 N astern and 2 N down
thrusts = {"least": ww.allocate(rov, wrench).thrusts_N, "gentle": ww.allocate(rov, wrench, pose, region).thrusts_N}

x, y = np.meshgrid(np.linspace(-1.4, 0.8, 111), np.linspace(-1.0, 1.0, 101))
level = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, pose[2])])  # at the vehicle's depth
figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
for panel, (name, T) in zip(axes, thrusts.items(), strict=True):
    water = ww.velocity(rov, T, pose, level).reshape(*x.shape, 3)  # m/s: north, east, down
    speed = panel.contourf(y, x, 100 * np.linalg.norm(water, axis=2), levels=np.linspace(0, 30, 16), extend="max")
    panel.plot(region.points_W_m[:, 1], region.points_W_m[:, 0], ".", color="white", markersize=2)
    panel.set(aspect="equal", xlabel="east (m)", title=f"{name} thrusts: {np.abs(T).sum():.0f} N in all")
axes[0].set_ylabel("north (m)")
figure.colorbar(speed, ax=axes, label="speed of the water by the wake model (cm/s)")
figure.savefig(sys.argv[1] if sys.argv[1:] else "wake_field.png", dpi=150)
