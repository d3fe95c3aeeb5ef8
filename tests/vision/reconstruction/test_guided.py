"""Matching along epipolar lines: the fast kernel is the plain sum, poses are borne out or not believed."""

import numpy as np
import pycolmap
import pytest
from relief import FOCAL

from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec, skew
from wakewise.core.interfaces import no_progress
from wakewise.vision.reconstruction import ReconstructionSettings, read_photos
from wakewise.vision.reconstruction.sfm.features import match_photos
from wakewise.vision.reconstruction.sfm.guided_matching import (
    BAND_RAD,
    MAX_ANGLE_RAD,
    RATIO,
    PhotoFeatures,
    RelativePose,
    match_by_poses,
    match_pair,
    pose_supported,
    verify,
)
from wakewise.vision.reconstruction.sfm.pairs import choose_pairs

SETTINGS = ReconstructionSettings(detector="opencv", max_features=1000, first_octave=0)


def described(rng, n):
    """Descriptors of length 512 as features have them."""
    root = np.sqrt(rng.dirichlet(np.full(128, 0.3), size=n))
    return np.rint(512 * root).clip(0, 255).astype(np.uint8)


def scene(rng, n=300, noise_rad=3e-4, t=(0.1, 0.03, 0.02)):
    """Points half a metre before two cameras: their places on both unit planes, and the relative pose."""
    X_1 = np.column_stack([rng.uniform(-0.3, 0.3, (n, 2)), rng.uniform(0.35, 0.7, n)])
    R, t = matrix_from_quat(quat_from_rotvec(np.array([0.05, -0.2, 0.03]))), np.array(t)
    X_2 = X_1 @ R.T + t
    first, second = (X[:, :2] / X[:, 2:] + rng.normal(0.0, noise_rad, (n, 2)) for X in (X_1, X_2))
    return first, second, RelativePose(R_21=R, t_2=t / np.linalg.norm(t))


def off(pose, rng, turn_rad, shift):
    """The pose, turned and with another baseline."""
    t = pose.t_2 + rng.normal(0.0, shift, 3)
    R = matrix_from_quat(quat_from_rotvec(rng.normal(0.0, turn_rad, 3))) @ pose.R_21
    return RelativePose(R_21=R, t_2=t / np.linalg.norm(t))


def twin(first, second, pose):
    """Every feature against every other, those off the band struck out: mutual nearest neighbours, clearly so."""
    lines = np.column_stack([first.xy, np.ones(len(first.xy))]) @ pose.essential.T
    away = np.abs(np.column_stack([second.xy, np.ones(len(second.xy))]) @ lines.T).T
    out = away > BAND_RAD * np.linalg.norm(lines[:, :2], axis=1)[:, None]
    likeness = np.where(out, 0.0, first.descriptors.astype(float) @ second.descriptors.T.astype(float)) / 512.0**2
    angle = np.arccos(np.minimum(likeness, 1.0))
    pairs = []
    for i in range(len(angle)):
        j = int(angle[i].argmin())
        rival = min(np.delete(angle[i], j).min(), np.delete(angle[:, j], i).min())
        if not out[i, j] and angle[:, j].argmin() == i and angle[i, j] <= MAX_ANGLE_RAD and angle[i, j] < RATIO * rival:
            pairs.append((i, j))
    return pairs


@pytest.mark.parametrize("t", [(0.1, 0.03, 0.02), (0.02, 0.1, 0.01), (0.0, 0.0, 0.1)], ids=["across", "up", "ahead"])
def test_the_kernel_is_its_readable_twin(t):
    """Whichever way the epipolar lines run, the same pairs come out as when everything is held against everything."""
    rng = np.random.default_rng(1)
    one, two, pose = scene(rng, t=t)
    own = described(rng, len(one))
    seen = np.clip(own + rng.normal(0.0, 12.0, own.shape), 0, 255).astype(np.uint8)
    order = rng.permutation(len(two))
    first, second = PhotoFeatures(xy=one, descriptors=own), PhotoFeatures(xy=two[order], descriptors=seen[order])
    found = match_pair(first, second, pose)
    assert [tuple(row) for row in found] == twin(first, second, pose)
    assert (order[found[:, 1]] == found[:, 0]).mean() > 0.99 and len(found) > 200


def test_a_pose_that_is_a_little_off_still_holds_the_partners_in_the_band():
    """Relative poses off by 5 mrad, and by 6 mm of a baseline of a decimetre, lose next to no matches."""
    rng = np.random.default_rng(2)
    one, two, pose = scene(rng)
    own = described(rng, len(one))
    first, second = PhotoFeatures(xy=one, descriptors=own), PhotoFeatures(xy=two, descriptors=own)
    kept = [len(match_pair(first, second, off(pose, rng, 0.005, 0.06))) for _ in range(20)]
    assert np.mean(kept) > 0.97 * len(one)


