"""Aiming by pitch, by tilt and by both."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.core.geometry import euler_from_quat, quat_integrate
from wakewise.robot.vehicles import load_vehicle
from wakewise.robot.vehicles.vehicle import TiltJoint
from wakewise.scene.missions import CameraAim, MissionSettings, RoutePilot, aim_of, check_tilt, plan_route

PAPER, HEAVY = load_vehicle("paper"), load_vehicle("bluerov2-heavy")
CENTRE = np.array([0.0, 0.0, 1.4])
ROUTE = plan_route(CENTRE, MissionSettings())
SWINGING = TiltJoint(
    low_rad=math.radians(-45.0), high_rad=math.radians(45.0), rate_rad_s=1.0, p_BJ_m=np.array([0.17, 0.0, 0.02])
)
SWUNG = replace(HEAVY, tilt=SWINGING)
instants = st.floats(0.0, ROUTE.duration_s)


@given(instants, st.sampled_from([PAPER, HEAVY, SWUNG]), st.sampled_from(["auto", "pitch"]))
def test_body_and_tilt_put_the_camera_where_the_route_wants_it(time_s, vehicle, by) -> None:
    """X_WB X_BC(tilt) is the route's camera, at every instant, whatever it is aimed with."""
    aim = aim_of(vehicle, by)
    tilt, _ = ROUTE.tilt(time_s, aim)
    X_WC = ROUTE.body(time_s, aim).X_WB @ vehicle.X_BC_at(tilt)
    reference, _, _ = ROUTE.camera(time_s)
    assert X_WC.p_m == pytest.approx(reference.p_m, abs=1e-12)
    assert pytest.approx(reference.R, abs=1e-12) == X_WC.R


def away_from_corners(time_s: float, aim: CameraAim) -> bool:
    """No leg begins or ends here and no stop is reached, so that the pose has a derivative."""
    corners = [*ROUTE.starts_s, *(s + leg.duration_s for s, leg in zip(ROUTE.starts_s, ROUTE.legs, strict=True))]
    if min(abs(time_s - corner) for corner in corners) < 1e-3:
        return False
    tilts = [ROUTE.tilt(time_s + d, aim) for d in (-1e-3, 1e-3)]
    return (tilts[0][1] == 0.0) == (tilts[1][1] == 0.0)


@given(instants, st.sampled_from([HEAVY, SWUNG]))
@settings(max_examples=60)
def test_the_twist_is_the_derivative_of_the_pose(time_s, vehicle) -> None:
    """Also while the joint turns and swings the camera about its hinge."""
    aim, h = aim_of(vehicle), 1e-5
    if not away_from_corners(time_s, aim):
        return
    here = ROUTE.body(time_s, aim)
    after, before = (ROUTE.body(time_s + d, aim).X_WB for d in (h, -h))
    v_W = (after.p_m - before.p_m) / (2 * h)
    assert here.X_WB.R.T @ v_W == pytest.approx(here.nu_B[:3], abs=2e-5)
    on = quat_integrate(before.q, here.nu_B[3:], 2 * h)
    assert abs(float(on @ after.q)) == pytest.approx(1.0, abs=1e-9)


@given(instants)
def test_within_its_stops_the_joint_leaves_the_vehicle_level(time_s) -> None:
    """On orbits of 20 and 40 deg the heavy vehicle neither pitches nor rolls; beyond 45 deg it pitches the rest."""
    aim = aim_of(HEAVY)
    roll, pitch, _ = euler_from_quat(ROUTE.body(time_s, aim).X_WB.q)
    leg = ROUTE.legs[ROUTE.leg_at(time_s)]
    assert roll == pytest.approx(0.0, abs=1e-9)
    if max(leg.start[1], leg.end[1]) <= math.radians(45.0):
        assert pitch == pytest.approx(0.0, abs=1e-9)
        assert ROUTE.tilt(time_s, aim)[0] < 0.0
    elif leg.start[1] == leg.end[1]:
        assert (math.degrees(pitch), math.degrees(ROUTE.tilt(time_s, aim)[0])) == pytest.approx((-15.0, -45.0))


def test_a_mount_that_looks_down_needs_less_tilt() -> None:
    """A camera mounted 20 deg down tilts by 20 deg less."""
    down = SWINGING.mount(HEAVY.X_BC, math.radians(-20.0))
    aim = CameraAim(X_BC=down, joint=SWINGING)
    assert aim.tilt(math.radians(-40.0)) == pytest.approx((math.radians(-20.0), 0.0), abs=1e-12)


def test_auto_takes_the_joint_where_there_is_one() -> None:
    """Else pitch; pitch alone leaves a joint at rest."""
    assert aim_of(HEAVY).joint is HEAVY.tilt
    assert aim_of(PAPER).joint is None
    assert aim_of(HEAVY, "pitch").joint is None
    goal = RoutePilot(route=ROUTE, aim=aim_of(HEAVY, "pitch")).goal(20.0, None)
    assert goal.tilt_rad == 0.0


def test_the_pilot_tells_the_desired_tilt() -> None:
    """With the pose that goes with it."""
    aim = aim_of(HEAVY)
    goal = RoutePilot(route=ROUTE, aim=aim).goal(20.0, None)
    assert goal.tilt_rad == ROUTE.tilt(20.0, aim)[0] == pytest.approx(math.radians(-20.0))
    assert goal.X_WB.p_m == pytest.approx(ROUTE.body(20.0, aim).X_WB.p_m)


def test_what_the_joint_cannot_do_is_said_beforehand() -> None:
    """A tilt beyond the stops, a joint that is too slow, and a joint that is not there: one line each."""
    with pytest.raises(
        InputError, match=r"mission.aim: tilt, on leg 'climb to orbit 60 deg' .* -45 and 45 deg: take both"
    ):
        check_tilt(ROUTE, aim_of(HEAVY, "tilt"), stops_suffice=True)
    check_tilt(ROUTE, aim_of(HEAVY, "both"))
    slow = replace(HEAVY, tilt=replace(HEAVY.tilt, rate_rad_s=math.radians(2.0)))
    with pytest.raises(InputError, match=r"mission.speed_m_s: on leg '.*' .* its joint turns at 2 deg/s"):
        check_tilt(ROUTE, aim_of(slow))
    low = plan_route(CENTRE, MissionSettings(elevations_deg=(20.0, 40.0), views=(8, 8)))
    check_tilt(low, aim_of(HEAVY, "tilt"), stops_suffice=True)
    for by in ("tilt", "both"):
        with pytest.raises(InputError, match=f"mission.aim: {by}, the camera of paper has no tilt joint"):
            aim_of(PAPER, by)
