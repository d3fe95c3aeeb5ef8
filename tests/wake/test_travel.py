"""When a jet's water arrives: published front, continuity, bounds, and what never arrives."""

import numpy as np
import pytest

from wakewise.errors import InputError
from wakewise.wake import RoundJet, arrival_time_s, arrival_times_s

AREA = np.pi * 0.03**2
RHO = 998.0


def test_the_front_far_away_is_the_published_law():
    """Beyond 20 D the front's distance over M^(1/4) t^(1/2) is 2.57 within 5 %, for any thrust."""
    x = np.linspace(1.2, 5.0, 20)
    for thrust in (0.3, -3.0, 30.0):
        t = arrival_time_s(x, thrust, AREA)
        np.testing.assert_allclose(x / ((abs(thrust) / RHO) ** 0.25 * np.sqrt(t)), 2.57, rtol=0.05)


def test_the_front_starts_at_half_the_exit_speed_and_never_jumps():
    """Near the disk dx/dt = U0 / 2; time and speed are continuous where the far law takes over."""
    x = np.linspace(0.0, 0.8, 8001)
    t = arrival_time_s(x, 1.0, AREA)
    speed = np.diff(x) / np.diff(t)
    assert speed[0] == pytest.approx(0.5 / np.sqrt(RHO * AREA))
    assert np.all(np.diff(t) > 0) and np.abs(np.diff(np.log(speed))).max() < 1e-3


def test_steady_water_rides_at_the_centreline_speed():
    """Distance over time, differenced, is the speed of the round jet on its axis; and no front is earlier."""
    x = np.linspace(0.01, 1.5, 600)
    t = arrival_time_s(x, 2.0, AREA, "steady")
    middle = 0.5 * (x[1:] + x[:-1])
    np.testing.assert_allclose(np.diff(x) / np.diff(t), RoundJet().speed(middle, 0.0, 2.0, AREA), rtol=1e-3)
    assert np.all(t < arrival_time_s(x, 2.0, AREA, "front"))


def test_four_times_the_thrust_halves_the_time():
    """Time goes with one over the root of thrust."""
    for how in ("front", "steady"):
        assert arrival_time_s(0.4, 4.0, AREA, how) == pytest.approx(0.5 * arrival_time_s(0.4, 1.0, AREA, how))


def test_times_to_points_follow_the_sign_of_thrust():
    """T > 0 with the axis at the point sends water away: it never arrives. T < 0 sends it there; T = 0 sends none."""
    points = np.array([[0.5, 0.0, 0.0], [-0.5, 0.2, 0.0]])
    place = (points, np.zeros((3, 3)), np.tile([1.0, 0.0, 0.0], (3, 1)), np.full(3, AREA))
    times = arrival_times_s(*place, np.array([1.0, -1.0, 0.0]))
    assert times.shape == (2, 3)
    expected = float(arrival_time_s(0.5, 1.0, AREA))
    np.testing.assert_allclose(times, [[np.inf, expected, np.inf], [expected, np.inf, np.inf]])


def test_a_wake_takes_its_time():
    """At 0.3 to 0.5 m and 0.3 to 3 N, the front takes between half a second and 3.5 s."""
    t = arrival_time_s([[0.3], [0.5]], [0.3, 3.0], AREA)
    assert t.min() > 0.5
    assert t.max() < 3.5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.nan, 1.0, AREA), "distance_m holds NaN"),
        ((0.3, 1.0, 0.0), "area_m2 0, a disk's area must be more than 0"),
        ((0.3, 1.0, AREA, "soon"), "'soon': unknown, allowed: front, steady"),
    ],
)
def test_no_time_without_a_jet(arguments, message):
    """NaN, a disk without area and an unknown way of travelling are named."""
    with pytest.raises(InputError, match=message):
        arrival_time_s(*arguments)
