"""Laws of the surface score, on shapes whose distances are known in closed form."""

import dataclasses
import os
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import InputError, StageError
from wakewise.vision.evaluation import (
    SURFACE_DEFINITIONS,
    Crop,
    ScaleError,
    SurfaceScore,
    check_extent,
    compare_surface,
    count_views,
    error_colours,
    evaluate_surface,
    sample_surface,
    voxel_downsample,
)

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
RADIUS = 0.06


def ball(radius=RADIUS):
    mesh = trimesh.creation.icosphere(4, radius)
    return SimpleNamespace(vertices_m=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))


def shell(n, radius, rng):
    u = rng.normal(size=(n, 3))
    return radius * u / np.linalg.norm(u, axis=1, keepdims=True)


def test_offset_shell_has_that_error():
    """Points 0.5 mm outside a sphere: RMSE and median are 0.5 mm, everything is covered at 1 mm, and it succeeds."""
    score = evaluate_surface(shell(400_000, RADIUS + 0.0005, np.random.default_rng(0)), ball(), icp=False)
    assert score.rmse_mm == pytest.approx(0.5, abs=0.06)
    assert score.accuracy_median_mm == pytest.approx(0.5, abs=0.06)
    assert score.completeness_1mm_pct > 99.0
    assert score.f_score > 99.9
    assert score.success


def test_half_a_shell_covers_half():
    """A perfect half is accurate and not complete."""
    points = shell(400_000, RADIUS, np.random.default_rng(0))
    score = evaluate_surface(points[points[:, 0] > 0], ball(), icp=False)
    assert score.rmse_mm < 0.1
    assert score.completeness_pct == pytest.approx(50.0 + 100 * 0.003 / (2 * RADIUS), abs=1.0)
    assert not score.success


def test_density_does_not_weigh():
    """Fifty thousand copies of one bad spot, in one cell of the grid, count as that spot."""
    rng = np.random.default_rng(0)
    good = shell(200_000, RADIUS, rng)
    bad = np.array([[87.5, 0.5, 0.5]]) * 0.0008 + rng.normal(0, 1e-5, (50_000, 3))
    once = evaluate_surface(np.concatenate([good, bad[:1]]), ball(), icp=False)
    often = evaluate_surface(np.concatenate([good, bad]), ball(), icp=False)
    assert often.rmse_mm == pytest.approx(once.rmse_mm, abs=0.02)


def test_cap_limits_what_a_stray_point_can_do():
    """With a cap of 1 mm no error above 1 mm is in the RMSE, and what lies beyond the box does not count at all."""
    points = np.concatenate([shell(20_000, RADIUS + 0.01, np.random.default_rng(0)), [[9.0, 9, 9]]])
    score = evaluate_surface(points, ball(), icp=False, cap_mm=1.0)
    assert score.rmse_mm == pytest.approx(1.0)
    assert score.accuracy_p90_mm > 9.0


def test_sand_at_the_foot_does_not_count():
    """Below the clearance above the bed neither truth nor cloud is looked at."""
    crop = Crop(bed_z_m=RADIUS, clearance_m=0.02)
    surface = sample_surface(ball(), crop, np.random.default_rng(0), 20_000)
    assert surface.points_m[:, 2].max() < RADIUS - 0.02
    rng = np.random.default_rng(0)
    sand = np.column_stack([rng.uniform(-0.07, 0.07, (50_000, 2)), np.full(50_000, RADIUS - 0.005)])
    cloud = shell(200_000, RADIUS, rng)
    with_sand = evaluate_surface(np.concatenate([cloud, sand]), ball(), crop=crop, icp=False)
    clean = evaluate_surface(cloud, ball(), crop=crop, icp=False)
    assert with_sand.outside_pct > clean.outside_pct + 10.0
    assert dataclasses.replace(with_sand, outside_pct=clean.outside_pct) == clean


