"""Extent over a plane, and its repeatability by two halves of the photographs."""

import numpy as np
import pytest
from tagged_relief import poses, true_model

from wakewise.core.errors import InputError, StageError
from wakewise.vision.reconstruction.outputs.clouds import OrientedPointCloud, write_cloud, write_mesh
from wakewise.vision.reconstruction.quality.split_half_check import GroundPlane, cells_of, extent_over, measure_halves

FLAT = GroundPlane(origin=np.zeros(3), axes=np.eye(3))


def field(rise, size=0.4, count=81):
    """A square field with a cone of this height in its middle, looking up."""
    x, y = np.meshgrid(np.linspace(-size / 2, size / 2, count), np.linspace(-size / 2, size / 2, count))
    z = rise * np.clip(1.0 - np.hypot(x, y) / 0.1, 0.0, 1.0)
    n = np.arange(count * count).reshape(count, count)
    a, b, c, d = n[:-1, :-1].ravel(), n[:-1, 1:].ravel(), n[1:, 1:].ravel(), n[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), faces


def test_a_cone_on_a_field_has_its_area_and_volume():
    """Against the formulas for a cone; a plane has rugosity 1, no volume; other cells do not count."""
    vertices, faces = field(0.08)
    cells = cells_of(vertices, faces, FLAT, 0.02)
    assert len(cells) == 400
    extent = extent_over(vertices, faces, FLAT, 0.02, cells)
    cone = np.pi * 0.1 * np.hypot(0.1, 0.08)
    assert extent.plan_area == pytest.approx(0.16)
    assert extent.area == pytest.approx(0.16 - np.pi * 0.01 + cone, rel=2e-3)
    assert extent.volume == pytest.approx(np.pi * 0.01 * 0.08 / 3.0, rel=5e-3)
    assert extent.rugosity == pytest.approx(extent.area / 0.16)
    plain = extent_over(*field(0.0), FLAT, 0.02, cells)
    assert plain.rugosity == pytest.approx(1.0)
    assert plain.volume == pytest.approx(0.0, abs=1e-12)
    corner = {cell for cell in cells if cell[0] < -7}
    assert extent_over(vertices, faces, FLAT, 0.02, corner).rugosity == pytest.approx(1.0)


def test_halves_that_differ_are_told_by_how_much(tmp_path):
    """Halves with cones of 78 and 82 mm repeat to 5 % in volume, and less in area; each gets its own photographs."""
    true_model(tmp_path / "sparse", {f"{k:02d}.png": pose for k, pose in enumerate(poses())}, 1.0)
    names = [f"{k:02d}.png" for k in range(9)]
    grey = np.full((81 * 81, 3), 0.5)
    vertices, faces = field(0.08)
    write_mesh(tmp_path / "mesh.ply", vertices, faces, grey)
    wide, _ = field(0.08, count=121)
    write_cloud(
        tmp_path / "dense.ply",
        OrientedPointCloud(
            points_m=wide, normals=np.tile([0.0, 0.0, 1.0], (len(wide), 1)), colours=np.full((len(wide), 3), 0.5)
        ),
    )
    asked = []

    def make(half, folder, places):
        asked.append((half, sorted(places)))
        rise = 0.078 if folder.name == "a" else 0.082
        write_mesh(folder / "mesh.ply", *field(rise), grey)

    with pytest.raises(InputError, match="9 photos have a place"):
        measure_halves(tmp_path, names, make, metric=True)
    # The figures do not hang on how many photographs there are.
    twelve = sorted([*names, *names[:3]])
    said = measure_halves(tmp_path, twelve, make, metric=True)
    assert said["volume"]["repeat_pct"] == pytest.approx(5.0, abs=0.5)
    assert 0.0 < said["area"]["repeat_pct"] < 2.0
    assert abs(said["volume"]["whole"]) == pytest.approx(np.pi * 0.01 * 0.08 / 3.0, rel=0.05)
    assert said["unit"] == "m"
    assert len(asked) == 2
    assert asked[0][0] == twelve[::2]
    (tmp_path / "mesh.ply").unlink()
    with pytest.raises(StageError, match="holds no triangles"):
        measure_halves(tmp_path, twelve, make, metric=True)
