"""COLMAP models with known poses, read back by COLMAP itself."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.errors import InputError
from wakewise.geometry import Pose
from wakewise.links.exports import Cloud, Photographs, read_points, write_colmap

pycolmap = pytest.importorskip("pycolmap")


@pytest.mark.parametrize("where", ["sparse/0", "sparse_text"])
def test_colmap_reads_the_poses_back(where: str, photographs: Photographs, cloud: Cloud, tmp_path: Path) -> None:
    """Poses, camera and points to 1e-9 from the binary model and from the text; world points project as ours do."""
    (tmp_path / "out").mkdir()
    write_colmap(tmp_path / "out", photographs, cloud)
    model = pycolmap.Reconstruction(tmp_path / "out" / where)
    camera = model.cameras[1]
    assert (camera.model.name, camera.width, camera.height) == ("OPENCV", 64, 48)
    np.testing.assert_allclose(camera.params, photographs.params, atol=1e-9)
    named = {image.name: image for image in model.images.values()}
    assert sorted(named) == [file.name for file in photographs.files]
    for k, file in enumerate(photographs.files):
        X_CW = Pose(photographs.track.p_W_m[k], photographs.track.q[k]).inverse()
        read = named[file.name].cam_from_world()
        np.testing.assert_allclose(read.rotation.matrix(), X_CW.R, atol=1e-9)
        np.testing.assert_allclose(read.translation, X_CW.p_m, atol=1e-9)
        np.testing.assert_allclose(named[file.name].projection_center(), photographs.track.p_W_m[k], atol=1e-9)
        assert (tmp_path / "out" / "images" / file.name).read_bytes() == file.read_bytes()
    points = [model.points3D[k + 1] for k in range(5)]
    np.testing.assert_allclose([point.xyz for point in points], cloud.points_W_m, atol=1e-9)
    np.testing.assert_array_equal([point.color for point in points], cloud.colours)


def test_no_cloud_is_a_model_without_points(photographs: Photographs, tmp_path: Path) -> None:
    """COLMAP opens it, too."""
    (tmp_path / "out").mkdir()
    write_colmap(tmp_path / "out", photographs)
    model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert (model.num_images(), model.num_points3D()) == (4, 0)


def test_points_of_a_model_are_read_without_colmap(photographs: Photographs, cloud: Cloud, tmp_path: Path) -> None:
    """What COLMAP wrote, tracks and all, is read; a file that was cut short is refused in one line."""
    (tmp_path / "out").mkdir()
    write_colmap(tmp_path / "out", photographs)
    model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    for image in model.images.values():
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(np.ones(2)) for _ in range(5)])
    for k in range(5):
        track = pycolmap.Track([pycolmap.TrackElement(image_id, k) for image_id in list(model.images)[: k % 3 + 2]])
        model.add_point3D(cloud.points_W_m[k], track, cloud.colours[k])
    (tmp_path / "theirs").mkdir()
    model.write(tmp_path / "theirs")
    path = tmp_path / "theirs" / "points3D.bin"
    read = read_points(path)
    order = np.argsort(read.points_W_m[:, 0])
    wanted = np.argsort(cloud.points_W_m[:, 0])
    np.testing.assert_array_equal(read.points_W_m[order], cloud.points_W_m[wanted])
    np.testing.assert_array_equal(read.colours[order], cloud.colours[wanted])
    path.write_bytes(path.read_bytes()[:-60])
    with pytest.raises(InputError, match="ends before"):
        read_points(path)
