"""
Wake of one wrench, with least and with gentle thrusts
======================================================

Eight thrusters make the same force in many ways. The minimum-norm allocation sends a jet through the target. The
allocation of minimum wash uses the null space and sends it past.
"""

import matplotlib.pyplot as plt

import wakewise as ww

parts = ww.Scenario.preset("quick", vehicle="bluerov2-heavy").parts()
rov, region = parts.vehicle, parts.region
pose = [-0.6, 0.0, 1.3, 0.0, 0.0, 0.6]  # north, east, down (m), roll, pitch, yaw (rad)
wrench = [-8, 0, 2, 0, 0, 0]  # 8 N astern and 2 N down
thrusts = {
    "least thrusts": ww.allocate(rov, wrench).thrusts_N,
    "gentle thrusts": ww.allocate(rov, wrench, pose, region).thrusts_N,
}

# %%
# White points stand for the water that is spared, the white outline for the vehicle.

figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for ax, (name, T) in zip(axes, thrusts.items(), strict=True):
    ww.plot.wake_field(rov, T, pose, region=region, ax=ax).set_title(name)

# %%
# The disturbance D of each, in (m/s)² summed over the region, and the norm of the thrusts:

for name, T in thrusts.items():
    D = ww.disturbance(rov, T, pose, region)
    print(f"{name}: D {D:.4f}, norm {(T @ T) ** 0.5:.1f} N")

# %%
# The same water in the vertical plane through the vehicle:

ww.plot.wake_field(
    rov, thrusts["gentle thrusts"], pose, region=region, plane="vertical"
).set_title("gentle thrusts")
