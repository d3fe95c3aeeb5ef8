"""Said before the flight: a current too fast to hold, a series too short for the flight."""

import numpy as np
import pytest

from wakewise.errors import InputError
from wakewise.operation import load_scenario, preflight
from wakewise.operation.preflight import check_current
from wakewise.tank.ambient import mean_current_m_s
from wakewise.vehicles import load_vehicle


def _check(vehicle="bluerov2-heavy", **tank):
    scenario = load_scenario("quick", None, {f"tank.{name}": value for name, value in tank.items()})
    return check_current(scenario.parts().replace(vehicle=load_vehicle(vehicle)))


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


@pytest.mark.parametrize("seed", [1, 7])
def test_the_water_that_is_checked_is_the_water_that_is_flown(seed, monkeypatch):
    """Background turbulence included: what passed the vehicle in the check is what the tank's own water does there."""
    scenario = load_scenario("quick", None, {"method": "dp", "seed": seed, "tank.current.turbulence_m_s": 0.05})
    passed = []
    monkeypatch.setattr(preflight, "holding", lambda vehicle, passing, *_: passed.append(np.array(passing)))
    parts = scenario.parts()
    preflight.check_current(parts)
    ambient = parts.world.tank().ambient
    route, X_BC = parts.route, parts.vehicle.X_BC
    for row, time_s in zip(passed[0], np.linspace(0.0, route.duration_s, len(passed[0])), strict=True):
        wished = route.body(float(time_s), X_BC)
        current = ambient.velocity(wished.X_WB.p_m[None], float(time_s))[0]
        np.testing.assert_allclose(row, current @ wished.X_WB.R - wished.nu_B[:3], atol=1e-12)


def test_the_levers_know_the_current_that_the_tank_has(tmp_path):
    """Change the tank's current and drift points follow: upstream of the target."""

    def upstream_m(**changes):
        scenario = load_scenario("quick", None, {"method": "instant", **changes})
        parts = scenario.parts()
        points = parts.controller.view.points_W_m[len(parts.region.weights) :]
        return points.mean(axis=0)[:2] - parts.target.centre_W_m[:2] if len(points) else None

    east = upstream_m(**{"tank.current.velocity_m_s": [0.0, 0.05, 0.0]})
    assert east[1] < -0.3 and abs(east[0]) < 0.1
    assert upstream_m(**{"tank.current.velocity_m_s": [0.0, 0.0, 0.0]}) is None
    wrong = {"tank.current.velocity_m_s": [0.0, 0.05, 0.0], "control.levers.drift_m_s": [0.0, -0.05, 0.0]}
    assert upstream_m(**wrong)[1] > 0.3, "a current that is named is believed"


def test_the_mean_current_is_that_of_the_flight(tmp_path):
    """A steady one is itself; of a series it is the mean from the start to the flight's end, gain included."""
    path = tmp_path / "c.csv"
    path.write_text("time_s,u,v\n0,0.0,0.1\n10,0.1,0.1\n20,0.1,0.1\n30,0.9,0.1\n")
    tank = load_scenario(
        None, None, {"tank.current.file": str(path), "tank.current.gain": 0.5, "tank.current.gap_s": 20}
    )
    assert mean_current_m_s(tank.tank, 20.0) == pytest.approx((0.0375, 0.05, 0.0), abs=1e-3)
    assert mean_current_m_s(load_scenario(None, None, {}).tank, 20.0) == (0.03, 0.02, 0.0)
