"""Thruster allocation: one wrench to n thrusts, exactly, for any layout.

An over-actuated vehicle has many sets of thrusts for one wrench: the null space of its allocation matrix. This room
finds the one that is best, the least thrusts (`pseudo_inverse`, `min_norm_allocation`) or those whose jets disturb a
target least (`min_wash_allocation`), with a proof of the minimum, within limits, with failed thrusters and priorities.
It knows arrays and errors only, so that it is a library of its own: nothing here knows what a vehicle or a wake is. D
comes in as the Gram matrix G of `s' G s`, where s are roots of thrusts.

Start reading in `allocate.py` (what is asked and answered). `layout.py` is the matrix and its null space,
`attainable_set.py` what the limits leave. The search for the minimum: `line_search.py` for one or two spare thrusts,
`branch_and_bound.py` with `coordinate_descent.py` for more, `convex.py` for the convex cost of effort alone.
`power_budget.py` bounds the electrical power.
"""

from wakewise.allocation.allocate import (
    Allocation,
    Layout,
    Weights,
    compile_layout,
    disturbance_of,
    min_norm_allocation,
    min_wash_allocation,
    pseudo_inverse,
)
from wakewise.allocation.power_budget import PowerBoundedAllocator, PowerLaw, best_by_power, power_adjusted_cost

__all__ = [
    "Allocation",
    "Layout",
    "PowerBoundedAllocator",
    "PowerLaw",
    "Weights",
    "best_by_power",
    "compile_layout",
    "disturbance_of",
    "min_norm_allocation",
    "min_wash_allocation",
    "power_adjusted_cost",
    "pseudo_inverse",
]
