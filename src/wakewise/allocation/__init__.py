"""Control allocation: a wrench to n thrusts through the allocation matrix and its null space, for any thruster layout.

An over-actuated vehicle has many thrusts for one wrench. This package computes the least thrusts (pseudo-inverse), or
those of least disturbance (`min_wash_allocation`) with a proof of the global minimum, within limits, with failed
thrusters and axis priorities. It depends on arrays and errors only. The disturbance enters as the Gram matrix G of
s' G s, where s are square roots of thrusts.

- `allocate.py`: the functions and their results; the convex case (incoherent sum, diagonal G).
- `layout.py`: allocation matrix B, pseudo-inverse, null space, largest feasible share of a wrench, axis priorities.
- `line_search.py`: exact minimum along a line of the null space, multistart descent along coupled ones.
- `branch_and_bound.py`: global minimum with a proven gap.
- `power_budget.py`: null-space allocation within a bound on electrical power.
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
