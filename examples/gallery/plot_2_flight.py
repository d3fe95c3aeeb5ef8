"""
Thrusts, null space and disturbance of a flight
===============================================

The first half minute of the preset `quick`, flown twice in the same simulated water: with dynamic positioning (`dp`, a
PID with least thrusts) and with `wake-aware` (MPC with allocation in the null space).
"""

import matplotlib.pyplot as plt

import wakewise as ww

settings = {"vehicle": "bluerov2-heavy", "mission.settle_s": 3.0}
parts = ww.Scenario.preset("quick", seed=1, **settings).parts()
flights = {
    method: ww.fly(parts.replace(method=method), duration_s=30.0)
    for method in ("dp", "wake-aware")
}
for flight in flights.values():
    print(flight)

# %%
# Thrust of each thruster over time. Both make nearly the same motion.

figure, axes = plt.subplots(2, 1, figsize=(8, 6), sharex=True, layout="constrained")
for ax, (name, flight) in zip(axes, flights.items(), strict=True):
    ww.plot.thrusts(flight, limit_N=3.0, ax=ax).set_title(name)

# %%
# Coordinates of the thrusts in the null space. With `dp` they come from thruster limits, deadband and lag alone.

figure, axes = plt.subplots(
    2, 1, figsize=(8, 6), sharex=True, sharey=True, layout="constrained"
)
for ax, (name, flight) in zip(axes, flights.items(), strict=True):
    ww.plot.null_space(flight, ax=ax).set_title(name)

# %%
# The disturbance D that the controller predicts at the target, and the speed that the water really had there.

figure, axes = plt.subplots(2, 1, figsize=(8, 6), sharex=True, layout="constrained")
ww.plot.disturbance(flights, ax=axes[0])
ww.plot.disturbance(flights, measure="speed", ax=axes[1])
