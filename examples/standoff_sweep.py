"""How far off should I fly to leave the water still and keep my place?"""

import sys

import matplotlib.pyplot as plt

import wakewise as ww

seconds = float(sys.argv[1]) if sys.argv[1:] else None  # of each flight; the whole mission if not given
standoffs_m = [float(word) for word in sys.argv[2:]] or [0.4, 0.5, 0.65, 0.8]
parts = ww.Scenario.preset("quick").parts()
figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for method in ("dp", "wake-aware"):
    flights = []
    for standoff_m in standoffs_m:
        flights.append(ww.fly(parts.replace(method=method, **{"mission.standoff_m": standoff_m}), duration_s=seconds))
        print(f"{standoff_m} m: {flights[-1]}")
    axes[0].plot(standoffs_m, [flight.figures["target_speed_mean_m_s"] for flight in flights], "o-", label=method)
    axes[1].plot(standoffs_m, [flight.figures["position_rmse_mm"] for flight in flights], "o-", label=method)
axes[0].set(xlabel="standoff (m)", ylabel="water at the target (m/s)", title="one seed: one draw of the water")
axes[1].set(xlabel="standoff (m)", ylabel="position error (mm)")
for panel in axes:
    panel.set_ylim(0)
    panel.legend()
figure.savefig("standoff_sweep.png", dpi=150)
