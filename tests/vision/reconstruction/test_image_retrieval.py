"""Photographs that look alike are found by their features, and matched though they are not neighbours by name."""

import numpy as np
from relief import FOCAL

from wakewise.core.interfaces import no_progress
from wakewise.vision.reconstruction import ReconstructionSettings, read_photos
from wakewise.vision.reconstruction.sfm.features import match_photos
from wakewise.vision.reconstruction.sfm.mapping import map_photos
from wakewise.vision.reconstruction.sfm.pairs import ImageDescriptors, describe, learn_words, retrieve_pairs


def test_photos_of_one_thing_are_nearer_than_of_another():
    """Of three things, each seen three times with other features among them, each photo's two likest are its own."""
    rng = np.random.default_rng(0)
    things = rng.integers(0, 120, (3, 200, 128))
    seen = []
    for k in range(9):
        own = things[k % 3][rng.permutation(200)[:120]] + rng.integers(-6, 7, (120, 128))
        seen.append(np.clip(np.concatenate([own, rng.integers(0, 120, (60, 128))]), 0, 255).astype(np.uint8))
    words = learn_words(np.concatenate(seen), rng)
    looks = ImageDescriptors(names=tuple("abcdefghi"), vectors=np.array([describe(one, words) for one in seen]))
    np.testing.assert_allclose(np.linalg.norm(looks.vectors, axis=1), 1.0, atol=1e-5)
    found = retrieve_pairs(looks, 2)
    assert found == [(a, b) for a, b in found if a < b] and len(found) == 9
    assert all(("abcdefghi".index(a) - "abcdefghi".index(b)) % 3 == 0 for a, b in found)


def test_a_photo_without_features_is_like_none():
    """Zeros, not a division by nothing; with no features anywhere as well."""
    words = learn_words(np.zeros((0, 128), dtype=np.uint8), np.random.default_rng(0))
    assert not describe(np.zeros((0, 128), dtype=np.uint8), words).any()


def mapped(folder, out, pairs, retrieved=0):
    settings = ReconstructionSettings(
        detector="opencv", max_features=1000, first_octave=0, check_shared_intrinsics=False
    )
    photos, database = read_photos(folder), out / "database.db"
    matched = match_photos(
        folder, photos, database, settings, focal_px=FOCAL, pairs=pairs, progress=no_progress, retrieved=retrieved
    )
    found = map_photos(folder, database, out / "sparse", settings, photos=6, references=None, progress=no_progress)
    return matched, found


def test_photos_that_no_list_of_pairs_ties_are_tied_by_their_looks(relief_photos, tmp_path):
    """Of six photos one pair was asked for: with three look-alikes each, all register."""
    matched, found = mapped(relief_photos[0], tmp_path, [("00.png", "01.png")], retrieved=3)
    assert 9 <= matched["pairs"] < 15
    assert found["registered_images"] == 6


def test_what_fell_apart_is_matched_across_and_mapped_again(relief_photos, tmp_path):
    """Two lots of three that were never matched with each other become one model, and nobody is left out."""
    lots = [(f"{3 * lot + a:02d}.png", f"{3 * lot + b:02d}.png") for lot in (0, 1) for a, b in ((0, 1), (0, 2), (1, 2))]
    matched, found = mapped(relief_photos[0], tmp_path, lots)
    assert matched["pairs"] == 6
    assert found["registered_images"] == 6 and found["left_out"] == [] and found["sub_models"] == [6]
