"""What GPS receivers and depth gauges tell of photographs: how it is read, and what is refused."""

import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.scale.position_fixes import (
    DEPTH_SIGMA_M,
    GPS_HEIGHT_SIGMA_M,
    GPS_SIGMA_M,
    exif_fixes,
    exif_place,
    read_fixes,
)


def table(tmp_path, text):
    path = tmp_path / "fixes.csv"
    path.write_text(text, encoding="utf-8")
    return path


def photo(gps=None):
    """Bytes of a small JPEG, with or without a fix."""
    image, exif = Image.new("RGB", (8, 8)), Image.Exif()
    if gps is not None:
        exif[0x8825] = gps
    made = io.BytesIO()
    image.save(made, "JPEG", exif=exif)
    return made.getvalue()


def gps(**more):
    return {1: "S", 2: (18.0, 30.0, 36.0), 3: "E", 4: (147.0, 15.0, 0.0), 5: b"\x01", 6: 4.5} | more.get("more", {})


def test_a_table_of_depths_is_read(tmp_path):
    """Depth and what is unsure about it; empty cells say nothing, names match without their suffix."""
    fixes = read_fixes(table(tmp_path, "name,depth_m,depth_sigma_m\na.jpg,3.5,\nb.jpg,4.0,0.02\nc.jpg,,\n"))
    assert fixes.origin is None
    assert fixes.of("a.png").place_W_m[2] == 3.5
    assert np.isnan(fixes.of("a.jpg").place_W_m[:2]).all()
    assert fixes.of("a.jpg").sigma_m[2] == DEPTH_SIGMA_M
    assert fixes.of("b.jpg").sigma_m[2] == 0.02
    assert np.isnan(fixes.of("c.jpg").place_W_m).all()
    assert fixes.of("z.jpg") is None
    assert json.dumps(fixes.key(), allow_nan=False)


def test_degrees_become_metres_on_the_ellipsoid(tmp_path):
    """A minute north and east, across the date line, at the equator and at 60 degrees, by the radii of WGS 84.

    Radii by hand: 6 335 439 and 6 378 137 m at the equator, 6 383 454 and 6 394 209 m at 60 degrees.
    """
    for latitude, north, east in ((0.0, 1842.905, 1855.325), (60.0, 1856.951, 929.989)):
        west = 179.999 + 1.0 / 60.0 - 360.0
        text = f"name,depth_m,lat_deg,lon_deg\na,1,{latitude},179.999\nb,1,{latitude + 1 / 60},{west}\n"
        fixes = read_fixes(table(tmp_path, text))
        assert fixes.origin == (latitude, 179.999)
        assert fixes.of("b").place_W_m[0] == pytest.approx(north, rel=2e-4)
        assert fixes.of("b").place_W_m[1] == pytest.approx(east, rel=2e-4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name\na\n", "needs at least the columns name and depth_m"),
        ("name,depth_m,height\na,1,2\n", "has a column height; allowed are name"),
        ("name,depth_m\n", "holds no fixes"),
        ("name,depth_m\na,deep\n", "line 2: depth_m is 'deep', must be a number"),
        ("name,depth_m\na,inf\n", "line 2: depth_m is inf, must be finite"),
        ("name,depth_m\n,1\n", "line 2: has no name, must be a photo's"),
        ("name,depth_m\na,1\na,2\n", "line 3: a is there twice"),
        ("name,depth_m,lat_deg,lon_deg\na,1,45,\n", "lat_deg and lon_deg must both be said"),
        ("name,depth_m,lat_deg,lon_deg\na,1,95,3\n", "lat_deg must be within 90"),
        ("name,depth_m,lat_deg,lon_deg\na,1,45,3\nb,1,47,3\n", "222 km apart .north."),
        ("name,depth_m,sigma_m\na,1,0\n", "sigma_m is 0, must be above 0"),
        ("name,depth_m,lat_deg,lon_deg,north_m,east_m\na,1,45,3,,\nb,1,,,2,3\n", "in degrees and in metres"),
    ],
)
def test_a_table_that_cannot_be_is_refused_in_a_line(tmp_path, text, words):
    """Where it is, what is wrong, what would be right."""
    with pytest.raises(InputError, match=words) as fault:
        read_fixes(table(tmp_path, text))
    assert "fixes.csv" in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_missing_table_and_bytes_are_refused(tmp_path):
    """A file that is not there, and one that is no text."""
    with pytest.raises(InputError, match="No such file"):
        read_fixes(tmp_path / "none.csv")
    (tmp_path / "bytes.csv").write_bytes(b"name,depth_m\n\xff\xfe\x00")
    with pytest.raises(InputError, match="is no CSV text"):
        read_fixes(tmp_path / "bytes.csv")


def test_exif_tells_places_of_photos(tmp_path):
    """South, east and below the sea, with the receiver's own error if it gives one; photos without a fix say none."""
    folder = tmp_path / "photos"
    (folder / "left").mkdir(parents=True)
    (folder / "left" / "a.jpg").write_bytes(photo(gps()))
    (folder / "left" / "b.jpg").write_bytes(photo(gps(more={2: (18.0, 30.0, 35.0), 5: b"\x00", 31: 1.5})))
    (folder / "left" / "c.jpg").write_bytes(photo())
    fixes = exif_fixes(folder)
    assert set(fixes.fixes) == {"left/a.jpg", "left/b.jpg"}
    assert fixes.of("right/a.jpg") is None
    assert fixes.origin == pytest.approx((-18.51, 147.25))
    a, b = fixes.of("left/a.jpg"), fixes.of("left/b.jpg")
    assert a.place_W_m == pytest.approx([0.0, 0.0, 4.5])
    assert b.place_W_m == pytest.approx([30.74, 0.0, -4.5], abs=0.01)
    assert a.sigma_m == pytest.approx([GPS_SIGMA_M, GPS_SIGMA_M, GPS_HEIGHT_SIGMA_M])
    assert b.sigma_m[:2] == pytest.approx(1.5)


def test_photos_without_fixes_are_said(tmp_path):
    """No photo with one, and a film in place of a folder."""
    (tmp_path / "a.jpg").write_bytes(photo({1: "N", 2: (1.0, 2.0, 3.0)}))
    with pytest.raises(InputError, match="none of 1 photos holds latitude"):
        exif_fixes(tmp_path)
    with pytest.raises(InputError, match="is no folder of photos"):
        exif_fixes(tmp_path / "film.mp4")


@given(st.binary(max_size=200), st.integers(0, 600))
def test_damaged_fixes_say_nothing(noise, at):
    """Whatever bytes a photo holds, a place is whole or there is none."""
    whole = photo(gps())
    found = exif_place(whole[:at] + noise + whole[at + len(noise) :])
    assert found is None or (np.isfinite([*found.angles, found.depth_m]).all() and abs(found.angles[0]) <= 90.0)
