"""Folders of image pairs: from pictures and a piv.yaml to samples in the jet frame; the real pairs; faults."""

from __future__ import annotations

import dataclasses
import os
import pathlib

import cv2
import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.vision.piv import Displacements, PivFolder, read_pairs, samples_of_folder, samples_of_vectors
from wakewise_paper.wake_piv import process_real_pairs

DATA = pathlib.Path(os.environ.get("WAKEWISE_DATA", pathlib.Path(__file__).parents[4] / "shared" / "data"))
YAML = (
    "m_per_px: 0.001\ndt_s: 0.01\njet_direction: {way}\ndisk_px: [0, 100]\ndisk_diameter_m: 0.06\n"
    "thrust_N: {{one: 1.0, two: 2.0}}\n"
)


def _folder(tmp_path, way="right"):
    rng = np.random.default_rng(0)
    for name in ("one", "two"):
        grey = cv2.GaussianBlur(rng.uniform(0, 255, (200, 260)), (3, 3), 0)
        cv2.imwrite(str(tmp_path / f"{name}A.png"), grey.astype(np.uint8))
        cv2.imwrite(str(tmp_path / f"{name}B.png"), np.roll(grey, 4, axis=1).astype(np.uint8))
    (tmp_path / "piv.yaml").write_text(YAML.format(way=way), encoding="utf-8")
    return tmp_path


def test_a_folder_becomes_samples_of_every_thrust(tmp_path):
    """4 px of 1 mm in 10 ms are 0.4 m/s along the jet, at both thrusts, about the disk's own row."""
    samples = samples_of_folder(_folder(tmp_path))
    assert samples.thrusts_N.tolist() == [1.0, 2.0]
    assert np.median(samples.speed_m_s) == pytest.approx(0.4, abs=0.002)
    assert np.median(samples.across_m_s) < 0.002
    assert 0.0 < samples.x_m.min() < samples.x_m.max() < 0.26
    assert samples.r_m.max() < 0.1


@pytest.mark.parametrize(
    ("way", "disk", "velocity"),
    [("right", (0, 50), (3, 1)), ("left", (100, 50), (-3, 1)), ("down", (50, 0), (1, 3)), ("up", (50, 100), (1, -3))],
)
def test_every_direction_of_the_jet_is_turned_into_the_jet_frame(way, disk, velocity):
    """Whichever way the jet goes in the picture, its speed along itself is positive and the disk lies upstream."""
    grid = np.arange(8.0, 96.0, 8.0)
    shape = (len(grid), len(grid))
    field = Displacements(
        columns_px=grid,
        rows_px=grid,
        right_px=np.full(shape, float(velocity[0])),
        down_px=np.full(shape, float(velocity[1])),
        valid=np.ones(shape, dtype=bool),
    )
    settings = PivFolder(m_per_px=1e-3, dt_s=1.0, jet_direction=way, disk_px=disk, disk_diameter_m=0.06, thrust_N=1.0)
    samples = samples_of_vectors(field, settings, 1.0, "test")
    np.testing.assert_allclose(samples.speed_m_s, 3e-3)
    np.testing.assert_allclose(samples.across_m_s, 1e-3)
    assert samples.x_m.min() > 0.02
    assert len(samples) == 7 * 7
    assert samples.warnings == ()
    masked = np.ones(shape, dtype=bool)
    masked[5, 4:7] = False
    fewer = samples_of_vectors(dataclasses.replace(field, valid=masked), settings, 1.0, "test")
    assert len(fewer) == 7 * 7 - 3
    assert fewer.warnings == ("3 vectors at 1 N not trusted and left out",)


def test_faulty_folders_are_refused(tmp_path):
    """No folder, no pictures, no partner, no piv.yaml, a wrong field: each in one line that says what is needed."""
    with pytest.raises(InputError, match="no such folder"):
        read_pairs(tmp_path / "none")
    with pytest.raises(InputError, match="no image pairs"):
        read_pairs(tmp_path)
    folder = _folder(tmp_path)
    (folder / "twoB.png").unlink()
    with pytest.raises(InputError, match="no partner twoB"):
        read_pairs(folder)
    (folder / "twoA.png").unlink()
    (folder / "piv.yaml").write_text(YAML.format(way="sideways"), encoding="utf-8")
    with pytest.raises(InputError, match="jet_direction"):
        samples_of_folder(folder)
    (folder / "piv.yaml").write_text(YAML.format(way="right").replace("one: 1.0, ", ""), encoding="utf-8")
    with pytest.raises(InputError, match="no entry for pair one"):
        samples_of_folder(folder)
    (folder / "piv.yaml").unlink()
    with pytest.raises(InputError, match="without scale and time"):
        samples_of_folder(folder)


@pytest.mark.skipif(not (DATA / "piv_jet" / "pairs").is_dir(), reason="reference data piv_jet/pairs are not there")
def test_real_pairs_show_a_jet(tmp_path):
    """A part of a real pair: three vectors of four are valid, and the fast ones go along the jet."""
    for end in "AB":
        whole = cv2.imread(str(DATA / "piv_jet" / "pairs" / f"Jet_0001{end}.jpg"), cv2.IMREAD_GRAYSCALE)
        cv2.imwrite(str(tmp_path / f"part{end}.png"), whole[300:740, 700:1212])
    found = process_real_pairs(tmp_path)
    assert found.valid_pct > 75.0
    assert found.along_jet_pct > 95.0
