"""The paper's own world, in which the wake model is the water."""

import numpy as np

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState
from wakewise.experiments.campaigns.flights import scenario_of
from wakewise.operation.worlds.quasi_steady_world import QuasiSteadyWater, paper_jets
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import coral, place_on_bed
from wakewise.simulation.tank import TankSettings
from wakewise.wake import wake_model
from wakewise_paper.wash_reduction.paper import OFF, PAPER_WAKE, paper_trial

VEHICLE = load_vehicle("paper")


def test_its_methods_believe_in_the_papers_model_without_levers():
    """The paper's cost and its model, smoothed at the edge."""
    control = scenario_of(paper_trial("wake-aware", 1).task.settings).control
    assert control.wake.model == PAPER_WAKE["model"] and not any(getattr(control.allocation, name) for name in OFF)


def test_the_papers_world_is_the_papers_model():
    """One thruster at full lag: the water is sqrt(T) times the model's unit velocity; none, and it is still."""
    target = place_on_bed("branching", coral("branching", 0), 1.5)
    settings = TankSettings(current={"velocity_m_s": (0.0, 0.0, 0.0)})
    start = BodyState(X_WB=Pose(np.array([0.0, 0.0, 0.9])))
    world = QuasiSteadyWater(paper_jets(), VEHICLE, target, settings, start, np.random.default_rng(0))
    points = np.array([[0.09, 0.14, 1.2], [0.0, 0.0, 1.4]])
    assert np.all(world.speeds_m_s(points) == 0.0)
    thrusts = np.zeros(8)
    thrusts[4] = -2.0
    for _ in range(30):
        measured = world.step(thrusts, 0.02)
    assert measured is not None
    truth = world.observe()
    origin = truth.state.X_WB.apply(VEHICLE.thruster_positions_B_m)[4:5]
    jet = truth.state.X_WB.R @ VEHICLE.thruster_axes_B[4]
    unit = wake_model("paper-calibrated").unit_velocity(points, origin, jet[None], VEHICLE.disk_areas_m2[4:5])[0]
    expected = np.sqrt(-truth.thrusts_N[4]) * np.linalg.norm(unit, axis=1)
    np.testing.assert_allclose(world.speeds_m_s(points), expected, rtol=1e-9)
    assert expected[0] > 0.05
