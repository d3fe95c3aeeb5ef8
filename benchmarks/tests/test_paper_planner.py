"""The paper's recipe, the planner's peer: where both converge they agree."""

import numpy as np
import pytest

from wakewise.planning.planner import Planner
from wakewise_benchmarks.paper_planner import PaperPlanner
from wakewise_benchmarks.planner import plan_model, problem_at


@pytest.mark.slow
def test_paper_and_mm_agree_where_both_converge():
    """From the same start the paper's recipe, with its line search, ends within 2 % of the majoriser's cost."""
    case, start = problem_at(0.0, 1.5), np.zeros((20, 8))
    ours = Planner(plan_model(30)).plan(case, start)
    theirs, plan = PaperPlanner(plan_model(5), well_coded=True), None
    for _ in range(3):
        plan = theirs.plan(case, start if plan is None else plan.commands_N)
    assert plan.cost < 1.02 * ours.cost
