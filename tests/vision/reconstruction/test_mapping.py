"""Mapping by either mapper, with and without priors; what does not belong together is told."""

import os
import time

import numpy as np
import pycolmap
import pytest
from relief import FOCAL

from wakewise.core.errors import EnvironmentFailure, InputError, StageError
from wakewise.core.interfaces import no_progress
from wakewise.vision.reconstruction import Lens, ReconstructionSettings, read_photos, reconstruct
from wakewise.vision.reconstruction.dense.dense_points import require_cuda
from wakewise.vision.reconstruction.sfm import colmap
from wakewise.vision.reconstruction.sfm.features import match_photos
from wakewise.vision.reconstruction.sfm.mapping import map_photos
from wakewise.vision.reconstruction.sfm.pairs import choose_pairs

SETTINGS = ReconstructionSettings(detector="opencv", max_features=1500, first_octave=0)


@pytest.fixture(scope="module")
def matched(relief_photos, tmp_path_factory):
    folder, truth = relief_photos
    database = tmp_path_factory.mktemp("matched") / "database.db"
    photos = read_photos(folder)
    pairs = choose_pairs([photo.name for photo in photos], SETTINGS)
    figures = match_photos(folder, photos, database, SETTINGS, focal_px=FOCAL, pairs=pairs, progress=no_progress)
    assert figures["features_per_image"] <= 1500 and figures["verified_pairs"] >= 10
    return folder, database, {name: X.p_m for name, X in truth.items()}


def mapped(matched, out, references="true", **changes):
    folder, database, centres = matched
    settings = SETTINGS.model_copy(update=changes)
    out.mkdir(exist_ok=True)
    given = centres if isinstance(references, str) else references
    return map_photos(folder, database, out / "sparse", settings, photos=6, references=given, progress=no_progress)


@pytest.mark.parametrize(
    "changes",
    [{}, {"mapper": "global"}, {"position_priors": True, "prior_sigma_m": 0.001}],
    ids=["plain", "global", "priors"],
)
def test_every_way_puts_the_cameras_where_they_were(matched, tmp_path, changes, capfd):
    """Six cameras, within 2 mm of the truth, reprojection below half a pixel, and not a word on standard error."""
    figures = mapped(matched, tmp_path, **changes)
    assert figures["registered_images"] == 6
    assert figures["cameras_rmse_mm"] < 2.0
    assert figures["reprojection_px"] < 0.5 and figures["reprojection_met"], figures["warnings"]
    assert figures["suspicion"] is None and 0.3 < figures["surface_distance_m"] < 0.5
    assert capfd.readouterr().err == ""


def test_a_closer_limit_cuts_what_sticks_out(matched, tmp_path):
    """Asked for less than COLMAP leaves, observations are cut until it is met, or it is said that it is not."""
    plain = mapped(matched, tmp_path / "a")
    close = mapped(matched, tmp_path / "b", reprojection_px=0.8 * plain["reprojection_px"])
    assert close["reprojection_px"] < plain["reprojection_px"]
    assert close["registered_images"] == 6
    assert not mapped(matched, tmp_path / "c", reprojection_px=1e-3)["reprojection_met"]


def test_references_of_another_flight_are_a_failure(matched, tmp_path):
    """Positions that have nothing to do with the photos fit badly, and no model is given out in their frame."""
    rng = np.random.default_rng(0)
    foreign = {f"{k:02d}.png": rng.normal(size=3) for k in range(6)}
    with pytest.raises(StageError, match="do not belong together"):
        mapped(matched, tmp_path, foreign)
    assert not (tmp_path / "sparse").exists()


def test_positions_in_millimetres_are_suspicious(matched, tmp_path):
    """The surface 0.4 m away would be 400 m or more away in a unit that is a thousandth: in micrometres it is told."""
    centres = matched[2]
    found = mapped(matched, tmp_path, {name: 1e4 * p for name, p in centres.items()})
    assert "are the positions in metres?" in found["suspicion"]


def test_what_cannot_be_had_here_is_told(relief_photos, tmp_path):
    """Patch-match without CUDA and priors without positions are bad input, before anything runs."""
    import pycolmap

    folder, _ = relief_photos
    if pycolmap.has_cuda:
        require_cuda()
    else:
        with pytest.raises(InputError, match="CUDA"):
            reconstruct(folder, tmp_path / "a", SETTINGS.model_copy(update={"dense": "patch-match"}))
        assert not (tmp_path / "a").exists()
    with pytest.raises(InputError, match="need known camera positions"):
        reconstruct(folder, tmp_path / "b", SETTINGS.model_copy(update={"position_priors": True}))
    assert not (tmp_path / "b").exists()


def test_two_photos_are_enough(relief_photos, tmp_path):
    """Two neighbours give two cameras and dense points, which the two directions of the one pair confirm."""
    import shutil

    folder, _ = relief_photos
    (tmp_path / "two").mkdir()
    for name in ("02.png", "03.png"):
        shutil.copy(folder / name, tmp_path / "two" / name)
    settings = SETTINGS.model_copy(update={"mesh": False})
    model = reconstruct(tmp_path / "two", tmp_path / "out", settings, focal_px=FOCAL)
    assert model.registered_images == 2
    assert model.dense_points > 1000