def test_icp_takes_out_a_shift_and_reports_it():
    """A bunny moved by 2 mm scores as one that was not moved, with the displacement named."""
    path = DATA / "mesh_bunny" / "bunny.ply"
    if not path.exists():
        pytest.skip(f"{path.name} is not among the shared data")
    loaded = trimesh.load(path)
    vertices = np.asarray(loaded.vertices) - loaded.centroid
    mesh = SimpleNamespace(vertices_m=0.15 * vertices / np.ptp(vertices, axis=0).max(), faces=np.asarray(loaded.faces))
    rng = np.random.default_rng(0)
    cloud = sample_surface(mesh, Crop(), rng, 80_000).points_m
    cloud = cloud + np.array([0.0012, -0.0012, 0.0012])
    moved = evaluate_surface(cloud, mesh)
    assert moved.icp_displacement_mm == pytest.approx(2.08, abs=0.15)
    assert moved.rmse_mm < 0.2
    assert evaluate_surface(cloud, mesh, icp=False).rmse_mm > 0.7


def test_views_see_the_side_that_faces_them():
    """A far camera sees a cap of the sphere, bounded by the grazing angle; the far side never."""
    surface = sample_surface(ball(), Crop(), np.random.default_rng(0), 20_000)
    seen = count_views(surface, ball(), np.array([[100.0, 0, 0], [100.0, 1, 0]]), min_cosine=0.2)
    cosine = surface.points_m[:, 0] / RADIUS
    assert (seen[cosine > 0.25] == 2).all()
    assert (seen[cosine < 0.15] == 0).all()


def test_something_between_hides_the_surface():
    """A second ball before the first one casts a shadow of no view."""
    one, two = trimesh.creation.icosphere(3, RADIUS), trimesh.creation.icosphere(3, RADIUS)
    two.apply_translation([0.3, 0, 0])
    both = trimesh.util.concatenate([one, two])
    mesh = SimpleNamespace(vertices_m=np.asarray(both.vertices), faces=np.asarray(both.faces))
    surface = sample_surface(mesh, Crop(), np.random.default_rng(0), 20_000)
    seen = count_views(surface, mesh, np.array([[100.0, 0, 0]]))
    middle = (np.linalg.norm(surface.points_m[:, 1:], axis=1) < 0.04) & (surface.points_m[:, 0] > 0)
    assert (seen[middle & (surface.points_m[:, 0] < 0.1)] == 0).all()
    assert (seen[middle & (surface.points_m[:, 0] > 0.3)] == 1).all()


def test_thinning_keeps_one_mean_per_cell():
    """Two points of a cell become their mean; an empty cloud stays empty."""
    out = voxel_downsample(np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [5.0, 0, 0]]), 1.0)
    assert np.allclose(sorted(out.tolist()), [[0.2, 0.1, 0.1], [5, 0, 0]])
    assert len(voxel_downsample(np.zeros((0, 3)), 1.0)) == 0


def test_what_cannot_be_scored_is_refused():
    """No points near, no area, nothing above the bed: each is said."""
    with pytest.raises(StageError, match="0 of its 5 points"):
        evaluate_surface(np.full((5, 3), 9.0), ball())
    with pytest.raises(InputError, match="no area"):
        sample_surface(
            SimpleNamespace(vertices_m=np.zeros((3, 3)), faces=np.array([[0, 1, 2]])),
            Crop(),
            np.random.default_rng(0),
        )
    with pytest.raises(InputError, match="above the bed"):
        sample_surface(ball(), Crop(bed_z_m=-1.0), np.random.default_rng(0))


def test_a_cloud_of_something_else_is_a_failure_not_a_figure():
    """Points spread evenly through the truth's box do not lie on its surface: ICP's own check says so."""
    box = np.random.default_rng(0).uniform(-RADIUS, RADIUS, (5_000, 3))
    with pytest.raises(StageError, match=r"ICP: .* at least 50 % must"):
        evaluate_surface(box, ball(), samples=20_000)


@pytest.mark.parametrize("factor", [1000.0, 39.37, 0.001])
def test_a_reference_in_other_units_is_told(factor):
    """Millimetres or inches taken for metres end as one line with both extents; a factor of three does not."""
    cloud = shell(2000, RADIUS, np.random.default_rng(0))
    other = ball(factor * RADIUS)
    check_extent(cloud, ball(3 * RADIUS).vertices_m)
    with pytest.raises(ScaleError, match="suspicious scale") as caught:
        evaluate_surface(cloud, other)
    assert "metres" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("factor", "told"), [(19.0, False), (21.0, True), (1 / 19.0, False), (1 / 21.0, True)])
