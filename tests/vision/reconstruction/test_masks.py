"""Masks: found, checked, and kept out of features and depth."""

import dataclasses

import cv2
import numpy as np
import pytest
from relief import take_photos

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.dense.stereo import DepthMap, masked
from wakewise.vision.reconstruction.photos.masks import read_masks, write_for_colmap
from wakewise.vision.reconstruction.photos.photo_folder import read_photos
from wakewise.vision.reconstruction.sfm.features import Features, within


@pytest.fixture
def photos(tmp_path):
    folder = tmp_path / "photos"
    take_photos(folder, 2)
    return folder, read_photos(folder)


def test_masks_are_found_by_name_or_transparency(photos, tmp_path):
    """As COLMAP and Metashape name them; an opaque PNG has none, a transparent one its own."""
    folder, found = photos
    assert read_masks(folder, found, None) is None
    masks = tmp_path / "masks"
    masks.mkdir()
    left = np.zeros((240, 320), np.uint8)
    left[:, :160] = 255
    cv2.imwrite(str(masks / "00.png.png"), left)
    cv2.imwrite(str(masks / "01_mask.png"), left[:, ::-1])
    said = read_masks(folder, found, masks)
    assert said.of("00.png")[:, :160].all()
    assert not said.of("00.png")[:, 160:].any()
    assert not said.of("01.png")[:, :160].any()
    image = cv2.imread(str(folder / "00.png"))
    cv2.imwrite(str(folder / "00.png"), np.dstack([image, left]))
    own = read_masks(folder, read_photos(folder), None)
    assert list(own.files) == ["00.png"]
    assert own.of("00.png").mean() == 0.5
    assert own.of("01.png") is None
    write_for_colmap(own, ["00.png", "01.png"], tmp_path / "out")
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["00.png.png"]


def test_masks_that_cannot_be_are_named(photos, tmp_path):
    """Another size, everything hidden, no image, no mask of any photo, no folder: one line each."""
    folder, found = photos
    masks = tmp_path / "masks"
    with pytest.raises(InputError, match="is no folder"):
        read_masks(folder, found, masks)
    masks.mkdir()
    with pytest.raises(InputError, match="no mask of any of the 2 photos"):
        read_masks(folder, found, masks)
    cv2.imwrite(str(masks / "00.png"), np.full((120, 160), 255, np.uint8))
    with pytest.raises(InputError, match=r"is 160 x 120 px, its photo 00\.png 320 x 240"):
        read_masks(folder, found, masks)
    cv2.imwrite(str(masks / "00.png"), np.zeros((240, 320), np.uint8))
    with pytest.raises(InputError, match=r"leaves 0\.0 % of 00\.png"):
        read_masks(folder, found, masks)
    (masks / "00.png").write_bytes(b"no image")
    with pytest.raises(InputError, match="is no image"):
        read_masks(folder, found, masks)


def test_what_is_hidden_is_neither_feature_nor_depth():
    """Features go by their pixel; depth by where the rectified view looks through the mask."""
    from analytic_views import straight

    mask = np.zeros((60, 80), bool)
    mask[:, :40] = True
    points = np.array([[39.9, 5, 1, 0], [40.1, 5, 1, 0]], np.float32)
    kept = within(Features(points, np.zeros((2, 128), np.uint8)), mask)
    assert kept.keypoints[:, 0].tolist() == pytest.approx([39.9])
    view = straight(80, 60, 100.0)
    depth = DepthMap(
        first=0,
        second=1,
        focal_px=100.0,
        centre_px=np.array([39.5, 29.5]),
        baseline_m=0.1,
        R_CW=np.eye(3),
        p_WC_m=np.zeros(3),
        depth_m=np.ones((60, 80), np.float32),
        wanted=np.ones((60, 80), bool),
        colours=np.zeros((60, 80, 3), np.uint8),
    )
    out = masked(depth, view, mask)
    assert (out.depth_m[:, :39] == 1.0).all()
    assert (out.depth_m[:, 41:] == 0.0).all()
    assert not out.wanted[:, 41:].any()
    assert masked(depth, view, None) is depth
    assert dataclasses.is_dataclass(out)
