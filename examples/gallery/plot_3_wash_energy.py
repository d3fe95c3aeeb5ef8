"""
Wash against energy
===================

Less wash costs energy. Each point is the first half minute of a flight, both in the same water. One seed is one draw of
vehicle, trim and start: compare methods over several seeds before you choose one.
"""

import wakewise as ww

parts = ww.Scenario.preset(
    "quick", seed=1, vehicle="bluerov2-heavy", **{"mission.settle_s": 3.0}
).parts()
flights = {
    method: ww.fly(parts.replace(method=method), duration_s=30.0)
    for method in ("dp", "wake-aware")
}
ww.plot.wash_energy(flights)
