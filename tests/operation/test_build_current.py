"""Said before the flight: a current too fast to hold, a series too short for the flight."""

import numpy as np
import pytest

from wakewise.errors import InputError
from wakewise.missions import plan_route
from wakewise.operation import load_scenario
from wakewise.operation.build import check_current
from wakewise.vehicles import load_vehicle

CENTRE_W_M = np.array([0.0, 0.0, 1.4])


def _check(vehicle="bluerov2-heavy", **tank):
    scenario = load_scenario("quick", None, {f"tank.{name}": value for name, value in tank.items()})
    return check_current(scenario, load_vehicle(vehicle), plan_route(CENTRE_W_M, scenario.mission))


def test_a_current_too_fast_is_refused_with_its_margin():
    """One line with speed, drag, what the thrusters hold, and how much is missing."""
    with pytest.raises(InputError, match=r"cannot hold its route.*1\.\d\d m/s.*N in.*margin -\d+ %"):
        _check(**{"current.velocity_m_s": [0.9, 0.5, 0.0]})


def test_a_gentle_current_leaves_a_margin():
    """The default current is no burden; faster water leaves less."""
    gentle, fast = _check(), _check(**{"current.velocity_m_s": [0.4, 0.0, 0.0]})
    assert gentle.margin_pct > fast.margin_pct > 0.0
    assert _check(**{"waves.amplitude_m": 0.1, "waves.period_s": 2.0}).margin_pct < gentle.margin_pct


def test_a_series_shorter_than_the_flight_is_refused(tmp_path):
    """Before it starts, with both times."""
    path = tmp_path / "c.csv"
    path.write_text("time_s,u,v\n0,0.1,0\n10,0.1,0\n")
    with pytest.raises(InputError, match="10 s of series are left, the flight takes"):
        _check(**{"current.file": str(path)})
