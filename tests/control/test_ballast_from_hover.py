"""Trim from a hover's estimates: weight and place by law, rounding to what a person can do, words."""

import numpy as np
import pytest

from wakewise.control.ballast_from_hover import LIGHT_N, HoverTrim, hover_trim
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.vehicles import compile_body, coriolis_wrench, damping_wrench, load_vehicle, restoring_wrench
from wakewise.robot.vehicles.ballast import with_blocks

VEHICLE = load_vehicle("paper")
Z_M = float(VEHICLE.p_BB_m[2])
ATTITUDES = [(0.0, 0.0, 0.0), (0.0, -40.0, 30.0), (5.0, -20.0, 170.0)]


def turned(degrees):
    return Pose(np.zeros(3), quat_from_euler(*np.radians(degrees)))


def weighed(X_WB, weight_N, place_m):
    """Wrench in B of a weight at a place."""
    force = X_WB.R.T @ np.array([0.0, 0.0, weight_N])
    return np.concatenate([force, np.cross(place_m, force)])


def found(weight_N, x_m, y_m, attitudes=ATTITUDES, more=0.0, thrust_N=0.0, light_N=0.0) -> HoverTrim:
    poses = [turned(a) for a in attitudes]
    loads = np.array([weighed(X, weight_N, [x_m, y_m, Z_M]) + more for X in poses])
    thrusts = np.full((len(poses), 8), thrust_N)
    return hover_trim(VEHICLE, np.array([X.q for X in poses]), loads, thrusts, light_N)


@pytest.mark.parametrize("attitudes", [ATTITUDES[:1], ATTITUDES[1:2], ATTITUDES])
@pytest.mark.parametrize(("weight_N", "x_m", "y_m"), [(3.4, 0.12, -0.04), (-2.0, -0.2, 0.1), (0.7, 0.0, 0.0)])
def test_a_known_load_gives_its_weight_and_its_place(attitudes, weight_N, x_m, y_m) -> None:
    """Exactly, level or pitched, heavy or light."""
    trim = found(weight_N, x_m, y_m, attitudes)
    assert trim.heavy_N == pytest.approx(weight_N, abs=1e-9)
    assert trim.moment_Nm == pytest.approx([weight_N * x_m, weight_N * y_m], abs=1e-9)


@pytest.mark.parametrize("current", [(0.1, 0.0), (-0.08, 0.04)])
def test_a_level_current_is_no_weight(current) -> None:
    """Its lift and moment on a pitched hull are those of the believed drag, and are taken out."""
    X, body = turned((0.0, -40.0, 30.0)), compile_body(VEHICLE)
    past = np.concatenate([-np.array([*current, 0.0]) @ X.R, np.zeros(3)])
    drag = damping_wrench(body, past) + coriolis_wrench(body, past)
    assert abs(X.R[2] @ drag[:3]) > 0.02
    trim = found(3.0, 0.05, 0.0, [(0.0, -40.0, 30.0)], drag)
    assert trim.heavy_N == pytest.approx(3.0, abs=1e-4)
    assert trim.moment_Nm == pytest.approx([0.15, 0.0], abs=1e-4)
    assert trim.weight_std_N > 0.01


def test_the_block_takes_the_load_away() -> None:
    """A weight on the grid of what a person can do: the ballasted vehicle lacks nothing any more."""
    trim = found(3.0, 0.10, -0.05)
    (block,) = trim.blocks
    assert (block.float_N, block.at_B_m) == (3.0, (0.1, -0.05, Z_M))
    for degrees in ATTITUDES:
        X = turned(degrees)
        lighter, own = (restoring_wrench(compile_body(v), X.q) for v in (with_blocks(VEHICLE, trim.blocks), VEHICLE))
        assert lighter - own + weighed(X, 3.0, [0.10, -0.05, Z_M]) == pytest.approx(np.zeros(6), abs=1e-9)


def test_words_say_what_and_where() -> None:
    """Float or lead, how much, forward or aft and to which side."""
    assert found(2.9, -0.06, 0.0).advice == "add 3.0 N of float 5 cm aft of the middle"
    assert found(-1.6, 0.11, 0.09).advice == ("add 1.5 N of lead 10 cm forward and 10 cm to starboard of the middle")
    assert found(2.0, 0.0, -0.05).advice == "add 2.0 N of float 5 cm to port of the middle"
    assert found(2.0, 0.01, 0.0).advice == "add 2.0 N of float in the middle"
    assert "it is 2.9 +- 0.0 N heavy" in found(2.9, 0.0, 0.0).words


def test_what_is_not_known_is_left_alone() -> None:
    """Below half a block; or thrusters so strong that their gains hide it: 4 % of 4 x 10 N are 0.8 N."""
    assert found(0.2, 0.0, 0.0).advice == "no change"
    unsure = found(1.0, 0.0, 0.0, thrust_N=10.0)
    assert unsure.weight_std_N == pytest.approx(0.04 * 20.0, rel=0.1) and unsure.advice == "no change"


def test_a_moment_alone_moves_lead() -> None:
    """A nose that hangs without net weight: lead goes aft, a small moment is left."""
    more = np.array([0.0, 0.0, 0.0, 0.0, -0.12, 0.0])
    level = ATTITUDES[:1]
    trim = found(0.0, 0.0, 0.0, level, more)
    assert trim.advice == "move 1.0 N of lead from the middle to 10 cm aft of the middle"
    assert sum(block.float_N for block in trim.blocks) == 0.0
    assert found(0.0, 0.0, 0.0, level, 0.3 * more).advice == "no change"


def test_blocks_stay_on_the_hull() -> None:
    """A load far out is answered at the hull's end, 20 cm of 22.5."""
    assert found(3.0, 0.6, 0.0).blocks[0].at_B_m == (0.2, 0.0, Z_M)


def test_a_wanted_buoyancy_comes_on_top() -> None:
    """Half a newton light: half a newton more of float, and the place a little nearer to the middle."""
    trim = found(2.0, 0.25, 0.0, light_N=0.5)
    assert trim.worth and trim.blocks[0].float_N == 2.5 and trim.blocks[0].at_B_m == (0.2, 0.0, Z_M)


@pytest.mark.parametrize("weight_N", np.linspace(-3.0, 6.0, 37))
def test_a_vehicle_is_never_left_heavy(weight_N) -> None:
    """Blocks of half a newton leave it neutral to half a newton light; a change below that is not proposed unasked."""
    trim = found(weight_N, 0.0, 0.0, light_N=LIGHT_N)
    light_N = sum(block.float_N for block in trim.blocks) - weight_N
    assert -1e-9 <= light_N <= 0.5 + 1e-9
    assert trim.worth == (abs(weight_N + LIGHT_N) >= 0.5 - 1e-9)


def test_what_is_no_hover_is_refused() -> None:
    """No rows, rows that do not fit."""
    with pytest.raises(InputError, match="no steps"):
        hover_trim(VEHICLE, np.empty((0, 4)), np.empty((0, 6)), np.empty((0, 8)))
    with pytest.raises(InputError, match="loads_B"):
        hover_trim(VEHICLE, np.ones((2, 4)), np.ones((3, 6)), np.ones((2, 8)))
