"""transforms.json: its rays, reckoned by its own conventions, hit what our camera sees."""

import json
from pathlib import Path

import numpy as np
import trimesh

from wakewise.core.geometry import Pose
from wakewise.experiments.exports import Photographs, SparsePoints, write_nerfstudio
from wakewise.experiments.exports.records import flu_of
from wakewise.vision.imaging.camera import OpenCVCamera


def _undistorted(x: float, y: float, k1: float, k2: float, p1: float, p2: float) -> tuple[float, float]:
    """Slopes of the ray whose distorted slopes are x and y, by Newton's method on OpenCV's model."""

    def bent(u: np.ndarray) -> np.ndarray:
        a, b = u
        r2 = a * a + b * b
        radial = 1.0 + k1 * r2 + k2 * r2 * r2
        return np.array(
            [
                a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a),
                b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b,
            ]
        )

    u, wanted = np.array([x, y]), np.array([x, y])
    for _ in range(30):
        step = 1e-7
        slopes = np.stack([(bent(u + e) - bent(u - e)) / (2 * step) for e in step * np.eye(2)], axis=1)
        u = u - np.linalg.solve(slopes, bent(u) - wanted)
    return float(u[0]), float(u[1])


def test_rays_hit_the_points_that_our_camera_sees(photographs: Photographs, tmp_path: Path) -> None:
    """Each point, seen by our camera model at a pixel, lies within 1e-9 m of nerfstudio's ray through that pixel."""
    (tmp_path / "out").mkdir()
    write_nerfstudio(tmp_path / "out", photographs)
    told = json.loads((tmp_path / "out" / "transforms.json").read_text())
    ours = OpenCVCamera(
        width=64, height=48, params=photographs.params, ahead_m=0.0, rms_px=0.0, max_px=0.0, depths_m=np.ones(1)
    )
    rng = np.random.default_rng(3)
    track = photographs.track
    for k, frame in enumerate(told["frames"]):
        points_C = np.column_stack([rng.uniform(-0.4, 0.4, (6, 2)), np.ones(6)]) * rng.uniform(0.3, 1.5, (6, 1))
        pixels = ours.project(points_C)
        points_up = flu_of(Pose(track.p_W_m[k], track.q[k]).apply(points_C))
        matrix = np.array(frame["transform_matrix"])
        for pixel, point in zip(pixels, points_up, strict=True):
            x, y = (pixel[0] - told["cx"]) / told["fl_x"], (pixel[1] - told["cy"]) / told["fl_y"]
            x, y = _undistorted(x, y, told["k1"], told["k2"], told["p1"], told["p2"])
            ray = matrix[:3, :3] @ np.array([x, -y, -1.0])  # OpenGL: y up, looks along -z
            ray /= np.linalg.norm(ray)
            away = point - matrix[:3, 3]
            assert away @ ray > 0.0
            assert np.linalg.norm(away - (away @ ray) * ray) < 1e-9


def test_photographs_and_points_lie_beside_the_poses(
    photographs: Photographs, cloud: SparsePoints, tmp_path: Path
) -> None:
    """Every file that is named is there with the same bytes; the cloud stands in the world of the poses."""
    (tmp_path / "out").mkdir()
    write_nerfstudio(tmp_path / "out", photographs, cloud)
    told = json.loads((tmp_path / "out" / "transforms.json").read_text())
    for file, frame in zip(photographs.files, told["frames"], strict=True):
        assert (tmp_path / "out" / frame["file_path"]).read_bytes() == file.read_bytes()
    read = trimesh.load(tmp_path / "out" / told["ply_file_path"], process=False)
    np.testing.assert_allclose(read.vertices, flu_of(cloud.points_W_m), atol=1e-12)
    np.testing.assert_array_equal(read.colors[:, :3], cloud.colours)
    assert (told["w"], told["h"]) == (64, 48)
