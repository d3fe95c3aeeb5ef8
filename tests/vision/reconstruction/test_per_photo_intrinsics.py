"""Two lenses that nobody told of: told by the photographs, and each given its own."""

import cv2
import numpy as np
import pytest
import relief
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.interfaces import no_progress
from wakewise.vision.evaluation import umeyama
from wakewise.vision.reconstruction import ReconstructionSettings, read_photos
from wakewise.vision.reconstruction.sfm.colmap import pycolmap
from wakewise.vision.reconstruction.sfm.features import match_photos
from wakewise.vision.reconstruction.sfm.mapping import map_photos
from wakewise.vision.reconstruction.sfm.pairs import choose_pairs
from wakewise.vision.reconstruction.sfm.per_photo_intrinsics import PhotoIntrinsics, focal_clusters

SETTINGS = ReconstructionSettings(detector="opencv", max_features=1500)


def own(focals, points=500):
    return {f"{k:03d}": PhotoIntrinsics(focal_px=float(f), points=points) for k, f in enumerate(focals)}


@pytest.mark.parametrize("n", [10, 14, 25, 40])
@pytest.mark.parametrize("spread", [0.01, 0.05])
def test_one_lens_is_hardly_ever_taken_for_two(n, spread):
    """Evenly over a range, the hardest of one heap, at most one draw in fifty parts; about a mean, one in a hundred."""
    rng = np.random.default_rng(n)
    even = [600.0 * np.exp(rng.uniform(-spread, spread, n)) for _ in range(200)]
    about = [600.0 * np.exp(rng.normal(0.0, 0.5 * spread, n)) for _ in range(200)]
    assert sum(len(focal_clusters(own(focals))) > 1 for focals in even) <= 4
    assert sum(len(focal_clusters(own(focals))) > 1 for focals in about) <= 2


@given(st.integers(0, 10_000), st.integers(8, 20), st.floats(1.12, 2.0))
@settings(max_examples=60, deadline=None)
def test_two_lenses_a_tenth_apart_are_told(seed, n, ratio):
    """Two heaps that scatter by 1 % each part photo by photo; one that rests on few points goes to the nearer."""
    rng = np.random.default_rng(seed)
    lens = rng.permutation(np.arange(2 * n) % 2)
    focals = 600.0 * ratio**lens * np.exp(rng.normal(0.0, 0.008, 2 * n).clip(-0.02, 0.02))
    found = focal_clusters(own(focals) | {"few": PhotoIntrinsics(focal_px=610.0, points=3)})
    wanted = {tuple(f"{k:03d}" for k in range(2 * n) if lens[k] == side) for side in (0, 1)}
    assert {tuple(name for name in group if name != "few") for group in found} == wanted
    assert next(group for group in found if "few" in group)[0] == f"{int(np.argmin(lens)):03d}"


@pytest.fixture(scope="module")
def two_lenses(tmp_path_factory):
    """Twelve photographs of the relief; every second one is its middle two thirds, as a longer lens would take."""
    folder = tmp_path_factory.mktemp("lenses") / "images"
    truth = relief.take_photos(folder, 12)
    for k in range(1, 12, 2):
        path = str(folder / f"{k:02d}.png")
        middle = cv2.imread(path)[40:200, 54:267]
        cv2.imwrite(path, cv2.resize(middle[:, :213], (320, 240), interpolation=cv2.INTER_CUBIC))
    return folder, truth


def test_two_lenses_in_one_folder_are_told_and_the_cameras_are_right(two_lenses, tmp_path):
    """Half of the photos at 1.5 times the focal length: two lenses, cameras within 1 % of their spread."""
    folder, truth = two_lenses
    photos = read_photos(folder)
    pairs = choose_pairs([photo.name for photo in photos], SETTINGS)
    database = tmp_path / "database.db"
    match_photos(folder, photos, database, SETTINGS, focal_px=relief.FOCAL, pairs=pairs, progress=no_progress)
    sparse = tmp_path / "sparse"
    found = map_photos(folder, database, sparse, SETTINGS, photos=12, references=None, progress=no_progress)
    model = pycolmap.Reconstruction(sparse)
    centres = {image.name: image.projection_center() for image in model.images.values()}
    names = sorted(centres)
    a, b = np.array([centres[n] for n in names]), np.array([truth[n].p_m for n in names])
    error = np.linalg.norm(umeyama(a, b).apply(a) - b, axis=1)
    spread = np.sqrt(((b - b.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert found["lenses_split"] and found["registered_images"] == 12
    assert sorted({tuple(one["photos"]) for one in found["lenses"]}) == [
        tuple(f"{k:02d}.png" for k in range(side, 12, 2)) for side in (0, 1)
    ]
    focals = sorted(one["focal_px"] for one in found["lenses"])
    assert focals[1] / focals[0] == pytest.approx(1.5, rel=0.01)
    assert np.sqrt((error**2).mean()) < 0.01 * spread