@pytest.mark.parametrize("detector", ["opencv", "colmap"])
def test_photos_of_one_size_share_a_camera_and_others_have_their_own(relief_photos, tmp_path, detector):
    """Four photos as they are and two made smaller are two cameras; one focal length cannot hold for both."""
    import cv2

    folder, _ = relief_photos
    (tmp_path / "mixed").mkdir()
    for k in range(6):
        image = cv2.imread(str(folder / f"{k:02d}.png"))
        small = cv2.resize(image, (240, 180), interpolation=cv2.INTER_AREA) if k % 3 == 1 else image
        cv2.imwrite(str(tmp_path / "mixed" / f"{k:02d}.png"), small)
    settings = SETTINGS.model_copy(update={"detector": detector, "max_features": 600})
    photos = read_photos(tmp_path / "mixed")
    pairs = [("00.png", "01.png"), ("02.png", "03.png")]
    out = tmp_path / "database.db"
    match_photos(tmp_path / "mixed", photos, out, settings, focal_px=None, pairs=pairs, progress=no_progress)
    link = pycolmap.Database.open(out)
    sizes = {image.name: link.read_camera(image.camera_id).width for image in link.read_all_images()}
    count = link.num_cameras()
    link.close()
    assert count == 2
    assert sizes == {f"{k:02d}.png": 240 if k % 3 == 1 else 320 for k in range(6)}
    with pytest.raises(InputError, match="different sizes"):
        match_photos(tmp_path / "mixed", photos, out, settings, focal_px=300.0, pairs=pairs, progress=no_progress)


def test_names_may_have_spaces_and_numbers(relief_photos, tmp_path):
    """Photos whose names COLMAP's list of pairs could not hold are matched, and keep their names."""
    folder, _ = relief_photos
    names = ["a photo (1).png", "2.png", "1.png"]
    (tmp_path / "photos").mkdir()
    for k, name in enumerate(names):
        (tmp_path / "photos" / name).write_bytes((folder / f"{k:02d}.png").read_bytes())
    photos, out = read_photos(tmp_path / "photos"), tmp_path / "database.db"
    pairs = [(names[0], names[1]), (names[1], names[2])]
    found = match_photos(tmp_path / "photos", photos, out, SETTINGS, focal_px=FOCAL, pairs=pairs, progress=no_progress)
    assert found["verified_pairs"] == 2
    link = pycolmap.Database.open(out)
    assert sorted(image.name for image in link.read_all_images()) == sorted(names)
    link.close()


def test_a_disk_that_fills_ends_the_call_before_colmap_ends_the_process(tmp_path, monkeypatch):
    """With less room than the reserve a call is cancelled and says why; the room it worked in is gone."""
    monkeypatch.setattr(colmap, "RESERVE_MB", 1e15)
    cancelled = []

    def work(cancellation_token):
        while not cancellation_token.is_cancelled:
            time.sleep(0.01)
        cancelled.append(True)

    with pytest.raises(EnvironmentFailure, match=r"matching: the disk of .* is full"):
        colmap.call(work, "matching", disk=tmp_path)
    assert cancelled == [True]
    with colmap.database_folder(tmp_path / "database.db", 1e3) as room:
        assert room.parent == tmp_path  # memory has no such reserve either
    assert not room.exists()


def test_a_killed_processs_room_in_memory_is_swept(tmp_path, monkeypatch):
    """A database goes to memory when it is small; what a process that is gone left there is removed, no other's."""
    monkeypatch.setattr(colmap, "MEMORY", tmp_path / "memory")
    mine, dead = tmp_path / "memory" / f".wakewise-{os.getpid()}-a", tmp_path / "memory" / ".wakewise-999999999-b"
    mine.mkdir(parents=True)
    dead.mkdir()
    with colmap.database_folder(tmp_path / "database.db", 1e3) as room:
        assert room.parent == tmp_path / "memory" and mine.exists() and not dead.exists()
    dead = tmp_path / ".wakewise-999999999-c"
    dead.mkdir()
    with colmap.database_folder(tmp_path / "database.db", 1e12) as room:
        assert room.parent == tmp_path and not dead.exists()


def test_a_given_camera_is_used_and_must_fit(relief_photos, tmp_path):
    """A camera of another size is refused; one that is kept comes out as it went in."""
    folder, truth = relief_photos
    params = [FOCAL, FOCAL, 160.0, 120.0, 1e-9, 0.0, 0.0, 0.0]
    centres = {name: X.p_m for name, X in truth.items()}
    wrong = Lens(width=100, height=120, params=np.array(params))
    with pytest.raises(InputError, match="100 x 120 px"):
        reconstruct(folder, tmp_path, SETTINGS, lens=wrong)
    lens = Lens(width=320, height=240, params=np.array(params))
    with pytest.raises(InputError, match="not both"):
        reconstruct(folder, tmp_path, SETTINGS, lens=lens, focal_px=FOCAL)
    kept = SETTINGS.model_copy(
        update={"detector": "colmap", "refine_camera": False, "mesh": False, "agreeing_views": 1}
    )
    model = reconstruct(folder, tmp_path, kept, lens=lens, reference_positions=centres)
    assert model.registered_images == 6 and model.focal_px == FOCAL and model.cameras_rmse_mm < 2.0
    camera = next(iter(pycolmap.Reconstruction(tmp_path / "sparse").cameras.values()))
    assert camera.model.name == "OPENCV" and camera.params.tolist() == params
