"""Model predictive control (MPC, receding horizon): the motion and thrusts of the next two seconds.

`PlanProblem` is the question, `Horizon` the answer, `Planner` finds it: a majorised Gauss-Newton step, condensed to a
quadratic program in the thrusts, solved within a millisecond or two. A plan that is late, infeasible or bad is replaced
in `wakewise.control.failsafe`. Nothing here knows how a plan is flown: see `wakewise.control`.

- `problem.py`: the cost in symbols, the records, and the reference.
- `planner.py`: the iterations.
- `kernels.py`: compiled roll-out with derivatives, and the obstacle penalty.
- `qp.py`: the quadratic program, condensed and solved.
- `obstacles.py`: floor, walls, target and other obstacles, and the check of a start.
- `finite_difference.py`: D of wake models that the kernels do not know.
"""

from wakewise.planning.obstacles import Surroundings, check_start, covering_spheres
from wakewise.planning.planner import Planner
from wakewise.planning.problem import Horizon, PlanProblem, PlanSettings, state_of

__all__ = [
    "Horizon",
    "PlanProblem",
    "PlanSettings",
    "Planner",
    "Surroundings",
    "check_start",
    "covering_spheres",
    "state_of",
]
