"""OpenCV's features in COLMAP's conventions: where a keypoint is, how large, its descriptor, and the dark."""

import cv2
import numpy as np
import pytest
from relief import photo, poses, texture

from wakewise.vision.reconstruction import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.features import photo_features, stretched


def blob(x, y, sigma, shape=(160, 200)):
    """A bright Gaussian whose middle is at (x, y), pixel centres at +0.5."""
    v, u = np.indices(shape) + 0.5
    grey = 40 + 170 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * sigma**2))
    return np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2)


@pytest.mark.parametrize(("octave", "sigma"), [(-1, 4.0), (-1, 9.0), (0, 9.0)])
def test_a_blob_is_found_where_it_is_and_as_large_as_it_is(octave, sigma):
    """Positions agree to a tenth of a pixel in COLMAP's convention whatever the octave; so does the scale, roughly."""
    place = (120.0, 80.0)
    settings = ReconstructionSettings(first_octave=octave, detector="opencv")
    keypoints, descriptors = photo_features(blob(*place, sigma), settings)
    nearest = np.linalg.norm(keypoints[:, :2] - place, axis=1).argmin()
    assert np.allclose(keypoints[nearest, :2], place, atol=0.1)
    assert 0.6 * sigma < keypoints[nearest, 2] < 1.7 * sigma
    assert descriptors.dtype == np.uint8
    length = np.sqrt((descriptors.astype(float) ** 2).sum(axis=1)) / 512
    assert np.allclose(length, 1.0, atol=0.1)


def test_no_more_features_than_asked_for_and_none_of_nothing():
    """The cap holds, the strongest stay; an even grey has no features."""
    image = photo(poses(6)[0], texture())[0]
    many = photo_features(image, ReconstructionSettings(detector="opencv"))
    few = photo_features(image, ReconstructionSettings(detector="opencv", max_features=200))
    assert len(few.keypoints) == len(few.descriptors) == 200 < len(many.keypoints)
    assert len(photo_features(np.full((60, 80, 3), 99, np.uint8), ReconstructionSettings()).keypoints) == 0


def test_the_dark_is_stretched_and_the_bright_is_left():
    """A photo at a twelfth of the light has nearly as many features; one of full contrast is not touched."""
    image = photo(poses(6)[0], texture())[0]
    settings = ReconstructionSettings(detector="opencv", first_octave=0)
    bright = len(photo_features(image, settings).keypoints)
    dark = len(photo_features((image // 12).astype(np.uint8), settings).keypoints)
    assert dark > 0.6 * bright > 100
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
    assert stretched(grey) is grey
