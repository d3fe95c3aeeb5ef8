"""Which thrusts make one wrench without blowing on the target?"""

import sys

import matplotlib.pyplot as plt

import wakewise as ww

parts = ww.Scenario.preset("quick", vehicle="bluerov2-heavy").parts()
rov, region = parts.vehicle, parts.region
pose = [-0.6, 0.0, 1.3, 0.0, 0.0, 0.6]  # north, east, down (m), roll, pitch, yaw (rad): the target lies off the bow
wrench = [-8, 0, 2, 0, 0, 0]  # 8 N astern and 2 N down (N, N m)
found = {"least": ww.allocate(rov, wrench), "gentle": ww.allocate(rov, wrench, pose, region)}

figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for k, (name, allocation) in enumerate(found.items()):
    D = ww.disturbance(rov, allocation.thrusts_N, pose, region)
    mm_s = 1e3 * (D / region.weights.sum()) ** 0.5
    print(f"{name}: {allocation.thrusts_N.round(2)} N, {mm_s:.1f} mm/s at the target by the wake model")
    places = [i + 0.4 * k for i in range(1, len(rov.thrusters) + 1)]
    axes.bar(places, allocation.thrusts_N, 0.4, label=f"{name}: {mm_s:.1f} mm/s at the target")
axes.set(xlabel="thruster", ylabel="thrust (N)", title=f"The same wrench from the {rov.name}")
axes.legend()
figure.savefig(sys.argv[1] if sys.argv[1:] else "one_wrench.png", dpi=150)
