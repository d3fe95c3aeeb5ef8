"""A vehicle that is led along a flight's way makes that flight's water."""

import numpy as np
import pytest

from wakewise.core.geometry import quat_from_rotvec
from wakewise.operation import Scenario, fly
from wakewise.simulation.tank.tank import tank_ambient, tank_points
from wakewise_paper.wash_reduction.prescribed_motion import PrescribedMotionTank, PrescribedPath

pytestmark = pytest.mark.slow

_STATE = (
    ("x_m", "y_m", "z_m"),
    ("qw", "qx", "qy", "qz"),
    ("u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s"),
)


@pytest.fixture(scope="module")
def flown():
    """A flight of a heavy vehicle in water without gusts, and the same led."""
    parts = Scenario.preset(
        "quick", method="dp", **{"tank.mismatch.trim_N": -5.0, "tank.jets.turbulence": 0.0, "world": "tank"}
    ).parts()
    steps = fly(parts, checked=False, duration_s=14.0, water_every_s=0.1).steps
    state = [steps.select(f"true_{name}" for name in names).to_numpy() for names in _STATE]
    way = PrescribedPath(times_s=steps["time_s"].to_numpy(), p_WB_m=state[0], q_WB=state[1], nu_B=state[2])
    world = parts.world
    led = PrescribedMotionTank(
        vehicle=world.vehicle,
        target=world.target,
        settings=world.settings,
        ambient=tank_ambient(world.settings, world.draw()),
        way=way,
        points_W_m=tank_points(world.target, world.draw()),
    )
    thrusts = steps.select(f"thrust_{i + 1}_N" for i in range(8)).to_numpy()
    at = np.stack([np.interp(led.times_s, way.times_s, column) for column in thrusts.T], axis=1)
    return steps, led, at


def test_a_flight_that_is_led_again_has_its_own_wash(flown):
    """The same places, water without gusts: until parcels' chaos tells, at five seconds, within a twentieth."""
    steps, led, thrusts = flown
    speeds = led.wash_m_s(thrusts, 5, 0)
    looks = led.times_s[5::5]
    truth = np.interp(looks, steps["time_s"].to_numpy(), steps["target_speed_mean_m_s"].to_numpy())
    early = (looks > 2.0) & (looks < 5.1)
    assert truth[early].max() > 0.001
    assert np.abs(speeds[early] - truth[early]).max() < 0.05 * truth[early].max()
    assert speeds[looks > 8.0].mean() == pytest.approx(truth[looks > 8.0].mean(), rel=0.2)


def test_thrusts_that_are_nothing_leave_no_more_than_the_hull_does(flown):
    """What is told is what thrusters add; the hull's own wake is small beside it."""
    _, led, thrusts = flown
    still = led.wash_m_s(np.zeros_like(thrusts), 5, 0)
    assert still.max() < 0.1 * led.wash_m_s(thrusts, 5, 0).max()


def test_between_its_steps_a_way_goes_straight_and_minds_no_sign_of_a_quaternion():
    """Both q and -q are one attitude: half way between them lies no other."""
    q = quat_from_rotvec(np.array([0.0, 0.0, 0.4]))
    way = PrescribedPath(
        times_s=np.array([0.0, 1.0]), p_WB_m=np.array([[0.0, 0, 0], [2.0, 0, 0]]), q_WB=np.array([q, -q]),
              nu_B=np.zeros((2, 6)))  # fmt: skip
    middle = way.at(np.array([0.5]))
    assert middle.p_WB_m[0, 0] == 1.0
    assert abs(middle.q_WB[0] @ q) == pytest.approx(1.0)
