"""COLMAP models with known poses, read back by COLMAP itself."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.experiments.exports import Photographs, SparsePoints, read_points, write_colmap

pycolmap = pytest.importorskip("pycolmap")
RNG = np.random.default_rng(7)


@pytest.mark.parametrize("where", ["sparse/0", "sparse_text"])
def test_colmap_reads_the_poses_back(where: str, photographs: Photographs, cloud: SparsePoints, tmp_path: Path) -> None:
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


def test_points_of_a_model_are_read_without_colmap(
    photographs: Photographs, cloud: SparsePoints, tmp_path: Path
) -> None:
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


def _theirs(folder: Path, photographs: Photographs, cloud: SparsePoints) -> Path:
    """A sparse model as COLMAP writes it of points that some photographs saw, beside features that belong to none."""
    (folder / "out").mkdir()
    write_colmap(folder / "out", photographs)
    model = pycolmap.Reconstruction(folder / "out" / "sparse" / "0")
    for image in model.images.values():
        pixels = RNG.uniform(0.0, 48.0, (7, 2))
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(pixel) for pixel in pixels])
    for k in range(5):
        track = pycolmap.Track([pycolmap.TrackElement(image_id, k + 1) for image_id in list(model.images)[: k % 3 + 1]])
        model.add_point3D(cloud.points_W_m[k], track, cloud.colours[k])
    (folder / "theirs").mkdir()
    model.write(folder / "theirs")
    return folder / "theirs"


@pytest.mark.parametrize("where", ["sparse/0", "sparse_text"])
def test_points_keep_what_saw_them(where: str, photographs: Photographs, cloud: SparsePoints, tmp_path: Path) -> None:
    """COLMAP reads the observations of its own model back, and reckons the same errors with the poses written here."""
    theirs = _theirs(tmp_path, photographs, cloud)
    before = pycolmap.Reconstruction(theirs)
    (tmp_path / "ours").mkdir()
    count = write_colmap(tmp_path / "ours", photographs, read_points(theirs / "points3D.bin"))
    model = pycolmap.Reconstruction(tmp_path / "ours" / where)
    # A point behind a camera was not seen by it, whatever a track says.
    ahead = {
        image.name: [
            tuple(point.xy)
            for point in image.points2D
            if point.has_point3D() and (image.cam_from_world() * before.points3D[point.point3D_id].xyz)[2] > 0.0
        ]
        for image in before.images.values()
    }
    assert 0 < count == sum(map(len, ahead.values())) == model.compute_num_observations()
    for image in model.images.values():
        assert [tuple(p.xy) for p in image.points2D if p.has_point3D()] == ahead[image.name]
    written = {key: point.error for key, point in model.points3D.items()}
    lone = [key for key, point in model.points3D.items() if point.track.length() == 0]
    assert all(written[key] == -1.0 for key in lone)
    model.update_point_3d_errors()
    for key, point in model.points3D.items():
        if key not in lone:
            assert written[key] == pytest.approx(point.error, rel=1e-9)


def test_points_that_nothing_saw_claim_no_error(photographs: Photographs, cloud: SparsePoints, tmp_path: Path) -> None:
    """Without observations an error is not known, and COLMAP prints none."""
    (tmp_path / "out").mkdir()
    assert write_colmap(tmp_path / "out", photographs, cloud) == 0
    model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert {point.error for point in model.points3D.values()} == {-1.0}
    assert model.compute_mean_reprojection_error() == 0.0


def test_images_that_were_cut_short_are_refused(photographs: Photographs, cloud: SparsePoints, tmp_path: Path) -> None:
    """In one line, as points that were."""
    theirs = _theirs(tmp_path, photographs, cloud)
    data = (theirs / "images.bin").read_bytes()
    for length in (4, 30, 200, len(data) - 5):
        (theirs / "images.bin").write_bytes(data[:length])
        with pytest.raises(InputError, match="ends before the images"):
            read_points(theirs / "points3D.bin")
