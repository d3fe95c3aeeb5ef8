"""Corrected copies of photographs: as many as there are photographs, and what a copy loses is said."""

import cv2
import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.size_limits import picture_depth
from wakewise.vision.texturing.photo_colours import copy_names, correct_photos


def image(seed: int, kind: type = np.uint8, channels: int = 3) -> np.ndarray:
    most = np.iinfo(kind).max
    return np.random.default_rng(seed).integers(most // 8, most // 2, (60, 80, channels)).astype(kind)


def test_copies_never_meet():
    """Names that differ in their ending alone, or in that and in large letters, keep the whole name; others theirs."""
    names = ["a.jpg", "a.png", "A.TIF", "b.png", "dive/a.png"]
    assert copy_names(names) == {
        "a.jpg": "a.jpg.jpg", "a.png": "a.png.jpg", "A.TIF": "A.TIF.jpg", "b.png": "b.jpg", "dive/a.png": "dive/a.jpg",
    }  # fmt: skip
    with pytest.raises(InputError, match="large and small letters"):
        copy_names(["a.png", "A.PNG"])
    with pytest.raises(InputError, match="large and small letters"):
        copy_names(["a.jpg", "a.png", "a.jpg.png"])


def test_each_photograph_has_its_copy_and_what_is_lost_is_said(tmp_path):
    """Two of one stem, 16 bits, transparency."""
    photos, out = tmp_path / "photos", tmp_path / "out"
    photos.mkdir()
    cv2.imwrite(str(photos / "a.jpg"), image(0))
    cv2.imwrite(str(photos / "a.png"), image(1))
    cv2.imwrite(str(photos / "deep.png"), image(2, np.uint16))
    cv2.imwrite(str(photos / "deep.tif"), image(3, np.uint16))
    cv2.imwrite(str(photos / "clear.png"), image(4, channels=4))
    done = correct_photos(photos, out)
    assert sorted(path.name for path in out.iterdir()) == [
        "a.jpg.jpg", "a.png.jpg", "clear.jpg", "deep.png.jpg", "deep.tif.jpg"
    ]  # fmt: skip
    assert (done.deep, done.clear, done.renamed) == (2, 1, 4)
    said = " ".join(done.words())
    assert "2 photographs have more than 8 bits and 1 photographs have transparency" in said
    assert "4 copies are named after the whole name" in said
    assert done.summary()["deep"] == 2


@pytest.mark.parametrize(
    ("suffix", "kind", "channels", "told"),
    [
        (".png", np.uint8, 3, (8, False)), (".png", np.uint16, 3, (16, False)), (".png", np.uint8, 4, (8, True)),
        (".tif", np.uint8, 3, (8, False)), (".tif", np.uint16, 3, (16, False)), (".jpg", np.uint8, 3, (8, False)),
    ],
)  # fmt: skip
def test_depth_and_transparency_are_in_the_header(suffix, kind, channels, told):
    """Of PNG and TIFF; JPEG has neither."""
    assert picture_depth(cv2.imencode(suffix, image(0, kind, channels))[1].tobytes()) == told
