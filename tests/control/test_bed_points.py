"""Mechanisms: points that join the region."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.control import AllocationSettings, ControlSettings, make_controller
from wakewise.control.bed_points import BED_POINTS, BED_RADIUS_M, BED_WEIGHT, with_bed_points
from wakewise.control.mpc_controller import plan_superposition
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.wake import ImpingingJet, wake_model


def region() -> Region:
    rng = np.random.default_rng(3)
    points = np.array([0.2, -0.1, 1.42]) + rng.uniform(-0.08, 0.08, size=(60, 3))
    distance = np.where(np.arange(60) < 20, 0.0, 0.05)
    return Region(points_W_m=points, weights=rng.uniform(0.3, 1.0, 60), distance_m=distance)


def test_levers_that_are_off_leave_the_region_alone():
    """The very same object, so that nothing can differ by rounding."""
    given = region()
    assert with_bed_points(given, AllocationSettings()) is given


def test_bed_points_lie_in_a_thin_disk_round_the_foot():
    """Within the radius, 1 to 3 cm above the bed, evenly: half of them within r / sqrt(2); weights add up as set."""
    given, mechanisms = region(), AllocationSettings(include_bed=True)
    found = with_bed_points(given, mechanisms, 1.5)
    extra = found.points_W_m[60:]
    foot = given.points_W_m[given.distance_m == 0.0, :2].mean(axis=0)
    reach = np.linalg.norm(extra[:, :2] - foot, axis=1)
    assert len(extra) == BED_POINTS and reach.max() <= BED_RADIUS_M
    assert np.mean(reach < BED_RADIUS_M / np.sqrt(2.0)) == pytest.approx(0.5, abs=0.02)
    assert extra[:, 2].min() >= 1.47 - 1e-12 and extra[:, 2].max() <= 1.49 + 1e-12
    assert found.weights[60:].sum() == pytest.approx(BED_WEIGHT * given.weights.sum())
    np.testing.assert_array_equal(found.points_W_m[:60], given.points_W_m)
    assert np.all(found.distance_m[60:] > 0.0)


def test_every_lever_together_still_flies():
    """All mechanisms on, with the floor's model: finite thrusts."""
    mechanisms = AllocationSettings(include_bed=True, current_m_s=(0.03, 0.02, 0.0))
    settings = ControlSettings(allocation=mechanisms, wake={"model": "jet", "floor": True})
    vehicle = load_vehicle("paper")
    controller = make_controller("wake-aware", vehicle, region(), wake_model(settings.wake, 1.5), settings)
    here = BodyState(X_WB=Pose(np.array([-0.5, 0.0, 1.1])))
    _, command = controller.step(controller.init(), 0.02, here, Goal(X_WB=here.X_WB))
    assert np.all(np.isfinite(command.thrusts_N)) and command.fallback is None


@pytest.mark.parametrize(
    "field",
    [
        {"current_m_s": (2.0, 0.0, 0.0)},
        {"current_m_s": (0.0, 0.0)},
        {"null_space": float("nan")},
        {"include_bed": 7},
    ],
)
def test_levers_out_of_range_are_refused(field):
    """Bad values do not become settings."""
    with pytest.raises(ValidationError):
        AllocationSettings(**field)


def test_planner_and_allocator_weigh_alike():
    """One pair of weights and one superposition reach the plan and the shares of its wrench; a floor in the plan adds
    squares, whatever the switch says.
    """
    vehicle, jet = load_vehicle("paper"), wake_model("jet")
    for how in ("coherent", "incoherent"):
        settings = ControlSettings(superposition=how, w_disturbance=70.0, w_effort=2e-3)
        controller = make_controller("wake-aware", vehicle, region(), jet, settings)
        terms, weights = controller.motion.model.terms, controller.allocator.context.weights
        assert (terms.superposition, controller.allocator.context.view.superposition) == (how, how)
        assert (terms.w_disturbance, terms.w_effort, weights.effort) == (70.0, 2e-3, 2e-3)
        assert weights.disturbance == pytest.approx(70.0 / controller.allocator.context.view.total_weight)
        assert plan_superposition(jet, settings) == how
        assert plan_superposition(ImpingingJet(jet=jet, bed_z_m=1.5), settings) == "incoherent"
