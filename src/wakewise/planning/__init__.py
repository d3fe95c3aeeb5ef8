"""Model predictive control (MPC, receding horizon): the motion and thrusts of the next two seconds.

`PlanProblem` is the question, `Horizon` the answer, `Planner` finds it: a majorised Gauss-Newton step, condensed to a
quadratic program in the thrusts, solved within a millisecond or two. A plan that is late, infeasible or bad is
replaced in `wakewise.control.failsafe`.

Start reading in `problem.py` (the cost in symbols), then `planner.py` (the iterations). `kernels.py` rolls the horizon
out with derivatives, `condensing.py` makes the quadratic program, `qp.py` solves it, `barrier.py` and `surroundings.py`
keep it clear of floor, walls and target, `reference.py` is the reference along the way. `numeric.py` adds D for wake
models that the kernels do not know. Nothing here knows how a plan is flown: see `wakewise.control`.
"""

from wakewise.planning.planner import Planner
from wakewise.planning.problem import Horizon, PlanProblem, PlanSettings, state_of
from wakewise.planning.surroundings import Surroundings, check_start, covering_spheres

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
