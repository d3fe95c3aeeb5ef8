"""The whole way on a small relief, what a second run skips, and what an interrupt leaves behind."""

import dataclasses
import json
import shutil

import cv2
import numpy as np
import pytest
from relief import CENTRE, FOCAL, height

from wakewise.core.errors import InputError, StageError
from wakewise.vision.reconstruction import (
    Model,
    ReconstructionRequest,
    ReconstructionSettings,
    read_cloud,
    reconstruct,
)
from wakewise.vision.reconstruction.scale.position_fixes import PositionFix, PositionFixes
from wakewise.vision.reconstruction.sfm.registered_photos import camera_centres

SETTINGS = ReconstructionSettings(max_features=1500, first_octave=0, stereo_partners=2, agreeing_views=1, mesh_depth=6)
REGION = (CENTRE, 0.06)


@pytest.fixture(scope="module")
def model(relief_photos, tmp_path_factory):
    folder, truth = relief_photos
    out = tmp_path_factory.mktemp("model")
    centres = {name: X.p_m for name, X in truth.items()}
    done = []
    result = reconstruct(
        folder,
        out,
        SETTINGS,
        focal_px=FOCAL,
        reference_positions=centres,
        region=REGION,
        progress=lambda a, b, note="": done.append((a, b, note)),
    )
    return folder, out, centres, result, done


def test_relief_comes_back_in_metres(model):
    """All photos register, cameras are where they were, and the points lie on the relief."""
    _, out, _, result, _ = model
    assert result.registered_images == result.images == 6
    assert result.cameras_rmse_mm < 2.0
    assert result.reprojection_px < 1.0
    assert result.inlier_matches > 500
    cloud = read_cloud(out / "dense.ply")
    assert len(cloud.points_m) == result.dense_points > 2000
    error_mm = 1e3 * np.abs(cloud.points_m[:, 2] - height(cloud.points_m[:, 0], cloud.points_m[:, 1]))
    assert np.median(error_mm) < 1.0
    assert np.percentile(error_mm, 90) < 3.0
    assert np.linalg.norm(cloud.points_m - CENTRE, axis=1).max() < 0.065
    # Normals point up at the cameras (z is down), colours are those of a grey photo.
    assert (cloud.normals[:, 2] < 0).mean() > 0.97
    assert np.ptp(cloud.colours, axis=1).max() < 0.01


def test_summary_says_what_was_found(model):
    """The record on disk is the record returned, with every promised key; progress never exceeds its total."""
    _, out, _, result, done = model
    said = json.loads((out / "reconstruction.json").read_text())
    assert said == result.summary()
    promised = "images registered_images points reprojection_px cameras_rmse_mm dense_points wall_s stages_s"
    assert set(promised.split()) <= said.keys()
    assert set(result.stages_s) == {"match", "map", "dense", "mesh"}
    assert all(0 <= a <= b for a, b, _ in done)
    assert {"features", "matches", "stereo"} <= {note for _, _, note in done}
    assert [p for p in out.iterdir() if p.name.startswith(".")] == []


def test_a_new_sparse_model_leaves_nothing_of_the_old_ones_surface(model, tmp_path):
    """Without references the frame is another: cloud, surface and outputs of the earlier run would be of no model."""
    folder, done, centres, *_ = model
    out = shutil.copytree(done, tmp_path / "again")
    for name in ("mesh.glb", "report.html"):
        (out / name).write_bytes(b"of the earlier surface")
    until = ReconstructionRequest(until="sparse")
    kept = reconstruct(folder, out, SETTINGS, focal_px=FOCAL, reference_positions=centres, region=REGION, request=until)
    assert set(kept.skipped) == {"match", "map"}
    assert (out / "mesh.ply").exists()
    assert (out / "mesh.glb").exists()
    assert (out / "report.html").exists()
    changed = reconstruct(folder, out, SETTINGS, focal_px=FOCAL, request=until)
    assert changed.scale is None
    assert not any((out / name).exists() for name in ("dense.ply", "mesh.ply", "mesh.glb", "report.html"))
    assert {path.stem for path in (out / "stages").iterdir()} == {"match", "map", "photos"}


def test_second_run_skips_and_a_changed_setting_does_not(model):
    """Same input: all stages are skipped with the same figures. Another stereo setting: only dense and mesh run."""
    folder, out, centres, first, _ = model
    again = reconstruct(folder, out, SETTINGS, focal_px=FOCAL, reference_positions=centres, region=REGION)
    assert again.skipped == ("match", "map", "dense", "mesh")
    assert again.dense_points == first.dense_points
    other = SETTINGS.model_copy(update={"dense_px": 600, "mesh": False})
    changed = reconstruct(folder, out, other, focal_px=FOCAL, reference_positions=centres, region=REGION)
    assert changed.skipped == ("match", "map")
    assert changed.mesh_faces is None


