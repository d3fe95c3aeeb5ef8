"""What a method watches follows the current as the estimate has it."""

import numpy as np
import pytest

from wakewise.allocation import min_norm_allocation
from wakewise.control import AllocationSettings, ControlSettings, make_controller
from wakewise.control.null_space_allocation import CURRENT_SPREAD, RESTART_GAIN, allocation_context
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region
from wakewise.simulation.water.water import Water
from wakewise.wake import ImpingingJet, RoundJet

VEHICLE = load_vehicle("paper")
AHEAD = Region(
    points_W_m=np.array([[0.7, 0.0, 0.05], [0.7, 0.03, 0.05], [0.72, -0.03, 0.02]]),
    weights=np.full(3, 1.0 / 3.0),
    distance_m=np.zeros(3),
)
THRUSTS = np.array([1.0, 0.5, -0.5, -1.0, -0.3, -0.5, -1.2, -1.4])


def watch(wake=None, **mechanisms):
    """Eyes on the points ahead."""
    return allocation_context(
        VEHICLE, AHEAD, wake or RoundJet(), ControlSettings(allocation=AllocationSettings(**mechanisms))
    )


def estimate(*current_m_s, **of):
    """An estimate at the origin with a current, or none."""
    return BodyState(X_WB=Pose(np.zeros(3)), current_W_m_s=np.array(current_m_s) if current_m_s else None, **of)


def test_an_unknown_current_leaves_the_water_still():
    """None, or the mechanism off: the matrix is that of the view alone."""
    still = watch().view.gram(Pose(np.zeros(3)))
    np.testing.assert_array_equal(watch().gram(estimate(), THRUSTS), still)
    np.testing.assert_array_equal(watch(advection=False).gram(estimate(0.05, 0.0, 0.0), THRUSTS), still)
    assert not np.allclose(watch().gram(estimate(0.05, 0.0, 0.0), THRUSTS), still)


def test_a_stated_current_is_believed_against_the_estimate():
    """What a user states stands, whatever the estimator finds and however sure it is."""
    found = watch(current_m_s=(0.0, 0.02, 0.0)).flow(estimate(0.05, 0.0, 0.0, current_covariance=np.eye(3)), THRUSTS)
    np.testing.assert_array_equal(found.current_W_m_s, [0.0, 0.02, 0.0])
    assert found.current_std_m_s == pytest.approx(CURRENT_SPREAD * 0.02)


def test_what_the_estimator_is_unsure_of_is_added():
    """In squares: a component's variance and the share of the current."""
    found = watch().flow(estimate(0.0, 0.1, 0.0, current_covariance=np.diag([1e-4, 4e-4, 4e-4])), THRUSTS)
    assert found.current_std_m_s == pytest.approx(np.sqrt(3e-4 + (CURRENT_SPREAD * 0.1) ** 2))


def test_shares_make_the_wrench_and_are_never_worse_than_those_of_before_by_their_own_matrix():
    """For currents from all sides; the matrix that comes with them is that of these thrusts."""
    eyes, rng = watch(), np.random.default_rng(4)
    layout = eyes.layout
    for angle in np.linspace(0.0, 2.0 * np.pi, 7)[:-1]:
        here = estimate(0.09 * np.cos(angle), 0.09 * np.sin(angle), 0.0)
        wrench = np.array([-2.6, 0.9, -3.3, 0.0, -0.3, 0.0]) + 0.1 * rng.normal(size=6)
        before = min_norm_allocation(layout, wrench).thrusts_N
        found, seen = eyes.search(wrench, here, before)
        np.testing.assert_allclose(layout.B @ found.thrusts_N, wrench, atol=1e-9)
        np.testing.assert_allclose(seen.gram, eyes.influence(here, found.thrusts_N).gram, atol=1e-15)
        least = eyes.cost(before, eyes.influence(here, before).gram)
        assert eyes.cost(found.thrusts_N, seen.gram, before) <= least * (1.0 + 1e-9)


