"""Parts are made when asked for, from the scenario and from each other, and each can be replaced."""

import numpy as np
import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.operation import PARTS, read_scenario, write_scenario
from wakewise.operation import parts as module
from wakewise.operation.trial_folder import resolved_scenario

QUICK = ww.Scenario.preset("quick", **{"target.points": 60})


def test_no_planner_is_made_to_look_at_the_water(monkeypatch):
    """The world, the region and the route do not ask for a controller."""
    monkeypatch.setattr(module, "make_controller", lambda *_: pytest.fail("a controller was made"))
    parts = QUICK.parts()
    tank = parts.world.tank()
    assert tank.vehicle.mass_kg != parts.vehicle.mass_kg
    assert parts.preflight.clearance_m > 0.0


def test_what_depends_on_a_replaced_part_is_made_anew():
    """Another vehicle is what the controller is made for and what the tank perturbs; the old parts stay so."""
    parts = QUICK.replace(method="dp").parts()
    ours = parts.controller
    other = parts.replace(vehicle=ww.load_vehicle("bluerov2-heavy"))
    assert other.controller is not ours and parts.controller is ours
    assert other.world.vehicle.name == "bluerov2-heavy" and parts.vehicle.name == "paper"
    assert other.target is not parts.target and np.array_equal(other.target.mesh.faces, parts.target.mesh.faces)
    assert other.overrides == {"vehicle": "bluerov2-heavy (wakewise.robot.vehicles.vehicle.Vehicle)"}


def test_fields_of_the_scenario_can_be_replaced_beside_parts():
    """`seed` and `method` are fields, `controller` is a part; a method named later makes the controller again."""
    parts = QUICK.parts().replace(seed=5, method="dp")
    assert (parts.scenario.seed, parts.controller.name) == (5, "dp")
    mine = parts.replace(controller=parts.controller)
    assert mine.replace(method="allocation-only").controller.name == "allocation-only"
    with pytest.raises(InputError, match="captain: no such field"):
        parts.replace(captain="me")
    assert {"vehicle", "target", "region", "route", "world", "estimator", "controller", "pilot", "wake"} <= set(PARTS)


def test_a_part_that_a_scenario_cannot_name_is_asked_for_again():
    """The scenario that such a trial leaves behind gives all its other parts, and says what it lacks."""
    flown = QUICK.parts().replace(vehicle=ww.load_vehicle("bluerov2-heavy"), method="dp")
    assert resolved_scenario(flown).vehicle == "bluerov2-heavy"
    left = resolved_scenario(flown).parts()
    assert left.target.name == flown.target.name
    with pytest.raises(InputError, match=r"vehicle: was given in Python \(bluerov2-heavy .*replace\(vehicle=\.\.\.\)"):
        _ = left.vehicle
    assert left.replace(vehicle=flown.vehicle).controller.name == "dp"


def test_the_record_of_a_controller_of_ones_own_can_be_read(tmp_path):
    """What it calls itself stands as the method; without that record no scenario may ask for such a name."""

    class Mine:
        name = "mine"

        def init(self):
            return None

        def step(self, state, dt_s, estimate, goal):
            return state, ww.Command(thrusts_N=np.zeros(8), wrench_B=np.zeros(6))

    left = resolved_scenario(QUICK.parts().replace(controller=Mine()))
    write_scenario(tmp_path / "scenario.yaml", left, {})
    again = read_scenario(tmp_path / "scenario.yaml")
    assert again == left and (again.method, list(again.overrides)) == ("mine", ["controller"])
    with pytest.raises(InputError, match="controller: was given in Python"):
        _ = again.parts().controller
    with pytest.raises(InputError, match="method: found 'mine'"):
        QUICK.replace(method="mine")


def test_the_same_parts_fly_the_same_flight_twice():
    """A world begins anew each time: nothing of the first flight is left in the second."""
    parts = QUICK.replace(method="dp").parts()
    first, second = (ww.fly(parts, duration_s=1.0).steps for _ in range(2))
    assert first.equals(second)


def test_a_vehicle_too_large_for_the_route_is_refused_before_it_flies():
    """The hull would touch: the line names leg and field, and no world was begun."""
    parts = QUICK.parts()
    large = ww.load_vehicle("rexrov")
    with pytest.raises(InputError, match=r"mission\.\w+"):
        ww.fly(parts.replace(vehicle=large))


@pytest.mark.parametrize("world", ["paper", "lattice-jets"])
def test_other_worlds_fly_the_same_mission(world):
    """Water that answers at once: by the paper's model (circular) or by the lattice's mean field."""
    flight = ww.fly(QUICK.replace(method="dp", world=world), duration_s=1.0)
    assert flight.parts.world.name == world
    assert flight.steps["target_speed_mean_m_s"].is_finite().all()
    assert np.nanmax(flight.steps["target_speed_mean_m_s"].to_numpy()) >= 0.0


def test_the_lattices_water_is_the_lattices_jet():
    """One thruster of the true vehicle at the true pose: the speed on its axis is that of the mean field."""
    from wakewise.operation.worlds.quasi_steady_world import free_jet_field
    from wakewise.simulation.lattice import LatticeFlow

    plant, truth_provider = QUICK.replace(method="dp", world="lattice-jets").parts().world.begin()
    for _ in range(40):
        plant.step(np.array([3.0, 0, 0, 0, 0, 0, 0, 0]), 0.02)
    true = truth_provider.observe()
    vehicle = plant._plant.vehicle
    origin = true.state.X_WB.apply(vehicle.thruster_positions_B_m)[0]
    jet = -(true.state.X_WB.R @ vehicle.thruster_axes_B[0])
    flow = LatticeFlow(
        table=free_jet_field(),
        origins_W_m=origin[None],
        directions_W=jet[None],
        thrusts_N=true.thrusts_N[:1],
        areas_m2=vehicle.disk_areas_m2[:1],
        density_kg_m3=1000.0,
    )
    points = origin + np.linspace(0.1, 0.6, 6)[:, None] * jet
    found = plant.speeds_m_s(points)
    np.testing.assert_allclose(found, np.linalg.norm(flow.velocity(points), axis=1), rtol=1e-9)
    assert found[0] > found[-1] > 0.02