def test_fixes_that_are_given_up_leave_no_scale_behind(relief_photos, tmp_path):
    """With the fixes of all photos the cameras lie in metres; without them in the same folder they do no more."""
    folder, truth = relief_photos
    fixes = PositionFixes(
        fixes={name: PositionFix(place_W_m=X.p_m, sigma_m=np.full(3, 1e-3)) for name, X in truth.items()}
    )

    def spread_m(request: ReconstructionRequest) -> float:
        reconstruct(folder, tmp_path, SETTINGS, focal_px=FOCAL, request=request)
        return float(np.linalg.norm(np.ptp(list(camera_centres(tmp_path / "sparse").values()), axis=0)))

    true_m = float(np.linalg.norm(np.ptp([X.p_m for X in truth.values()], axis=0)))
    bare = spread_m(ReconstructionRequest(until="sparse"))
    assert abs(bare / true_m - 1.0) > 0.5
    assert spread_m(ReconstructionRequest(until="sparse", fixes=fixes)) == pytest.approx(true_m, rel=0.05)
    assert spread_m(ReconstructionRequest(until="sparse")) == pytest.approx(bare, rel=1e-3)


def test_one_focal_length_holds_for_photos_on_their_sides(relief_photos, tmp_path):
    """Half of the photos turned by a right angle: their sizes are swapped, their focal length is the same."""
    turned = shutil.copytree(relief_photos[0], tmp_path / "turned")
    for path in sorted(turned.iterdir())[::2]:
        cv2.imwrite(str(path), cv2.rotate(cv2.imread(str(path)), cv2.ROTATE_90_CLOCKWISE))
    until = ReconstructionRequest(until="sparse")
    found = reconstruct(turned, tmp_path / "model", SETTINGS, focal_px=FOCAL, request=until)
    assert found.registered_images == 6
    assert len(found.lenses) == 2
    assert all(abs(lens["focal_px"] / FOCAL - 1.0) < 0.05 for lens in found.lenses)


def test_interrupt_leaves_whole_files(relief_photos, tmp_path):
    """Ctrl-C while matching leaves no file at all, while mapping only the whole database of the stage before."""
    folder, _ = relief_photos

    def stop_at(stage):
        def stop(done, total, note=""):
            if note == stage:
                raise KeyboardInterrupt

        return stop

    for stage, left in (("matches", []), ("mapping", ["database.db", "match.json"])):
        with pytest.raises(KeyboardInterrupt):
            reconstruct(folder, tmp_path, SETTINGS, progress=stop_at(stage))
        assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == left


def test_photos_of_different_things_are_a_failure(tmp_path):
    """Photos with nothing in common end as a stage error, not as a model."""
    import cv2

    rng = np.random.default_rng(0)
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), rng.integers(0, 255, (120, 160, 3), dtype=np.uint8))
    with pytest.raises(StageError, match="matching"):
        reconstruct(tmp_path, tmp_path / "out", SETTINGS)
    assert not (tmp_path / "out" / "database.db").exists()


def test_bad_input_is_named_before_anything_runs(relief_photos, tmp_path):
    """Region without references, a focal length of zero, references and pairs of other photos: each is said."""
    folder, _ = relief_photos
    places = {f"{k:02d}.png": np.zeros(3) for k in range(6)}
    for centre, radius in (([np.nan, 0.0, 1.0], 0.1), (CENTRE, np.inf)):
        with pytest.raises(InputError, match=r"region of interest.*must be finite"):
            reconstruct(folder, tmp_path, SETTINGS, reference_positions=places, region=(np.array(centre), radius))
    with pytest.raises(InputError, match="region of interest"):
        reconstruct(folder, tmp_path / "a", SETTINGS, region=REGION)
    with pytest.raises(InputError, match="focal length"):
        reconstruct(folder, tmp_path / "a", SETTINGS, focal_px=0.0)
    with pytest.raises(InputError, match="0 of 6 photos"):
        reconstruct(folder, tmp_path / "a", SETTINGS, reference_positions={"x.png": np.zeros(3)})
    with pytest.raises(InputError, match=r"nothing\.png"):
        reconstruct(folder, tmp_path / "a", SETTINGS, pairs=[("00.png", "nothing.png")])
    shutil.rmtree(tmp_path / "a", ignore_errors=True)


def test_a_model_among_its_photos_is_refused(relief_photos):
    """The folder of the photos is not written to, however it is spelt."""
    folder, _ = relief_photos
    before = sorted(folder.iterdir())
    for out in (folder, folder / "." / ".." / folder.name):
        with pytest.raises(InputError, match="folder of the photos"):
            reconstruct(folder, out, SETTINGS)
    assert sorted(folder.iterdir()) == before


def test_a_figure_that_is_null_says_why():
    """Without references and without a mesh the summary holds null, never zero, and a reason beside each."""
    figures = dict.fromkeys(field.name for field in dataclasses.fields(Model))
    summary = Model(**(figures | {"images": 3, "skipped": ()})).summary()
    assert set(summary["why"]) == {name for name, value in summary.items() if value is None}
    assert "no reference cameras" in summary["why"]["cameras_rmse_mm"]
    assert "no mesh" in summary["why"]["mesh_faces"]
