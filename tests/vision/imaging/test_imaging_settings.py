"""Imaging settings refuse what no camera or water has."""

import math

import pytest
from pydantic import ValidationError

from wakewise.core.errors import InputError
from wakewise.vision.imaging import ImagingSettings, LensCamera, PinholeCamera
from wakewise.vision.imaging.optics import water_types


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("width", 0),
        ("fov_deg", 180.0),
        ("exposure_s", 0.0),
        ("samples", 0),
        ("water_type", "mud"),
        ("lamp", -1.0),
        ("gain", float("nan")),
        ("instants", 1),
        ("flakes_per_m3", -1.0),
        ("shutter", 1.0),
        ("panels", -0.1),
        ("distortion", (0.1, 0.2)),
        ("port_air_m", -0.01),
        ("photo_format", "gif"),
        ("jpeg_quality", 0),
        ("kind", "polaroid"),
        ("readout_s", -0.01),
    ],
)
def test_bad_values_are_refused(field, value):
    """Values out of range, unknown waters and unknown fields raise, naming the field."""
    with pytest.raises(ValidationError, match=field):
        ImagingSettings(**{field: value})


def test_settings_make_their_parts():
    """The camera has the settings' field of view, and every named water has optics."""
    settings = ImagingSettings(width=640, height=480, fov_deg=60.0)
    assert settings.camera().fov_rad == pytest.approx(math.radians(60))
    assert settings.lights().lamps_C_m.shape == (2, 3)
    for kind in water_types():
        assert (ImagingSettings(water_type=kind).water().signal_per_m > 0).all()


def test_settings_choose_the_lens():
    """Neither distortion nor port: the ideal camera. Either: a lens with it, of the same field of view."""
    assert isinstance(ImagingSettings().camera(), PinholeCamera)
    bent = ImagingSettings(distortion=(-0.1, 0.1, 0.0, 0.0)).camera()
    behind = ImagingSettings(fov_deg=75.0, port_air_m=0.02).camera()
    assert isinstance(bent, LensCamera)
    assert bent.port is None
    assert behind.port.air_m == 0.02
    assert behind.fov_rad == pytest.approx(math.radians(75))
    with pytest.raises(InputError, match="flat port"):
        ImagingSettings(fov_deg=100.0, port_air_m=0.02).camera()


def test_a_kind_of_camera_fills_in_what_is_not_given():
    """`rov-video` rolls, exposes automatically and compresses; what is given beside it stands."""
    plain, own = ImagingSettings(kind="rov-video"), ImagingSettings(kind="rov-video", readout_s=0.0, fov_deg=70.0)
    assert (plain.readout_s, plain.auto_exposure, plain.photo_format, plain.fov_deg) == (0.032, True, "jpeg", 80.0)
    assert (own.readout_s, own.fov_deg, own.auto_exposure) == (0.0, 70.0, True)
    assert ImagingSettings(kind="still") == ImagingSettings()


def test_rows_see_within_the_window():
    """Exposure and readout fill the window of a fixed exposure; a shorter one that was chosen lies in its middle."""
    rolling = ImagingSettings(exposure_s=0.01, readout_s=0.03)
    assert rolling.window_s == pytest.approx(0.04)
    shutter = rolling.shutter()
    assert (shutter.open, shutter.rolling) == pytest.approx((0.25, 0.75))
    assert (shutter.fraction(0.0, 0.0), shutter.fraction(1.0, 1.0)) == pytest.approx((0.0, 1.0))
    auto = ImagingSettings(kind="rov-video").shutter(0.01)
    assert auto.fraction(0.5, 0.5) == 0.5 and 0.0 < auto.fraction(0.0, 0.0) < auto.fraction(0.0, 1.0)
    assert ImagingSettings().window_s == ImagingSettings().exposure_s and ImagingSettings().shutter().rolling == 0.0
