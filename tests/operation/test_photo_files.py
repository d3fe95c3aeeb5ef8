"""Photographs on disk: PNG keeps every byte, JPEG nearly, and both are whole files."""

import cv2
import numpy as np

from wakewise.operation import load_scenario, photo_name
from wakewise.operation.photography import write_image
from wakewise.vision.imaging import ImagingSettings


def test_png_is_exact_and_jpeg_close(tmp_path):
    """PNG gives back the image; JPEG of quality 92 is within a few grey levels and smaller, 30 smaller still."""
    y, x = np.mgrid[0:120, 0:160]
    image = np.stack([100 + 60 * np.sin(x / 9.0), 90 + 50 * np.cos(y / 7.0), x + 0 * y], axis=-1).astype(np.uint8)
    write_image(tmp_path / "a.png", image)
    write_image(tmp_path / "a.jpg", image)
    write_image(tmp_path / "b.jpg", image, 30)
    assert np.array_equal(cv2.imread(str(tmp_path / "a.png"))[..., ::-1], image)
    back = cv2.imread(str(tmp_path / "a.jpg"))[..., ::-1].astype(float)
    assert np.sqrt(np.mean((back - image) ** 2)) < 4.0
    assert (tmp_path / "b.jpg").stat().st_size < (tmp_path / "a.jpg").stat().st_size
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.jpg", "a.png", "b.jpg"]


def test_format_is_png_unless_asked():
    """PNG is the default, JPEG an option with a quality."""
    assert ImagingSettings().photo_format == "png"
    assert ImagingSettings(photo_format="jpeg", jpeg_quality=80).jpeg_quality == 80


def test_the_suffix_follows_the_format():
    """A photograph keeps the route's name, and its suffix says how it is stored."""
    scenario = load_scenario("quick", None, {})
    stored = load_scenario("quick", None, {"imaging.photo_format": "jpeg"})
    assert photo_name("007.png", scenario) == "007.png"
    assert photo_name("007.png", stored) == "007.jpg"
