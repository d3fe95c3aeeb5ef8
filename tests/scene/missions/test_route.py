"""Routes: timing and continuity."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler, quat_from_matrix, quat_multiply
from wakewise.scene.missions import MissionSettings, plan_route
from wakewise.scene.missions.orbit import R_FC
from wakewise.scene.missions.route import LONGEST_S, rest_to_rest

CENTRE = np.array([0.0, 0.0, 1.43])
SETTINGS = MissionSettings(elevations_deg=(20, 50), views=(6, 5))
ROUTE = plan_route(CENTRE, SETTINGS)
X_BC = Pose(np.array([0.2, 0.03, -0.05]), quat_multiply(quat_from_euler(0, -0.3, 0), quat_from_matrix(R_FC)))


@given(fraction=st.floats(0.0, 1.0), turn=st.floats(0.001, 6.0))
def test_time_at_inverts_progress(fraction: float, turn: float) -> None:
    """Asking when a fraction is done and then how much is done gives the fraction back, on long and short legs."""
    leg = rest_to_rest("leg", np.array([0.0, 0.4, 0.5]), np.array([turn, 0.4, 0.5]), 0.1, 0.05)
    assert leg.progress(leg.time_at(fraction))[0] == pytest.approx(fraction, abs=1e-9)


def test_speed_and_acceleration_stay_within_their_limits() -> None:
    """On circles the camera is never faster than asked, on slanting climbs by 5 % at most; it gathers speed gently."""
    times = np.arange(0.0, ROUTE.duration_s, 0.01)
    speed = np.array([np.linalg.norm(ROUTE.camera(float(t))[1]) for t in times])
    circling = np.array([ROUTE.legs[ROUTE.leg_at(float(t))].name.startswith("orbit") for t in times])
    assert speed[circling].max() <= SETTINGS.speed_m_s * 1.0001  # lengths are measured along 256 chords
    assert speed.max() <= SETTINGS.speed_m_s * 1.05
    assert np.abs(np.diff(speed)).max() / 0.01 <= SETTINGS.acceleration_m_s2 * 1.3


def test_the_shutter_opens_at_the_planned_places() -> None:
    """At each exposure the reference camera pose is the planned one."""
    for time_s, planned in zip(ROUTE.exposures_s, ROUTE.X_WC_planned, strict=True):
        X_WC, _, _ = ROUTE.camera(float(time_s))
        np.testing.assert_allclose(X_WC.p_m, planned.p_m, atol=1e-9)
        np.testing.assert_allclose(X_WC.R, planned.R, atol=1e-9)
    assert len(ROUTE.exposure_names) == sum(SETTINGS.views)


def test_the_body_twist_is_the_derivative_of_the_body_pose() -> None:
    """For a camera off the body's origin and tilted, body velocity and rate agree with central differences."""
    for time_s in np.linspace(4.0, ROUTE.duration_s - 1.0, 23):
        h = 1e-5
        here = ROUTE.body(float(time_s), X_BC)
        after, before = (ROUTE.body(float(time_s) + d, X_BC).X_WB for d in (h, -h))
        np.testing.assert_allclose(here.X_WB.R @ here.nu_B[:3], (after.p_m - before.p_m) / (2 * h), atol=1e-6)
        spin = here.X_WB.R.T @ (after.R - before.R) / (2 * h)
        np.testing.assert_allclose(here.nu_B[3:], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-6)


def test_before_the_first_leg_the_vehicle_is_asked_to_hover() -> None:
    """While settling, the goal is the start of the approach, at rest."""
    reference = ROUTE.body(0.5, X_BC)
    np.testing.assert_allclose(reference.nu_B, 0.0, atol=1e-12)
    np.testing.assert_allclose(reference.X_WB.p_m, ROUTE.body(0.0, X_BC).X_WB.p_m)


def test_a_flight_of_more_than_a_day_is_refused_with_its_length() -> None:
    """Eight orbits at a crawl take days: the message says how many hours, of how many metres."""
    crawl = MissionSettings(
        elevations_deg=tuple(range(10, 50, 5)), views=(12,) * 8, standoff_m=3.0, speed_m_s=1e-3, settle_s=0.0
    )
    with pytest.raises(
        InputError, match=r"mission: \d+\.\d m at 0\.001 m/s and 0\.05 m/s2 take (\d+\.\d) h, at most 24 h"
    ) as fault:
        plan_route(np.zeros(3), crawl)
    hours = float(str(fault.value).split("take ")[1].split(" h")[0])
    metres = float(str(fault.value).split()[1])
    assert hours == pytest.approx(metres / 1e-3 / 3600.0, rel=0.01)
    assert plan_route(np.zeros(3), crawl.model_copy(update={"speed_m_s": 0.1})).duration_s < LONGEST_S
