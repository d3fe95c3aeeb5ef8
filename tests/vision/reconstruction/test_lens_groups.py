"""Photographs are of one lens only where nothing says otherwise: size, folder, EXIF or the user."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.photos.lens_groups import group_photos
from wakewise.vision.reconstruction.photos.lenses import Lens
from wakewise.vision.reconstruction.photos.photo_folder import Photo, exif_words, read_photos, unsupported_files


def photo(name, camera="", size=(640, 480)):
    return Photo(name=name, width=size[0], height=size[1], digest=name, camera=camera)


def lens(width=640, focal=500.0):
    return Lens(width=width, height=480, params=np.array([focal, focal, width / 2, 240.0, 0, 0, 0, 0]))


def members(groups):
    return {group.name: group.photos for group in groups}


def test_cameras_folders_and_sizes_are_told_apart():
    """Each difference alone makes a lens of its own, named by what differs."""
    assert members(group_photos((photo("a"), photo("b")))) == {"640 x 480": ("a", "b")}
    by_exif = group_photos((photo("a", "TG-5 4.5 mm"), photo("b", "TG-5 18 mm"), photo("c", "TG-5 4.5 mm")))
    assert members(by_exif) == {"TG-5 4.5 mm": ("a", "c"), "TG-5 18 mm": ("b",)}
    by_folder = group_photos((photo("left/a"), photo("right/a"), photo("left/b")))
    assert members(by_folder) == {"left": ("left/a", "left/b"), "right": ("right/a",)}
    by_size = group_photos((photo("a"), photo("b", size=(480, 640))))
    assert members(by_size) == {"640 x 480": ("a",), "480 x 640": ("b",)}


def test_what_the_user_says_goes_before_exif():
    """A pattern makes one lens of photos whose EXIF differs, but never of two sizes; each group may have its camera."""
    photos = (photo("L1", "X"), photo("L2", "Y"), photo("R1", "X"))
    groups = group_photos(photos, {"left": "L*"}, {"left": lens(focal=700.0)})
    assert members(groups) == {"left": ("L1", "L2"), "X": ("R1",)}
    assert groups[0].lens is not None and groups[0].lens.params[0] == 700.0 and groups[1].lens is None
    assert len(group_photos((photo("L1"), photo("L2", size=(480, 640))), {"left": "L*"})) == 2


def test_what_does_not_fit_is_named():
    """A pattern without photos, a camera for no lens, a camera of another size."""
    photos = (photo("a"), photo("b"))
    with pytest.raises(InputError, match=r"lens left: none of the 2 photos fits 'L\*'"):
        group_photos(photos, {"left": "L*"})
    with pytest.raises(InputError, match="camera left: there is no such lens, there are 640 x 480"):
        group_photos(photos, None, {"left": lens()})
    with pytest.raises(InputError, match="320 x 480 px, a has 640 x 480"):
        group_photos(photos, None, lens(width=320))


def test_exif_is_read_from_what_cameras_write(tmp_path):
    """Make, model, serial number and focal length of a JPEG; two focal lengths in one folder are two lenses."""
    for k, focal in enumerate((4.5, 18.0, 4.5)):
        picture = Image.fromarray(np.full((20, 30, 3), 40 * k, dtype=np.uint8))
        tags = Image.Exif()
        tags[0x010F], tags[0x0110] = "OLYMPUS CORPORATION    ", "TG-5\0\0"
        tags.get_ifd(0x8769)[0x920A] = focal
        tags.get_ifd(0x8769)[0xA431] = "B123"
        picture.save(tmp_path / f"{k}.jpg", exif=tags)
    photos = read_photos(tmp_path)
    assert photos[0].camera == "OLYMPUS CORPORATION TG-5 B123 4.5 mm"
    assert [group.photos for group in group_photos(photos)] == [("0.jpg", "2.jpg"), ("1.jpg",)]


@given(st.binary(max_size=200))
@settings(max_examples=100, deadline=None)
def test_any_bytes_say_nothing_or_words(data):
    """Reading EXIF never fails: of what is no image it says nothing."""
    assert isinstance(exif_words(data), str)
    assert isinstance(exif_words(b"\xff\xd8\xff\xe1" + data), str)


def test_folders_of_a_rig_are_read_and_films_are_named(tmp_path):
    """Photos in folders below are photos by folder/name; films, HEIC and RAW beside them are counted."""
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        for k in range(2):
            cv2.imwrite(str(tmp_path / side / f"{k}.png"), np.full((20, 30, 3), 50 * k + len(side), dtype=np.uint8))
    assert [p.name for p in read_photos(tmp_path)] == ["left/0.png", "left/1.png", "right/0.png", "right/1.png"]
    for name in ("a.MP4", "b.heic", "c.orf", "d.cr2", "notes.txt"):
        (tmp_path / name).write_bytes(b"x")
    assert unsupported_files(tmp_path) == {"video": 1, "HEIC": 1, "RAW": 2}
