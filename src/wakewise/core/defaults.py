"""Defaults of an allocation, here and nowhere else: flights, `wakewise allocate`, `ww.allocate` and the ROS node.

Numbers only, so that a command's help can show them before any library is imported.
"""

DISTURBANCE_WEIGHT = 150.0
"""Weight of the mean square speed at the target, D over the sum of the region's weights, per (m/s)^2."""
EFFORT_WEIGHT = 1e-3
"""Weight of squared thrusts, per N^2."""
CHANGE_WEIGHT = 0.0
"""Weight of the squared change from the thrusts before, per N^2, where one wrench is shared out by itself."""
BUDGET = 2000
"""Most boxes that branch and bound looks at: a few milliseconds with two spare thrusters."""
