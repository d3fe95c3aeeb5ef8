"""Levers: points that join the region, and a shutter that is announced early."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.control import ControlSettings, LeverSettings, make_controller
from wakewise.control.levers import Early, lead_of, watched, with_bed_points, with_halo
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState, Command, Goal
from wakewise.targets import Region
from wakewise.vehicles import load_vehicle
from wakewise.wake import wake_model


def region() -> Region:
    rng = np.random.default_rng(3)
    points = np.array([0.2, -0.1, 1.42]) + rng.uniform(-0.08, 0.08, size=(60, 3))
    distance = np.where(np.arange(60) < 20, 0.0, 0.05)
    return Region(points_W_m=points, weights=rng.uniform(0.3, 1.0, 60), distance_m=distance)


def test_levers_that_are_off_leave_the_region_alone():
    """The very same object, so that nothing can differ by rounding."""
    given = region()
    assert watched(given, LeverSettings()) is given


def test_bed_points_lie_in_a_thin_disk_round_the_foot():
    """Within the radius, 1 to 3 cm above the bed, evenly: half of them within r / sqrt(2); weights add up as set."""
    given, levers = region(), LeverSettings(bed=True, bed_points=200, bed_radius_m=0.3, bed_weight=0.7)
    found = with_bed_points(given, levers, 1.5)
    extra = found.points_W_m[60:]
    foot = given.points_W_m[given.distance_m == 0.0, :2].mean(axis=0)
    reach = np.linalg.norm(extra[:, :2] - foot, axis=1)
    assert len(extra) == 200 and reach.max() <= 0.3
    assert np.mean(reach < 0.3 / np.sqrt(2.0)) == pytest.approx(0.5, abs=0.01)
    assert extra[:, 2].min() >= 1.47 - 1e-12 and extra[:, 2].max() <= 1.49 + 1e-12
    assert found.weights[60:].sum() == pytest.approx(0.7 * given.weights.sum())
    np.testing.assert_array_equal(found.points_W_m[:60], given.points_W_m)
    assert np.all(found.distance_m[60:] > 0.0)


def test_the_halo_fills_the_water_round_the_target_above_the_bed():
    """Inside the widened box, never under the bed, in every octant, weights as set."""
    given, levers = region(), LeverSettings(halo=True, halo_points=160, halo_m=0.25, halo_weight=0.4)
    extra = with_halo(given, levers, 1.5).points_W_m[60:]
    surface = given.points_W_m[given.distance_m == 0.0]
    assert np.all(extra[:, 2] <= 1.5)
    assert np.all(extra >= surface.min(axis=0) - 0.25) and np.all(extra[:, :2] <= surface.max(axis=0)[:2] + 0.25)
    middle = 0.5 * (extra.min(axis=0) + extra.max(axis=0))
    octants = {tuple(row) for row in (extra > middle)}
    assert len(octants) == 8
    assert with_halo(given, levers, 1.5).weights[60:].sum() == pytest.approx(0.4 * given.weights.sum())


def test_early_moves_the_announced_opening_forward():
    """The controller within is told of the shutter by the lead earlier, and of nothing else differently."""
    heard = []

    class Ear:
        name = "ear"

        def init(self):
            return 0

        def step(self, state, dt_s, estimate, goal):
            heard.append(goal)
            return state + 1, Command(thrusts_N=np.zeros(1), wrench_B=np.zeros(6))

    early = Early(inner=Ear(), lead_s=0.8)
    here = BodyState(X_WB=Pose(np.zeros(3)))
    state, _ = early.step(early.init(), 0.02, here, Goal(X_WB=here.X_WB, exposure_in_s=2.0))
    early.step(state, 0.02, here, Goal(X_WB=here.X_WB))
    assert state == 1 and early.name == "ear"
    assert heard[0].exposure_in_s == pytest.approx(1.2) and np.isinf(heard[1].exposure_in_s)


def test_a_wake_takes_about_a_second_to_arrive():
    """The steady jet of 0.3 N over 0.4 m needs 0.5 to 3 s, longer the weaker it is."""
    assert 0.5 < lead_of(0.4, 0.3, np.pi * 0.03**2) < 3.0
    assert lead_of(0.4, 0.1, np.pi * 0.03**2) > lead_of(0.4, 0.3, np.pi * 0.03**2)


def test_every_lever_together_still_flies():
    """All levers on, with the floor's model: finite thrusts."""
    levers = LeverSettings(bed=True, halo=True, quiet=True, incoherent=True, tilt_deg=3.0)
    settings = ControlSettings(levers=levers, wake={"model": "jet", "floor": True})
    vehicle = load_vehicle("paper")
    controller = make_controller("wake-aware", vehicle, region(), wake_model(settings.wake, 1.5), settings)
    here = BodyState(X_WB=Pose(np.array([-0.5, 0.0, 1.1])))
    _, command = controller.step(controller.init(), 0.02, here, Goal(X_WB=here.X_WB, exposure_in_s=0.5))
    assert np.all(np.isfinite(command.thrusts_N)) and command.fallback is None


@pytest.mark.parametrize("field", [{"quiet_gain": 0.5}, {"tilt_deg": 30.0}, {"bed_weight": float("nan")}, {"bed": 7}])
def test_levers_out_of_range_are_refused(field):
    """Bad values do not become settings."""
    with pytest.raises(ValidationError):
        LeverSettings(**field)
