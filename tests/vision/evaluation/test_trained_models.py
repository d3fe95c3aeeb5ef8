"""Splats and the frame of nerfstudio: points, scores and files whose values are known in closed form."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from splat_files import write_splats

from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec
from wakewise.ui.cli.main import run
from wakewise.vision.evaluation import GaussianSplats, Similarity, nerfstudio_frame, read_splats
from wakewise.vision.evaluation.trained_models import SPLAT_DEFINITIONS

FAR = np.full(3, 10.0)


def _grid(side_m: float, spacing_m: float) -> np.ndarray:
    line = np.arange(-0.5 * side_m, 0.5 * side_m + 1e-9, spacing_m)
    x, y = (values.ravel() for values in np.meshgrid(line, line))
    return np.column_stack([x, y, np.zeros(len(x))])


def test_a_file_gives_back_what_was_written(tmp_path: Path):
    """Opacity is the logistic function of what is stored, a standard deviation the exponential of it."""
    rng = np.random.default_rng(0)
    centres, sigmas = rng.normal(size=(20, 3)), rng.uniform(1e-3, 1e-2, (20, 3))
    opacity, turns = rng.uniform(0.05, 0.95, 20), np.array([quat_from_rotvec(v) for v in rng.normal(size=(20, 3))])
    found = read_splats(write_splats(tmp_path / "s.ply", centres, opacity, sigmas, 3.0 * turns))
    assert found is not None
    np.testing.assert_allclose(found.centres_m, centres, atol=1e-6)
    np.testing.assert_allclose(found.opacity, opacity, atol=1e-6)
    np.testing.assert_allclose(found.sigmas_m, sigmas, rtol=1e-5)
    np.testing.assert_allclose(found.axes, matrix_from_quat(turns), atol=1e-6)


def test_a_flat_gaussian_is_its_ellipse(tmp_path: Path):
    """Standard deviations of 5 and 3 mm: all points in its plane, within the ellipse, as many as its area holds."""
    turn = quat_from_rotvec([0.3, -0.5, 0.9])
    sigmas = np.array([[3e-3, 1e-5, 5e-3]])  # the longest axis is the file's third
    splats = read_splats(write_splats(tmp_path / "s.ply", np.full((1, 3), 0.2), np.array([0.9]), sigmas, turn[None]))
    assert splats is not None
    points, figures = splats.surface(0.5, 1e-4, -FAR, FAR)
    local = (points - 0.2) @ matrix_from_quat(turn)
    assert np.abs(local[:, 1]).max() < 1e-7
    assert ((local[:, 0] / 3e-3) ** 2 + (local[:, 2] / 5e-3) ** 2).max() < 1.0 + 1e-5
    assert len(points) == pytest.approx(np.pi * 3e-3 * 5e-3 / 1e-8, rel=0.02)
    assert figures["splats_sigma_median_mm"] == pytest.approx(5.0, rel=1e-5)


def test_small_and_faint_gaussians():
    """One smaller than the spacing is its centre; one below the opacity, or away from the reference, is nothing."""
    splats = GaussianSplats(
        centres_m=np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [5.0, 0.0, 0.0]]),
        opacity=np.array([0.9, 0.4, 0.9]),
        sigmas_m=np.full((3, 3), 1e-5),
        axes=np.tile(np.eye(3), (3, 1, 1)),
    )
    points, figures = splats.surface(0.5, 1e-3, -np.ones(3), np.ones(3))
    np.testing.assert_allclose(points, [[0.0, 0.0, 0.0]], atol=1e-12)
    assert (figures["splats"], figures["splats_opaque_pct"]) == (3, pytest.approx(200.0 / 3.0))


def test_huge_gaussians_are_thinned_and_not_endless():
    """Of a hundred as large as the scene there are no more than three million points, at a wider spacing."""
    splats = GaussianSplats(
        centres_m=np.zeros((100, 3)),
        opacity=np.full(100, 0.99),
        sigmas_m=np.tile([50.0, 50.0, 0.0], (100, 1)),
        axes=np.tile(np.eye(3), (100, 1, 1)),
    )
    points, figures = splats.surface(0.5, 1e-3, -np.ones(3), np.ones(3))
    assert 1_000_000 < len(points) < 3_100_000
    assert figures["splats_spacing_mm"] > 1.0


def test_a_similarity_moves_centres_sizes_and_axes():
    """Points of moved splats are moved points."""
    similarity = Similarity(scale=2.5, R_AB=matrix_from_quat(quat_from_rotvec([0.4, 0.1, -0.7])), t_A_m=np.ones(3))
    splats = GaussianSplats(
        centres_m=np.array([[0.1, 0.2, 0.3]]),
        opacity=np.array([0.8]),
        sigmas_m=np.array([[4e-3, 2e-3, 1e-6]]),
        axes=matrix_from_quat(quat_from_rotvec([0.2, 0.9, 0.1]))[None],
    )
    here, _ = splats.surface(0.5, 1e-3, -FAR, FAR)
    there, _ = splats.moved(similarity).surface(0.5, 2.5e-3, -FAR, FAR)
    np.testing.assert_allclose(there, similarity.apply(here), atol=1e-9)


def test_nerfstudio_is_undone(tmp_path: Path):
    """X' = s (T x + t) of points with z up comes back as north, east, down."""
    T, t, s = matrix_from_quat(quat_from_rotvec([0.3, 1.0, -0.2])), np.array([0.4, -0.1, 0.2]), 0.37
    told = {"transform": np.column_stack([T, t]).tolist(), "scale": s}
    (tmp_path / "dataparser_transforms.json").write_text(json.dumps(told))
    ned = np.random.default_rng(1).normal(size=(7, 3))
    trained = s * ((ned * [1.0, -1.0, -1.0]) @ T.T + t)
    np.testing.assert_allclose(nerfstudio_frame(tmp_path / "dataparser_transforms.json").apply(trained), ned, atol=1e-9)
    np.testing.assert_allclose(nerfstudio_frame(None).apply(ned), ned * [1.0, -1.0, -1.0])
    for text in (
        "{}",
        "no json",
        json.dumps(told | {"scale": -1.0}),
        json.dumps(told | {"transform": [[1, 2], [3, 4]]}),
    ):
        (tmp_path / "wrong.json").write_text(text)
        with pytest.raises(InputError, match=r"wrong\.json"):
            nerfstudio_frame(tmp_path / "wrong.json")


