"""Imaging settings refuse what no camera or water has."""

import math

import pytest
from pydantic import ValidationError

from wakewise.errors import InputError
from wakewise.imaging import ImagingSettings, LensCamera, PinholeCamera
from wakewise.imaging.optics import water_types


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
