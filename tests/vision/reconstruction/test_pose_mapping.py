"""Models from known poses: slow errors of the poses do not matter, poses that do not fit are refused."""

import numpy as np
import pytest
from relief import FOCAL

from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec
from wakewise.core.interfaces import no_progress
from wakewise.vision.reconstruction import ReconstructionSettings, read_photos
from wakewise.vision.reconstruction.sfm.features import match_photos
from wakewise.vision.reconstruction.sfm.mapping import MAPPINGS, map_photos
from wakewise.vision.reconstruction.sfm.pairs import choose_pairs
from wakewise.vision.reconstruction.sfm.pose_mapping import map_from_poses

SETTINGS = ReconstructionSettings(detector="opencv", max_features=1000, first_octave=0)


@pytest.fixture(scope="module")
def matched(relief_photos, tmp_path_factory):
    folder, truth = relief_photos
    database = tmp_path_factory.mktemp("matched") / "database.db"
    photos = read_photos(folder)
    pairs = choose_pairs([photo.name for photo in photos], SETTINGS)
    match_photos(folder, photos, database, SETTINGS, focal_px=FOCAL, pairs=pairs, progress=no_progress)
    return folder, database, truth


def drifting(truth, seed, shift_m=0.005, turn_rad=0.003, every_s=3.0, time_s=20.0):
    """Poses with errors that forget themselves in `time_s`: first-order autoregressive, a photo every 3 s."""
    rng = np.random.default_rng(seed)
    keep = np.exp(-every_s / time_s)
    error, out = rng.normal(size=6), {}
    for name, X in truth.items():
        turn = matrix_from_quat(quat_from_rotvec(turn_rad * error[3:]))
        out[name] = (turn @ X.R, X.p_m + shift_m * error[:3])
        error = keep * error + np.sqrt(1.0 - keep**2) * rng.normal(size=6)
    return out


def mapped(matched, out, poses, references):
    folder, database, _ = matched
    out.mkdir(exist_ok=True)
    return map_photos(
        folder, database, out / "sparse", SETTINGS, photos=6, references=references, progress=no_progress, poses=poses
    )


@pytest.mark.parametrize("seed", range(3))
def test_slow_errors_of_the_poses_leave_the_same_model(matched, tmp_path, seed):
    """Poses off by 5 mm and 3 mrad for 20 s at a time pass the gate, and cameras come out as from the photos alone."""
    truth = matched[2]
    centres = {name: X.p_m for name, X in truth.items()}
    plain = mapped(matched, tmp_path / "a", None, centres)
    seeded = mapped(matched, tmp_path / "b", drifting(truth, seed), centres)
    assert plain["mapping"] == MAPPINGS["incremental"]
    assert seeded["mapping"] == MAPPINGS["poses"] and seeded["poses_refused"] is None
    assert seeded["registered_images"] == plain["registered_images"] == 6
    assert seeded["points"] > 0.8 * plain["points"]
    assert seeded["reprojection_px"] < plain["reprojection_px"] + 0.05
    # Held against the true centres: the errors of the poses are no longer in it.
    assert seeded["cameras_rmse_mm"] < plain["cameras_rmse_mm"] + 0.3


def test_poses_that_do_not_fit_are_refused_and_the_photos_decide(matched, tmp_path):
    """From wrong poses there is no model, the reason is told, and the photos alone give theirs."""
    truth = matched[2]
    centres = {name: X.p_m for name, X in truth.items()}
    found = mapped(matched, tmp_path, drifting(truth, 0, shift_m=0.2, turn_rad=0.5), centres)
    assert found["mapping"] == MAPPINGS["incremental"]
    assert "must" in found["poses_refused"] or "allowed" in found["poses_refused"]
    assert found["registered_images"] == 6 and found["cameras_rmse_mm"] < 2.0


def test_a_matched_photo_without_a_pose_is_named(matched):
    """Poses of five of six photos are not enough: the sixth is named and there is no model."""
    _, database, truth = matched
    poses = {name: (X.R, X.p_m) for name, X in truth.items() if name != "04.png"}
    found = map_from_poses(database, poses, SETTINGS, 6, no_progress)
    assert found.model is None and "04.png" in found.refusal


def test_the_same_poses_give_the_same_model(matched):
    """Nothing in it is left to chance: points and cameras of two runs are equal to the bit."""
    _, database, truth = matched
    one, two = (map_from_poses(database, drifting(truth, 1), SETTINGS, 6, no_progress).model for _ in range(2))
    assert sorted(one.points3D) == sorted(two.points3D)
    for number in one.points3D:
        assert (one.points3D[number].xyz == two.points3D[number].xyz).all()
