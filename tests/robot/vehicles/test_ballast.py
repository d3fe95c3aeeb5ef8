"""Blocks of ballast: what they weigh, how they turn the vehicle, and that bodies joined add up."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.vehicles import compile_body, load_vehicle, restoring_wrench
from wakewise.robot.vehicles.ballast import FOAM_KG_M3, LEAD_KG_M3, BallastBlock, ballasted, net_buoyancy_N, with_blocks
from wakewise.robot.vehicles.fossen import rigid_body_mass

VEHICLE = load_vehicle("paper")
BLOCKS = (
    BallastBlock(float_N=3.0, at_B_m=(-0.1, 0.05, -0.02)),
    BallastBlock(float_N=-1.5, at_B_m=(0.2, -0.1, 0.05)),
    BallastBlock(float_N=0.5),
)


def test_net_buoyancy_grows_by_what_the_blocks_lift() -> None:
    """Foam adds, lead takes away, each by its own number."""
    found = net_buoyancy_N(with_blocks(VEHICLE, BLOCKS)) - net_buoyancy_N(VEHICLE)
    assert found == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("degrees", [(0.0, 0.0, 0.0), (10.0, -40.0, 70.0)])
def test_a_block_turns_the_vehicle_by_its_place(degrees: tuple[float, float, float]) -> None:
    """The wrench of weight and buoyancy changes by the block's lift at its place, in any attitude."""
    q = quat_from_euler(*np.radians(degrees))
    after, before = (restoring_wrench(compile_body(v), q) for v in (with_blocks(VEHICLE, BLOCKS), VEHICLE))
    down_B = Pose(np.zeros(3), q).R.T @ np.array([0.0, 0.0, 1.0])
    expected = np.zeros(6)
    for block in BLOCKS:
        at = VEHICLE.p_BB_m if block.at_B_m is None else np.array(block.at_B_m)
        expected += np.concatenate([-block.float_N * down_B, np.cross(at, -block.float_N * down_B)])
    assert after - before == pytest.approx(expected, abs=1e-9)


def test_bodies_joined_add_up() -> None:
    """The rigid body's mass matrix about the origin is the sum of the vehicle's and of the blocks' points."""
    expected = rigid_body_mass(VEHICLE)
    for block in BLOCKS:
        density = FOAM_KG_M3 if block.float_N > 0.0 else LEAD_KG_M3
        m = density * block.float_N / (9.80665 * (1000.0 - density))
        x, y, z = VEHICLE.p_BB_m if block.at_B_m is None else block.at_B_m
        S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        expected = expected + m * np.block([[np.eye(3), -S], [S, -S @ S]])
        assert m > 0.0
    found = rigid_body_mass(with_blocks(VEHICLE, BLOCKS))
    assert found == pytest.approx(expected, abs=1e-12)
    assert np.linalg.eigvalsh(found)[0] > 0.0


def test_the_order_of_blocks_is_of_no_account() -> None:
    """All at once or one after the other, blocks of stated place make the same vehicle."""
    placed = BLOCKS[:2]
    one = with_blocks(VEHICLE, placed)
    other = with_blocks(with_blocks(VEHICLE, placed[1:]), placed[:1])
    for name in ("mass_kg", "displaced_volume_m3", "p_BG_m", "p_BB_m", "inertia_kg_m2"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-12)


def test_no_block_changes_nothing() -> None:
    """None, or one that lifts nothing: the vehicle itself."""
    assert with_blocks(VEHICLE, ()) is VEHICLE and with_blocks(VEHICLE, [BallastBlock(float_N=0.0)]) is VEHICLE


def test_what_is_no_block_is_refused() -> None:
    """Half a tonne of lift, a place off the vehicle."""
    with pytest.raises(InputError, match="5000"):
        ballasted(VEHICLE, 5001.0)
    with pytest.raises(ValidationError):
        BallastBlock(float_N=1.0, at_B_m=(9.0, 0.0, 0.0))
