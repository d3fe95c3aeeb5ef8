"""Orbits: geometry of camera places and their time derivatives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.scene.missions import MissionSettings, layered_orbits
from wakewise.scene.missions.orbit import camera_pose, camera_twist

CENTRE = np.array([0.3, -0.2, 1.42])
angles = st.floats(-7.0, 7.0)
elevations = st.floats(0.05, 1.4)


@given(azimuth=angles, elevation=elevations, reach=st.floats(0.2, 2.0))
def test_the_camera_looks_at_the_centre_from_its_range(azimuth: float, elevation: float, reach: float) -> None:
    """The centre lies on the optical axis, at the range, above the horizon by the elevation."""
    X_WC = camera_pose(CENTRE, azimuth, elevation, reach)
    np.testing.assert_allclose(X_WC.inverse().apply(CENTRE), [0.0, 0.0, reach], atol=1e-12)
    assert CENTRE[2] - X_WC.p_m[2] == pytest.approx(reach * np.sin(elevation))


@given(azimuth=angles, elevation=elevations)
def test_the_image_is_level(azimuth: float, elevation: float) -> None:
    """The camera's right axis is horizontal and its down axis points down."""
    R_WC = camera_pose(CENTRE, azimuth, elevation, 0.5).R
    assert abs(R_WC[2, 0]) < 1e-12
    assert R_WC[2, 1] > 0


@given(azimuth=angles, elevation=elevations, rates=st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_the_twist_is_the_derivative_of_the_pose(
    azimuth: float, elevation: float, rates: tuple[float, float, float]
) -> None:
    """Velocity and angular velocity agree with central differences of the pose."""
    v_W, omega_W = camera_twist(azimuth, elevation, 0.5, *rates)
    h = 1e-5
    after = camera_pose(CENTRE, azimuth + h * rates[0], elevation + h * rates[1], 0.5 + h * rates[2])
    before = camera_pose(CENTRE, azimuth - h * rates[0], elevation - h * rates[1], 0.5 - h * rates[2])
    np.testing.assert_allclose(v_W, (after.p_m - before.p_m) / (2 * h), atol=1e-8)
    spin = (after.R - before.R) / (2 * h) @ camera_pose(CENTRE, azimuth, elevation, 0.5).R.T
    np.testing.assert_allclose(omega_W, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)


def test_views_are_spread_evenly_and_interleave() -> None:
    """Each orbit holds its count of views at equal steps; the next begins between two azimuths of the last."""
    orbits = layered_orbits(MissionSettings(elevations_deg=(20, 40), views=(8, 8)))
    assert [len(o.azimuths_rad) for o in orbits] == [8, 8]
    for orbit in orbits:
        np.testing.assert_allclose(np.diff(orbit.azimuths_rad), 2 * np.pi / 8)
    offset = (orbits[1].azimuths_rad[0] - orbits[0].azimuths_rad[0]) % (2 * np.pi / 8)
    assert offset == pytest.approx(np.pi / 8)