def test_a_jump_is_worth_it_or_not_made():
    """It makes the wrench, costs less than what is flown, each by its own matrix, and is not repeated."""
    eyes, made = watch(), 0
    layout = eyes.layout
    for angle in np.linspace(0.0, 2.0 * np.pi, 7)[:-1]:
        here = estimate(0.09 * np.cos(angle), 0.09 * np.sin(angle), 0.0)
        wrench = np.array([-2.6, 0.9, -3.3, 0.0, -0.3, 0.0])
        present = min_norm_allocation(layout, wrench).thrusts_N
        anew = eyes.restart(wrench, here, present)
        if anew is None:
            continue
        found, seen = anew
        made += 1
        np.testing.assert_allclose(layout.B @ found.thrusts_N, wrench, atol=1e-9)
        np.testing.assert_allclose(seen.gram, eyes.influence(here, found.thrusts_N).gram, atol=1e-15)
        assert eyes.cost(found.thrusts_N, seen.gram) < (1.0 - RESTART_GAIN) * eyes.cost(
            present, eyes.influence(here, present).gram
        )
        assert eyes.restart(wrench, here, found.thrusts_N) is None
    assert made >= 2


def test_where_the_wake_model_gives_nonsense_there_are_no_shares():
    """A model that is not finite gives None, and the controllers fall back."""

    class Nonsense:
        name = "nonsense"

        def unit_velocity(self, points, origins, directions, area):
            return np.full((len(origins), len(points), 3), np.nan)

    eyes = watch(Nonsense(), merging_jets=False)
    assert eyes.search(np.ones(6), estimate(0.1, 0.0, 0.0), np.zeros(8)) is None


def tank_speed_m_s(thrusts, current):
    """Mean speed of the tank's water at the points ahead, 15 to 30 s after thrusts began that stay as they are."""
    water = Water(
        VEHICLE.disk_areas_m2,
        density_kg_m3=1000.0,
        bed_z_m=1.5,
        rng=np.random.default_rng(0),
        current_W_m_s=np.array(current),
    )
    lift = np.array([0.0, 0.0, 0.9])
    places, speeds = VEHICLE.thruster_positions_B_m + lift, []
    for k in range(600):
        impulse = 0.05 * np.stack([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)], axis=1)
        water.step(0.05, places, places, VEHICLE.thruster_axes_B, impulse)
        if k >= 300 and k % 20 == 0:
            speeds.append(np.linalg.norm(water.excess_velocity(AHEAD.points_W_m + lift), axis=1).mean())
    return float(np.mean(speeds))


def test_where_the_current_brings_the_wash_back_shares_are_gentler_for_knowing_it():
    """4 N heavy, pushing astern, 9 cm/s abeam: predicted and true water at the target, against still water's shares.

    A rear thruster that blows forward past the hull is harmless in still water; here its jet is carried to the target.
    """
    wrench, here = np.array([-2.64, 0.93, -3.33, 0.0, -0.28, 0.0]), estimate(-0.017, -0.083, 0.0)
    floor = ImpingingJet(jet=RoundJet(), bed_z_m=0.6)
    eyes, blind = watch(floor), watch(floor, advection=False)
    least = min_norm_allocation(eyes.layout, wrench).thrusts_N
    unknowing = blind.restart(wrench, here, least)[0].thrusts_N
    thrusts = least
    for k in range(20):
        found = (eyes.restart(wrench, here, thrusts) if k == 0 else None) or eyes.search(wrench, here, thrusts)
        thrusts = found[0].thrusts_N
    cost = {name: eyes.cost(T, eyes.gram(here, T)) for name, T in (("knows", thrusts), ("does not", unknowing))}
    assert cost["knows"] < 0.8 * cost["does not"]
    slow, fast = (tank_speed_m_s(T, here.current_W_m_s) for T in (thrusts, unknowing))
    assert slow < 0.2 * fast


@pytest.mark.parametrize("method", ["allocation-only", "wake-aware"])
def test_thrusts_follow_the_estimates_current(method):
    """The same estimate with a current from the bow and from the stern shares the same load out differently."""
    controller = make_controller(method, VEHICLE, AHEAD, RoundJet(), ControlSettings())
    load = np.array([0.4, 0.1, 0.3, 0.0, 0.02, 0.0])
    thrusts = []
    for current in ((), (0.06, 0.0, 0.0), (-0.06, 0.0, 0.0)):
        state, here = controller.init(), estimate(*current, load_B=load)
        for _ in range(60):
            state, command = controller.step(state, 0.02, here, Goal(X_WB=here.X_WB))
        assert command.fallback is None
        thrusts.append(command.thrusts_N)
    blind, ahead, astern = thrusts
    assert np.abs(blind - ahead).max() > 0.01
    assert np.abs(ahead - astern).max() > 0.01
