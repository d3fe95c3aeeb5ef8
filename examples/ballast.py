"""How much ballast, and where, keeps the target's water stillest?"""

import sys

import wakewise as ww
from wakewise.control.ballast_advice import ballasted, net_buoyancy_N, trim_advice

parts = ww.Scenario.preset("quick", world="tank", vehicle=sys.argv[1] if sys.argv[1:] else "paper", method="dp").parts()
times = parts.route.exposures_s[:: len(parts.route.exposures_s) // 12]
poses = tuple(parts.route.body(time, parts.aim).X_WB for time in times)
advice = trim_advice(
    parts.vehicle, poses, parts.region, parts.wake, unknown_N=parts.scenario.tank.mismatch.trim_range_N
)
print(f"by the wake model, {len(poses)} poses held: {advice.words}")

# A wake model knows neither walls nor what comes round again: ask the simulated tank, too.
added_N = advice.best.float_N - net_buoyancy_N(parts.vehicle)
advised = ballasted(parts.vehicle, added_N, advice.best.shift_mm)
for name, vehicle in (("as it is", parts.vehicle), ("as advised", advised)):
    print(f"{name}: {ww.fly(parts.replace(vehicle=vehicle), duration_s=float(sys.argv[2]) if sys.argv[2:] else None)}")