@pytest.fixture
def slab(tmp_path: Path) -> Path:
    """A reference of 0.2 m x 0.2 m, two triangles at z = 0, its outside up (z down in the world)."""
    vertices = np.array([[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0]])
    trimesh.Trimesh(vertices, [[0, 2, 1], [0, 3, 2]], process=False).export(tmp_path / "slab.ply")
    return tmp_path / "slab.ply"


def _json(words: list[str], capsys: pytest.CaptureFixture[str]) -> dict:
    assert run(["evaluate", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_splats_beside_a_plane_score_their_distance(slab: Path, tmp_path: Path, capsys):
    """Splats 1.5 mm above a plane: accuracy 1.5 mm, nothing within 1 mm, all within 2 mm; faint ones do not count."""
    centres = _grid(0.2, 0.002) - [0.0, 0.0, 0.0015]
    stray = np.tile([0.0, 0.0, -0.015], (50, 1))
    path = write_splats(
        tmp_path / "s.ply",
        np.concatenate([centres, stray]),
        np.append(np.full(len(centres), 0.8), np.full(50, 0.2)),
        np.full((len(centres) + 50, 3), 1e-4),
    )
    found = _json([str(path), "--reference", str(slab), "--no-icp"], capsys)
    for key in ("accuracy_mean_mm", "accuracy_median_mm", "accuracy_p90_mm", "rmse_mm"):
        assert found[key] == pytest.approx(1.5, abs=1e-3)
    assert (found["accuracy_1mm_pct"], found["accuracy_2mm_pct"]) == (0.0, 100.0)
    assert found["completeness_pct"] == 100.0
    assert found["splats"] == len(centres) + 50
    assert found["splats_opaque_pct"] == pytest.approx(100.0 * len(centres) / (len(centres) + 50))
    assert set(SPLAT_DEFINITIONS) <= found["definitions"].keys()
    strict = run(["evaluate", str(path), "--reference", str(slab), "--no-icp", "--opacity", "0.9"])
    assert strict == 1
    assert "has opacity 0.9" in capsys.readouterr().err


def test_large_splats_cover_what_their_centres_do_not(slab: Path, tmp_path: Path, capsys):
    """Discs of 10 mm on a lattice of 14 mm cover the plane; their centres alone leave most of it open."""
    centres = _grid(0.196, 0.014)
    sigmas = np.tile([0.010, 0.010, 1e-6], (len(centres), 1))
    path = write_splats(tmp_path / "s.ply", centres, np.full(len(centres), 0.9), sigmas)
    found = _json([str(path), "--reference", str(slab), "--no-icp"], capsys)
    assert found["completeness_1mm_pct"] > 99.5
    assert found["accuracy_mean_mm"] == pytest.approx(0.0, abs=1.0)
    points = trimesh.PointCloud(centres)
    points.export(tmp_path / "centres.ply")
    alone = _json([str(tmp_path / "centres.ply"), "--reference", str(slab), "--no-icp"], capsys)
    assert alone["completeness_1mm_pct"] < 5.0


def test_a_model_of_nerfstudio_is_scored_in_the_frame_of_the_reference(slab: Path, tmp_path: Path, capsys):
    """Splats in a turned, shifted, scaled world with z up score as they do at home."""
    T, t, s = matrix_from_quat(quat_from_rotvec([0.3, 1.0, -0.2])), np.array([0.4, -0.1, 0.2]), 0.37
    (tmp_path / "dp.json").write_text(json.dumps({"transform": np.column_stack([T, t]).tolist(), "scale": s}))
    home = _grid(0.2, 0.002) - [0.0, 0.0, 0.0015]
    trained = s * ((home * [1.0, -1.0, -1.0]) @ T.T + t)
    path = write_splats(tmp_path / "s.ply", trained, np.full(len(home), 0.8), np.full((len(home), 3), 1e-4))
    found = _json([str(path), "--reference", str(slab), "--no-icp", "--dataparser", str(tmp_path / "dp.json")], capsys)
    assert found["accuracy_mean_mm"] == pytest.approx(1.5, abs=0.01)
    up = write_splats(
        tmp_path / "u.ply", home * [1.0, -1.0, -1.0], np.full(len(home), 0.8), np.full((len(home), 3), 1e-4)
    )
    found = _json([str(up), "--reference", str(slab), "--no-icp", "--frame", "nerfstudio"], capsys)
    assert found["accuracy_mean_mm"] == pytest.approx(1.5, abs=0.01)


def test_a_coarse_mesh_is_scored_by_its_triangles(slab: Path, tmp_path: Path, capsys):
    """The reference against itself, four vertices: too few points; sampled, it is itself."""
    assert run(["evaluate", str(slab), "--reference", str(slab), "--no-icp"]) == 1
    capsys.readouterr()
    found = _json([str(slab), "--reference", str(slab), "--no-icp", "--mesh-samples", "50000"], capsys)
    assert found["accuracy_mean_mm"] == pytest.approx(0.0, abs=1e-9)
    assert found["completeness_2mm_pct"] > 99.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["plain.ply", "--opacity", "0.5"], "splats only"),
        (["s.ply", "--mesh-samples", "500"], "meshes only"),
        (["s.ply", "--frame", "enu"], "reference, nerfstudio"),
        (["s.ply", "--dataparser", "none.json"], "dataparser_transforms.json"),
        (["s.ply", "--views", "v"], "--photos FOLDER"),
        ([], "give a model"),
    ],
)
def test_bad_words_are_one_line(words, said, slab, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_splats(tmp_path / "s.ply", _grid(0.2, 0.01), np.full(441, 0.8), np.full((441, 3), 1e-4))
    trimesh.PointCloud(_grid(0.2, 0.01)).export(tmp_path / "plain.ply")
    assert run(["evaluate", *words, "--reference", "slab.ply"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_splats_that_are_damaged_are_refused(tmp_path: Path):
    """No number in any of them; a cloud is no splats."""
    path = write_splats(tmp_path / "s.ply", np.full((3, 3), np.nan), np.full(3, 0.5), np.ones((3, 3)))
    with pytest.raises(InputError, match="finite"):
        read_splats(path)
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "cloud.ply")
    assert read_splats(tmp_path / "cloud.ply") is None
    two = read_splats(write_splats(tmp_path / "2d.ply", np.eye(3), np.full(3, 0.5), np.full((3, 3), 0.1), scales=2))
    assert two is not None
    assert (two.sigmas_m[:, 2] == 0.0).all()