def test_verifying_finds_the_right_pose_and_the_wrong_matches():
    """From a pose off by 5 mrad and 6 % of the baseline, one match in five being wrong, it is found to 1 mrad."""
    rng = np.random.default_rng(3)
    one, two, pose = scene(rng)
    wrong = np.arange(0, 300, 5)
    two[wrong] += rng.uniform(0.05, 0.2, (len(wrong), 2)) * [1, -1]
    known = off(pose, rng, 0.005, 0.06)
    fitted, right = verify(one, two, known, 480.0)
    turn = fitted.R_21 @ pose.R_21.T
    assert np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)) < 1e-3
    assert np.degrees(np.arccos(np.clip(fitted.t_2 @ pose.t_2, -1, 1))) < 1.5
    assert right[np.setdiff1d(np.arange(300), wrong)].all()
    assert right[wrong].mean() < 0.2
    assert pose_supported(right, known, fitted)


def test_matches_by_chance_are_not_trusted():
    """Places that have nothing to do with each other do not bear out a pose, nor a handful, nor those of another."""
    rng = np.random.default_rng(4)
    one, two, pose = scene(rng)
    another = off(pose, rng, 0.15, 0.0)

    def believed(first, second, known):
        fitted, right = verify(first, second, known, 480.0)
        return pose_supported(right, known, fitted)

    assert believed(one, two, pose)
    assert not believed(one, rng.permutation(two), pose)
    assert not believed(one[:10], two[:10], pose)
    assert not believed(one, two, another)


def test_no_baseline_is_no_pose():
    """Two cameras in one place have no epipolar lines; elsewhere the essential matrix is that of the two poses."""
    R = np.eye(3)
    assert RelativePose.between(R, np.zeros(3), R, np.zeros(3)) is None
    pose = RelativePose.between(R, np.array([0.2, 0.0, 0.0]), R, np.zeros(3))
    np.testing.assert_allclose(pose.essential, skew([1.0, 0.0, 0.0]))


@pytest.fixture(scope="module")
def looked_at(relief_photos, tmp_path_factory):
    """The relief's photos with features, its pairs matched by their true poses, by wrong ones and without any."""
    folder, truth = relief_photos
    photos = read_photos(folder)
    names = [photo.name for photo in photos]
    pairs = choose_pairs(names, SETTINGS)
    right = {name: (X.R, X.p_m) for name, X in truth.items()}
    rng = np.random.default_rng(7)
    wrong = {
        name: (matrix_from_quat(quat_from_rotvec(rng.normal(0.0, 0.5, 3))) @ R, p) for name, (R, p) in right.items()
    }
    found = {}
    for what, poses in (("right", right), ("wrong", wrong), ("none", None)):
        database = tmp_path_factory.mktemp(what) / "database.db"
        found[what] = (
            database,
            match_photos(
                folder, photos, database, SETTINGS, focal_px=FOCAL, pairs=pairs, progress=no_progress, poses=poses
            ),
        )
    return found, pairs, right


def test_poses_that_fit_match_more_and_poses_that_do_not_change_nothing(looked_at):
    """By right poses most pairs match along epipolar lines; by wrong ones they match as without any."""
    found, pairs, _ = looked_at
    (_, right), (_, wrong), (_, none) = (found[what] for what in ("right", "wrong", "none"))
    assert right["posed_pairs"] >= 0.6 * len(pairs) and right["inlier_matches"] > 0.9 * none["inlier_matches"]
    assert wrong["posed_pairs"] == none["posed_pairs"] == 0
    assert wrong["inlier_matches"] == none["inlier_matches"]
    assert right["pairs"] == wrong["pairs"] == len(pairs)


def test_what_is_written_is_what_colmap_reads(looked_at):
    """Verified pairs are calibrated geometries whose essential matrix fits the matches to 4 px."""
    found, pairs, _ = looked_at
    link = pycolmap.Database.open(found["right"][0])
    try:
        ids = {image.name: image.image_id for image in link.read_all_images()}
        geometry = link.read_two_view_geometry(ids[pairs[0][0]], ids[pairs[0][1]])
        one, two = (np.asarray(link.read_keypoints(ids[name]))[:, :2] for name in pairs[0])
    finally:
        link.close()
    assert geometry.config == pycolmap.TwoViewGeometryConfiguration.CALIBRATED
    rows = np.asarray(geometry.inlier_matches)
    middle = np.array([160.0, 120.0])
    x, y = ((xy - middle) / FOCAL for xy in (one[rows[:, 0]], two[rows[:, 1]]))
    lines = np.column_stack([x, np.ones(len(x))]) @ np.asarray(geometry.E).T
    away = np.abs((np.column_stack([y, np.ones(len(y))]) * lines).sum(axis=1)) / np.linalg.norm(lines[:, :2], axis=1)
    assert len(rows) > 50 and FOCAL * away.max() < 8.0


def test_too_many_features_for_memory_are_left_to_others(looked_at):
    """Where descriptors would not fit into memory no pair is matched here; so are pairs without a pose."""
    found, pairs, right = looked_at
    database = found["right"][0]
    assert match_by_poses(database, pairs, right, 1, no_progress, most_bytes=1e3) == pairs
    assert match_by_poses(database, pairs, {}, 1, no_progress) == pairs
