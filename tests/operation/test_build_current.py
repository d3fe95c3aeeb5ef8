"""Said before the flight: a current too fast to hold, a series too short for the flight."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise import fly
from wakewise.core.errors import InputError, StageError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.operation import load_scenario, preflight
from wakewise.operation.preflight import check_current
from wakewise.robot.vehicles import load_vehicle
from wakewise.simulation.tank import build_ambient


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


class Theirs:
    """A current from outside, which answers what it is told to."""

    end_s = 1e6

    def __init__(self, answer, begins_s=0.0):
        self.answer, self.begins_s = answer, begins_s

    def velocity(self, points_W_m, time_s):
        return self.answer(points_W_m) if time_s >= self.begins_s else np.zeros((len(points_W_m), 3))


def no_current():
    """Forgets to return its current."""


def no_water():
    return Theirs(lambda points_W_m: None)


def one_row():
    return Theirs(lambda points_W_m: np.zeros(3))


def unknown():
    return Theirs(lambda points_W_m: points_W_m * np.nan)


def raises():
    return Theirs(lambda points_W_m: points_W_m["north"])


def refuses():
    current = Theirs(np.zeros_like)
    current.stirred_bed = lambda: [[0.0, 0.0]]
    return current


def ends():
    return Theirs(lambda points_W_m: None, begins_s=0.1)


def never_known():
    current = Theirs(np.zeros_like)
    current.end_s = "the ebb"
    return current


@pytest.mark.parametrize(
    ("maker", "words"),
    [
        (no_current, "what it gave: None has no velocity, must be a current with velocity"),
        (never_known, "cannot be made, ValueError: could not convert string to float: 'the ebb'"),
        (no_water, "velocity: what it gave: holds objects, allowed: real numbers"),
        (one_row, "velocity: what it gave: shape (3,), allowed (1, 3)"),
        (unknown, "velocity: what it gave: holds NaN"),
        (raises, "velocity: raised IndexError: only integers"),
    ],
)
def test_a_current_from_outside_that_is_of_no_use_is_refused_by_name(maker, words):
    """In one line, before the flight: its name, what was asked of it, and why that cannot be used."""
    name = f"{__name__}:{maker.__name__}"
    with pytest.raises(InputError) as caught:
        _check(**{"current.file": name})
    assert str(caught.value).startswith(f"current '{name}': {words}")
    assert "\n" not in str(caught.value)


def test_a_current_from_outside_that_fails_later_ends_the_flight_by_name():
    """The error is that of a stage, and gives the instant, too."""
    name = f"{__name__}:ends"
    changes = {"tank.current.file": name, "target.kind": "brain", "target.points": 60, "method": "dp"}
    with pytest.raises(StageError, match=rf"^fly: ended after 0\.\d s, current '{name}': velocity: what it gave"):
        fly(load_scenario("quick", None, changes), duration_s=0.4, checked=False)


def test_circles_of_a_current_from_outside_are_checked():
    """Those that it has none of are none."""
    parts = load_scenario("quick", None, {"tank.current.file": f"{__name__}:refuses"}).parts()
    with pytest.raises(InputError, match=r"refuses': stirred_bed: what it gave: shape \(1, 2\), allowed \(n, 3\)"):
        build_ambient(parts.scenario.tank, parts.seeds.tank()).stirred_bed()
    parts = load_scenario("quick", None, {"tank.current.file": f"{__name__}:ends"}).parts()
    ambient = build_ambient(parts.scenario.tank, parts.seeds.tank())
    assert (len(ambient.stirred_bed()), ambient.end_s, ambient.steady) == (0, 1e6, False)


@pytest.mark.parametrize("seed", [1, 7])
def test_the_water_that_is_checked_is_the_water_that_is_flown(seed, monkeypatch):
    """Background turbulence included: what passed the vehicle in the check is what the tank's own water does there."""
    scenario = load_scenario("quick", None, {"method": "dp", "seed": seed, "tank.current.turbulence_m_s": 0.05})
    passed = []
    monkeypatch.setattr(
        preflight, "station_keeping_demand", lambda vehicle, passing, *_: passed.append(np.array(passing))
    )
    parts = scenario.parts()
    preflight.check_current(parts)
    ambient = parts.world.tank().ambient
    route, X_BC = parts.route, parts.vehicle.X_BC
    for row, time_s in zip(passed[0], np.linspace(0.0, route.duration_s, len(passed[0])), strict=True):
        desired = route.body(float(time_s), X_BC)
        current = ambient.velocity(desired.X_WB.p_m[None], float(time_s))[0]
        np.testing.assert_allclose(row, current @ desired.X_WB.R - desired.nu_B[:3], atol=1e-12)