def test_a_scale_is_suspicious_beyond_a_factor_of_twenty(factor, told):
    """Of the whole extent, which is told from the middle nine tenths so that stray points do not count."""
    line = np.linspace(-RADIUS, RADIUS, 1001)[:, None] * np.ones(3) / np.sqrt(3.0)
    stray = np.array([[9.0, 9.0, 9.0]])
    with pytest.raises(ScaleError) if told else nullcontext():
        check_extent(np.concatenate([factor * line, stray]), line)


def test_each_point_has_its_error_and_its_colour():
    """Errors of single points are those that the median is of; blue is 0, green half of 3 mm, red 3 mm and more."""
    found = compare_surface(shell(50_000, RADIUS + 0.0005, np.random.default_rng(0)), ball(), icp=False)
    assert len(found.points_W_m) == len(found.error_mm) == found.score.cloud_points
    assert np.median(found.error_mm) == pytest.approx(found.score.accuracy_median_mm)
    assert np.allclose(error_colours(np.array([0.0, 1.5, 3.0, 9.0])), [[0, 0, 1], [0, 1, 0], [1, 0, 0], [1, 0, 0]])


def test_every_figure_is_defined():
    """Each field of a score has a unit and a definition, and each definition a field."""
    assert set(SURFACE_DEFINITIONS) == set(SurfaceScore.__dataclass_fields__)
    assert all(text for _, text in SURFACE_DEFINITIONS.values())


def test_what_counts_as_seen_is_what_the_definition_says():
    """The angle in the words of visible_pct is the one at which a far camera stops seeing a ball, nothing being set."""
    said_deg = float(SURFACE_DEFINITIONS["visible_pct"][1].split("less than ")[1].split(" deg")[0])
    surface = sample_surface(ball(), Crop(), np.random.default_rng(0), 20_000)
    seen = count_views(surface, ball(), np.array([[1000.0, 0, 0]])) > 0
    angle_deg = np.degrees(np.arccos(np.clip(surface.normals[:, 0], -1, 1)))
    assert angle_deg[seen].max() == pytest.approx(said_deg, abs=1.0)
    assert seen[angle_deg < said_deg - 1.0].all()


def test_seen_is_by_as_many_cameras_as_the_definitions_say():
    """One fewer than the number in their words, and nothing counts as seen, nothing being set."""
    numbers = {"one": 1, "two": 2, "three": 3, "four": 4}
    said = {
        numbers[text.split("at least ")[1].split(" camera")[0]]
        for key, (_, text) in SURFACE_DEFINITIONS.items()
        if "visible" in key
    }
    (enough,) = said
    cloud = shell(100_000, RADIUS, np.random.default_rng(0))
    for views in (enough - 1, enough):
        centres = np.array([[100.0, k, 0.0] for k in range(views)])
        score = evaluate_surface(cloud, ball(), camera_centres_W_m=centres, icp=False, samples=5_000)
        assert (score.visible_pct > 30.0) == (views == enough)
        assert (score.completeness_visible_pct is not None) == (views == enough)


def test_a_surface_is_sampled_evenly():
    """Each quarter of a triangle gets a quarter of its samples, and each triangle its share of the area."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.2, 3.0, 0.0], [0.2, -1.0, 0.0]])
    mesh = SimpleNamespace(vertices_m=corners, faces=np.array([[0, 1, 2], [1, 0, 3]]))
    points = sample_surface(mesh, Crop(), np.random.default_rng(0), 40_000).points_m
    upper = points[points[:, 1] > 0.0]
    assert len(upper) == pytest.approx(30_000, abs=2)
    # Barycentric coordinates: a quarter of the area lies at each corner, where that corner's is above one half.
    share = np.linalg.solve(
        np.vstack([corners[:3, :2].T, np.ones(3)]), np.vstack([upper[:, :2].T, np.ones(len(upper))])
    )
    quarters = [*(share > 0.5).mean(axis=1), (share <= 0.5).all(axis=0).mean()]
    np.testing.assert_allclose(quarters, 0.25, atol=0.01)
    np.testing.assert_allclose(share.mean(axis=1), 1.0 / 3.0, atol=0.005)
