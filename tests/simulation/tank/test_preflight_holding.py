"""Whether a vehicle can hold: the margin is what the thrusters give over what drag asks."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.robot.vehicles import achievable_wrench, compile_body, damping_wrench, load_vehicle
from wakewise.robot.vehicles.ballast import BallastBlock, with_blocks
from wakewise.simulation.tank import station_keeping_demand

VEHICLE = load_vehicle("paper")


def test_the_margin_is_thrust_over_drag():
    """For a stream from ahead it is the largest pure surge force over the drag at that speed."""
    found = station_keeping_demand(VEHICLE, np.array([[-0.5, 0.0, 0.0]]), 1000.0)
    drag = damping_wrench(compile_body(VEHICLE), np.array([0.5, 0, 0, 0, 0, 0]))
    assert found.drag_N == pytest.approx(drag[:3])
    assert found.share == pytest.approx(achievable_wrench(VEHICLE)[0, 1] / -drag[0], rel=1e-6)
    assert "0.50 m/s" in found.said()
    assert f"(margin {found.margin_pct:.0f} %)" in found.said()
    assert "(margin 0 %)" in replace(found, share=0.999).said()


def test_the_hardest_stream_counts():
    """Of several streams the one with the least margin is kept; faster water leaves less; still water has none."""
    slow = station_keeping_demand(VEHICLE, np.array([[0.1, 0.0, 0.0]]), 1000.0)
    both = station_keeping_demand(VEHICLE, np.array([[0.1, 0.0, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 0.0]]), 1000.0)
    assert both.passing_B_m_s.tolist() == [0.0, 0.9, 0.0]
    assert both.share < slow.share
    assert station_keeping_demand(VEHICLE, np.zeros((4, 3)), 1000.0) is None


def test_a_stream_too_fast_leaves_less_than_nothing():
    """At 2.5 m/s no small vehicle holds: the margin is negative."""
    assert station_keeping_demand(VEHICLE, np.array([[0.0, 2.5, 0.0]]), 1000.0).margin_pct < 0.0


def test_the_worst_drag_counts():
    """A share of drag on top raises force and lowers what is to spare, and is said with speed, force and limit."""
    believed = station_keeping_demand(VEHICLE, np.array([[-0.5, 0.0, 0.0]]), 1000.0)
    worst = station_keeping_demand(VEHICLE, np.array([[-0.5, 0.0, 0.0]]), 1000.0, 0.0, 0.3)
    assert worst.drag_N == pytest.approx(1.3 * believed.drag_N)
    assert worst.share == pytest.approx(believed.share / 1.3, rel=1e-6)
    assert "0.50 m/s" in worst.said()
    assert f"{abs(worst.drag_N[0]):.1f} N in surge if its drag is 30 % more than believed" in worst.said()
    assert f"hold {worst.share * abs(worst.drag_N[0]):.1f} N" in worst.said()
    assert "believed" not in believed.said()


@pytest.mark.parametrize("float_N", [5000.0, -5000.0, 300.0, -300.0])
def test_weight_and_lift_are_held_too(float_N):
    """In still water: what the vertical thrusters give over what the vehicle weighs in water, either way."""
    vehicle = with_blocks(VEHICLE, [BallastBlock(float_N=float_N)])
    found = station_keeping_demand(vehicle, np.zeros((1, 3)), 1000.0)
    able = achievable_wrench(vehicle)[2, 1 if float_N > 0.0 else 0]
    assert found.share <= abs(able / float_N) * 1.001
    assert found.margin_pct < 0.0
    assert f"up to {abs(float_N):.1f} N {'light' if float_N > 0.0 else 'heavy'}" in found.said()


def test_trim_counts_as_weight():
    up, down = (station_keeping_demand(VEHICLE, np.zeros((1, 3)), 1000.0, trim_N) for trim_N in (10.0, -10.0))
    assert (up.heavy_N, down.heavy_N) == pytest.approx((-10.0, 10.0))
    assert up.share == pytest.approx(achievable_wrench(VEHICLE)[2, 1] / 10.0, rel=1e-6)


def test_a_vehicle_off_balance_is_held_level_by_its_thrusters():
    """Blocks that cancel in weight still turn it; a vehicle that can make no such moment leaves it to its weight."""
    blocks = [BallastBlock(float_N=30.0, at_B_m=(2.0, 0.0, 0.0)), BallastBlock(float_N=-30.0, at_B_m=(-2.0, 0.0, 0.0))]
    found = station_keeping_demand(with_blocks(VEHICLE, blocks), np.zeros((1, 3)), 1000.0)
    assert found.righting_N_m == pytest.approx(120.0, rel=0.02)
    assert found.margin_pct < 0.0
    assert "turn it with" in found.said()
    four = load_vehicle("bluerov2")
    tilted = np.array([[np.cos(0.1), 0.0, np.sin(0.1), 0.0]])
    assert station_keeping_demand(four, np.zeros((1, 3)), 1000.0, 0.0, 0.0, tilted).margin_pct > 0.0
