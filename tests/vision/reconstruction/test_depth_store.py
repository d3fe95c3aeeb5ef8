"""Depth maps that went to disk are those that were put in, and the cloud made of them is the same to the byte."""

import shutil

import numpy as np
import pytest
from scipy.spatial import KDTree

from wakewise.vision.reconstruction import ReconstructionSettings, reconstruct
from wakewise.vision.reconstruction.dense import dense_points
from wakewise.vision.reconstruction.dense.dense_points import DepthStore
from wakewise.vision.reconstruction.dense.stereo import DepthMap
from wakewise.vision.reconstruction.outputs.clouds import read_cloud
from wakewise.vision.reconstruction.stages import read_stamp

FEW = ReconstructionSettings(
    detector="opencv",
    max_features=1000,
    first_octave=0,
    agreeing_views=1,
    mesh=False,
    check_shared_intrinsics=False,
)


def depth_map(rng, height, width):
    return DepthMap(
        first=int(rng.integers(9)),
        second=9,
        focal_px=float(rng.uniform(100, 200)),
        centre_px=rng.normal(size=2),
        baseline_m=0.1,
        R_CW=np.eye(3),
        p_WC_m=rng.normal(size=3),
        depth_m=rng.uniform(0, 1, (height, width)).astype(np.float32),
        wanted=rng.random((height, width)) < 0.5,
        colours=rng.integers(0, 255, (height, width, 3), dtype=np.uint8),
    )


def test_what_comes_out_is_what_went_in(tmp_path):
    """In memory and on disk alike; the files are those of the maps that found no room."""
    rng = np.random.default_rng(0)
    maps = [depth_map(rng, 20 + k, 30 - k) for k in range(5)]
    store = DepthStore(tmp_path, most_bytes=2 * 8 * 610)
    for one in maps:
        store.add(one)
    assert len(store) == 5
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{k}.{s}" for k in (2, 3, 4) for s in ("depth", "rest")
    ]
    for k, one in enumerate(maps):
        assert store.photos(k) == (one.first, one.second)
        found = store.whole(k)
        for name in ("depth_m", "wanted", "colours"):
            np.testing.assert_array_equal(getattr(found, name), getattr(one, name))
        assert found.focal_px == one.focal_px
        np.testing.assert_array_equal(store.depths(k).depth_m, one.depth_m)


@pytest.mark.slow
def test_a_cloud_from_maps_on_disk_is_the_same_to_the_byte(relief_photos, tmp_path, monkeypatch):
    """With no room in memory at all, from the same sparse model; nothing of them is left in the folder."""
    folder, _ = relief_photos
    monkeypatch.setattr(dense_points.DepthStore.__init__, "__defaults__", (10**9,))
    reconstruct(folder, tmp_path / "memory", FEW)
    shutil.copytree(tmp_path / "memory", tmp_path / "disk")
    (tmp_path / "disk" / "dense.ply").unlink()
    monkeypatch.setattr(dense_points.DepthStore.__init__, "__defaults__", (0,))
    assert set(reconstruct(folder, tmp_path / "disk", FEW).skipped) == {"match", "map"}
    assert (tmp_path / "memory" / "dense.ply").read_bytes() == (tmp_path / "disk" / "dense.ply").read_bytes()
    assert [p.name for p in (tmp_path / "disk").iterdir() if p.name.startswith(".")] == []


@pytest.mark.slow
def test_points_are_thinned_to_a_bound(relief_photos, tmp_path, monkeypatch):
    """A quarter of them is left when cells become twice as large, and what is said of their spacing is true."""
    folder, _ = relief_photos
    whole = reconstruct(folder, tmp_path / "whole", FEW)
    monkeypatch.setattr(dense_points, "MOST_POINTS", round(0.6 * whole.dense_points))
    few = reconstruct(folder, tmp_path / "few", FEW)
    assert 0.15 * whole.dense_points < few.dense_points < 0.4 * whole.dense_points
    spacing_mm, before_mm = (
        read_stamp(tmp_path / name, "dense")["figures"]["point_spacing_mm"] for name in ("few", "whole")
    )
    assert spacing_mm == 2.0 * before_mm
    at = read_cloud(tmp_path / "few" / "dense.ply").points_m
    apart_mm = 1e3 * np.median(KDTree(at).query(at, k=2)[0][:, 1])
    assert 0.4 < apart_mm / spacing_mm < 1.5
