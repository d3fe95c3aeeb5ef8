"""Cameras that are known and stay: photographs too far apart for anything else, and cameras that are wrong."""

import cv2
import numpy as np
import pytest
import relief

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction import KnownCameras, Lens, ReconstructionSettings, read_cloud, reconstruct
from wakewise.vision.reconstruction.sfm.pose_mapping import nearest_to_lines
from wakewise_benchmarks import adversarial_scenes as scenes

SETTINGS = ReconstructionSettings(detector="opencv", max_features=1500, mesh=False)
LENS = Lens(width=320, height=240, params=np.array([300.0, 300.0, 160.0, 120.0, 0, 0, 0, 0]))


def known(poses):
    return KnownCameras(
        rotations={name: R for name, (R, _) in poses.items()},
        positions={name: p for name, (_, p) in poses.items()},
        lenses=dict.fromkeys(poses, LENS),
    )


def test_the_point_nearest_to_lines_is_where_they_meet():
    """Lines through one point give it, however they are placed along themselves."""
    rng = np.random.default_rng(0)
    point, axes = rng.normal(size=3), rng.normal(size=(7, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    centres = point - rng.uniform(0.5, 2.0, (7, 1)) * axes
    np.testing.assert_allclose(nearest_to_lines(centres, axes), point, atol=1e-12)


@pytest.mark.slow
def test_a_ring_of_twelve_thirty_degrees_apart_becomes_a_model(tmp_path):
    """All twelve stand where they were said to be, and the cloud lies on the rock."""
    (tmp_path / "photos").mkdir()
    poses = {}
    for k, camera in enumerate(scenes.ring(12)):
        name = f"{k:02d}.png"
        cv2.imwrite(str(tmp_path / "photos" / name), scenes.photograph(scenes.rock(), camera))
        poses[name] = (camera.R_WC, camera.p_WC_m)
    model = reconstruct(tmp_path / "photos", tmp_path / "model", SETTINGS, known=known(poses))
    assert model.registered_images == 12 and model.mapping == "at the known cameras"
    assert model.warnings == [] and model.reprojection_met
    assert model.scale == 1.0 and model.point_spacing_mm is not None
    points = read_cloud(tmp_path / "model" / "dense.ply").points_m
    length = np.linalg.norm(points, axis=1)
    error_mm = 1e3 * np.abs(length - scenes.rock_radius(points / length[:, None]))
    assert len(points) > 20_000 and np.median(error_mm) < 0.3


def test_cameras_in_other_axes_are_doubted_and_strangers_named(relief_photos, tmp_path):
    """Right poses pass; with axes right, up, back the photos speak against them; a photo without a pose is told."""
    folder, truth = relief_photos
    poses = {name: (X.R, X.p_m) for name, X in truth.items()}
    fewer = dict(list(poses.items())[:-1])
    model = reconstruct(folder, tmp_path / "right", SETTINGS, known=known(fewer))
    assert model.warnings == [] and (model.images, model.registered_images) == (6, 5)
    assert [(one["name"], one["why"]) for one in model.left_out] == [("05.png", "no known camera")]
    assert model.summary()["why"]["cameras_rmse_mm"] == "the cameras are as they were given"
    rng = np.random.default_rng(0)
    shaken = {name: (R, p + rng.normal(0.0, 0.02, 3)) for name, (R, p) in poses.items()}
    found = reconstruct(folder, tmp_path / "wrong", SETTINGS, known=known(shaken))
    assert not found.reprojection_met and "cameras that were given" in found.warnings[0]


def test_as_priors_the_photos_correct_them(relief_photos, tmp_path):
    """Poses that are 3 mm off come out right, within a millimetre or two."""
    folder, truth = relief_photos
    rng = np.random.default_rng(1)
    rough = {name: (X.R, X.p_m + rng.normal(0.0, 0.002, 3)) for name, X in truth.items()}
    settings = SETTINGS.model_copy(update={"known_cameras": "priors", "first_octave": 0})
    model = reconstruct(folder, tmp_path / "model", settings, known=known(rough))
    assert model.mapping == "from known poses", model.poses_refused
    assert model.registered_images == 6 and model.cameras_rmse_mm == pytest.approx(3.4, abs=2.5)
    assert model.reprojection_px < 0.5


def test_what_does_not_go_together_is_refused(relief_photos, tmp_path):
    """A pose without a lens, and references beside known cameras."""
    folder, truth = relief_photos
    poses = {name: (X.R, X.p_m) for name, X in truth.items()}
    bare = KnownCameras(rotations=known(poses).rotations, positions=known(poses).positions)
    with pytest.raises(InputError, match="has a pose and no lens"):
        reconstruct(folder, tmp_path / "a", SETTINGS, known=bare)
    with pytest.raises(InputError, match="no others beside them"):
        reconstruct(folder, tmp_path / "a", SETTINGS, known=known(poses), focal_px=relief.FOCAL)
    assert not (tmp_path / "a").exists()
