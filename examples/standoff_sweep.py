"""How far off should I fly to leave the water still and keep my place?"""

import sys

import matplotlib.pyplot as plt

import wakewise as ww

seconds = float(sys.argv[1]) if sys.argv[1:] else None  # of each flight; the whole mission if not given
standoffs_m = [float(word) for word in sys.argv[2:]] or [0.4, 0.5, 0.65, 0.8]
parts = ww.Scenario.preset("quick").parts()
figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for method in ("dp", "wake-aware"):
    flights = [
        ww.fly(parts.replace(method=method, **{"mission.standoff_m": standoff_m}), duration_s=seconds).figures
        for standoff_m in standoffs_m
    ]
    for panel, key in zip(axes, ("target_speed_mean_m_s", "position_rmse_mm"), strict=True):
        values = [figures[key] for figures in flights]
        print(method, key, dict(zip(standoffs_m, values, strict=True)))
        panel.plot(standoffs_m, values, "o-", label=method)
        panel.set(xlabel="standoff (m)", ylabel=key, ylim=(0, None), title="one seed: one draw of the water")
axes[0].legend()
figure.savefig("standoff_sweep.png", dpi=150)