def test_no_controller_is_told_the_current_that_the_tank_has():
    """Whatever the tank's current, the controller that is made is the same: it learns of it from its estimate."""

    def made(**changes):
        controller = load_scenario("quick", None, {"method": "allocation-only", **changes}).parts().controller
        return controller, controller.allocator.context.flow(BodyState(X_WB=Pose(np.zeros(3))), np.zeros(8))

    (still, flow), (east, flow_east) = (
        made(**{"tank.current.velocity_m_s": [0.0, speed, 0.0]}) for speed in (0.0, 0.05)
    )
    assert np.array_equal(still.allocator.context.view.points_W_m, east.allocator.context.view.points_W_m)
    assert flow is None and flow_east is None


@pytest.mark.parametrize(
    "blocks",
    [
        [{"float_N": 5000.0}],
        [{"float_N": -5000.0}],
        [{"float_N": 40.0, "at_B_m": [5.0, 0.0, 0.0]}, {"float_N": -40.0, "at_B_m": [-5.0, 0.0, 0.0]}],
    ],
)
def test_ballast_that_thrusters_cannot_hold_is_refused(blocks):
    """With weight, moment and margin; a float that they can hold is flown with less margin."""
    with pytest.raises(InputError, match=r"cannot hold its route.*N (heavy|light).*margin -\d+ %"):
        check_current(load_scenario("quick", None, {"ballast": blocks}).parts())


def test_a_float_costs_margin():
    margins = [
        check_current(load_scenario("quick", None, {"ballast": [{"float_N": float_N}]}).parts()).margin_pct
        for float_N in (0.0, -20.0, -60.0)
    ]
    assert margins[0] > margins[1] > margins[2] > 0.0


@pytest.mark.parametrize(
    ("twist", "words"),
    [
        ([1e6, 0, 0, 0, 0, 0], r"start: moves at 1e\+06 m/s, at most 5 m/s"),
        ([0, 0, 6.0, 0, 0, 0], "start: moves at 6 m/s"),
        ([0, 0, 0, 1e4, 0, 0], r"start: turns at 1e\+04 rad/s, at most 6\.28 rad/s"),
    ],
)
def test_a_start_faster_than_any_vehicle_is_refused(twist, words):
    parts = load_scenario("quick", None, {}).parts()
    start = BodyState(X_WB=parts.start.X_WB, nu_B=np.array(twist, dtype=float))
    with pytest.raises(InputError, match=words):
        preflight.check_initial_state(parts.replace(start=start))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"mass_kg": 1e12}, r"cannot hold its route.*e\+12|cannot hold its route.* N heavy"),
        ({"mass_kg": 1e12, "displaced_volume_m3": 1e9}, "cannot hold|displaced_volume_m3 1e"),
        ({"mass_kg": 60.0, "displaced_volume_m3": 0.06}, r"displaced_volume_m3 0\.06, the box round it"),
    ],
)
def test_a_vehicle_of_impossible_mass_or_volume_is_refused(fields, words):
    parts = load_scenario("quick", None, {"tank.mismatch.trim_N": 0.0}).parts()
    heavy = replace(parts.vehicle, **fields)
    with pytest.raises(InputError, match=words):
        check_current(parts.replace(vehicle=heavy))
        preflight.check_volume(heavy)
