"""One flight of the operator's bench, really flown for its first seconds; deviations; what is overheard."""

import math

import numpy as np
import pytest

from wakewise.core.interfaces import no_progress
from wakewise.experiments.campaigns.flights import flight_parts, fly_stage
from wakewise_paper.operator_study.flight import (
    DEVIATIONS,
    FIGURES,
    ControllerProbe,
    course_of,
    deviations,
    operator_trial,
)


def _parts(*what):
    return flight_parts(operator_trial(*what).task.settings)[0]


def test_deviation_is_the_rms_of_what_is_missed_over_that_of_what_is_asked():
    """Of vectors; what the plan misses and what the vehicle misses of its plan beside it; nothing asked, no share."""
    asked, off = np.tile([0.1, 0.0, 0.0], (4, 1)), np.array([0.0, 0.01, 0.0])
    told = deviations(asked, asked + off, asked + 0.6 * off, 2.0 * asked)
    assert told["velocity_deviation_pct"] == pytest.approx(10.0)
    assert told["velocity_deviation_planned_pct"] == pytest.approx(6.0)
    assert told["velocity_deviation_behind_plan_pct"] == pytest.approx(4.0)
    assert told["velocity_deviation_from_sticks_pct"] == pytest.approx(50.2, abs=0.1)
    assert deviations(0.0 * asked, asked, asked)["velocity_deviation_pct"] is None


@pytest.mark.slow
def test_the_same_seed_is_the_same_water_for_every_method_and_pilot():
    """Tank, start and course do not depend on who flies; the method does not change what is asked."""
    one, two = (_parts("close", "script", m, 2) for m in ("dp", "no-forward-jets"))
    person = _parts("close", "human", "dp", 2)
    assert one.scenario.tank == two.scenario.tank == person.scenario.tank
    assert one.start.X_WB.p_m == pytest.approx(two.start.X_WB.p_m)
    assert isinstance(one.controller, ControllerProbe) and one.controller.name == "dp"
    assert course_of("close", "human", 1) == "look"


@pytest.mark.slow
def test_what_a_plan_expects_is_told_of_methods_that_plan():
    """A velocity once there is a plan; nothing of a method without one."""
    for method in ("wake-aware", "dp"):
        parts = _parts("mud", "script", method, 1)
        probe = parts.controller
        probe.step(probe.init(), 0.02, parts.start, parts.pilot.goal(0.0, parts.start))
        assert (probe.planned_W_m_s is not None) == (method == "wake-aware")


def test_one_flight_gives_the_figures_of_the_table(tmp_path):
    """Finite ones of velocity, water, D and cost; the first command is obeyed within a half, by direct allocation."""
    trial = operator_trial("payload", "script", "dp", 3, duration_s=9.5)
    row = fly_stage(trial.task.settings, tmp_path, no_progress)
    assert set(row) >= set(FIGURES)
    for key in (*DEVIATIONS, "disturbance", "target_speed_mean_m_s", "energy_kJ", "position_rmse_mm", "solve_ms_p99"):
        assert row[key] is not None and math.isfinite(row[key])
    assert 0.0 < row["velocity_deviation_pct"] < 50.0 and row["velocity_deviation_planned_pct"] == 0.0
