"""
Wash against energy for several methods
=======================================

Less wash costs energy. Each point is the first half minute of a flight, all in the same water: one seed, which is one
draw of vehicle, trim and start. Compare methods over several seeds before you choose one.
"""

import wakewise as ww

parts = ww.Scenario.preset("quick", seed=1, vehicle="bluerov2-heavy", **{"mission.settle_s": 3.0}).parts()
methods = ("dp", "allocation-only", "wake-aware")
flights = {method: ww.fly(parts.replace(method=method), duration_s=25.0) for method in methods}
ww.plot.wash_energy(flights)
