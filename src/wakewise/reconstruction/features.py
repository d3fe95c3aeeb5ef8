"""Features of each photo and verified matches between photos: photos in, database.db out."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pycolmap

from wakewise.errors import InputError, StageError
from wakewise.files import whole_file
from wakewise.interfaces import Progress
from wakewise.reconstruction.colmap import call, remove_logs, settle
from wakewise.reconstruction.pairs import Pairs
from wakewise.reconstruction.photos import Photo
from wakewise.reconstruction.settings import ReconstructionSettings
from wakewise.reconstruction.sift import folder_features

T = TypeVar("T")
FEW_FEATURES = 150
EXTRACTION_BATCHES, MATCHING_BATCHES = 12, 8
"""Parts that the work is done in, for progress; each costs a little, as descriptors are indexed anew."""


def match_photos(
    folder: Path,
    photos: tuple[Photo, ...],
    database: Path,
    settings: ReconstructionSettings,
    *,
    focal_px: float | None,
    pairs: Pairs,
    progress: Progress,
) -> dict[str, Any]:
    """Find SIFT features, match and verify; write COLMAP's database whole.

    Parameters
    ----------
    focal_px : float, optional
        Focal length to start from, in pixels of these photos; else from EXIF or 1.2 times the longer side.
    pairs : list of two photo names
        What to match.

    Returns
    -------
    dict
        features_per_image, inlier_matches (verified, all pairs together), verified_pairs.

    Raises
    ------
    InputError
        If a pair names a photo that is not there.
    StageError
        If no pair of photos could be verified.
    """
    names = [photo.name for photo in photos]
    _check_pairs(names, pairs)
    pycolmap.set_random_seed(settings.random_seed)
    with whole_file(database) as temporary:
        try:
            _extract(folder, photos, temporary, settings, focal_px, progress)
            _match(temporary, settings, pairs, progress)
            figures = _figures(temporary, len(photos))
            settle(temporary)
        finally:
            remove_logs(temporary)
        if figures["inlier_matches"] == 0:
            count = figures["features_per_image"]
            hint = "; so few come from dark, blurred or hazy photos" if count < FEW_FEATURES else ""
            raise StageError(
                f"matching: no two of the {len(photos)} photos show the same thing "
                f"({count:.0f} features a photo, 0 verified matches{hint})"
            )
    return figures


def _check_pairs(names: list[str], pairs: Pairs) -> None:
    known = set(names)
    for pair in pairs:
        for name in pair:
            if name not in known:
                raise InputError(f"pairs: {name} is not among the photos ({names[0]} ... {names[-1]})")


def _extract(
    folder: Path,
    photos: tuple[Photo, ...],
    database: Path,
    settings: ReconstructionSettings,
    focal_px: float | None,
    progress: Progress,
) -> None:
    """Features of all photos; those of one size share a camera, as one that was turned has another size."""
    groups: dict[tuple[int, int], list[str]] = {}
    for photo in photos:
        groups.setdefault((photo.width, photo.height), []).append(photo.name)
    if focal_px is not None and len(groups) > 1:
        raise InputError("photos: have different sizes, so one focal length in pixels cannot hold for all of them")
    done = 0
    for (width, height), names in groups.items():
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = "SIMPLE_RADIAL"
        if focal_px is not None:
            reader.camera_params = f"{focal_px},{width / 2},{height / 2},0"
        work = _by_opencv if settings.detector == "opencv" else _by_colmap
        work(folder, names, database, settings, reader, partial(_tell, progress, done, len(photos)))
        done += len(names)
    progress(done, len(photos), "features")


def _tell(progress: Progress, before: int, total: int, done: int) -> None:
    progress(before + done, total, "features")


def _by_opencv(
    folder: Path,
    names: list[str],
    database: Path,
    settings: ReconstructionSettings,
    reader: pycolmap.ImageReaderOptions,
    tell: Callable[[int], None],
) -> None:
    """List the photos in COLMAP's database and write OpenCV's features beside them."""
    call(
        lambda **_: pycolmap.import_images(
            database, folder, camera_mode=pycolmap.CameraMode.SINGLE, image_names=names, options=reader
        ),
        "features",
    )
    # Found before the database is opened: two SQLite libraries must not meet in it, and an interrupt leaves it whole.
    found = []
    for k, features in enumerate(folder_features(folder, names, settings)):
        tell(k)
        found.append(features)
    link = pycolmap.Database.open(database)
    try:
        for name, features in zip(names, found, strict=True):
            image_id = link.read_image_with_name(name).image_id
            link.write_keypoints(image_id, features.keypoints)
            kind = pycolmap.FeatureExtractorType.SIFT
            link.write_descriptors(image_id, pycolmap.FeatureDescriptors(kind, features.descriptors))
    finally:
        link.close()


def _by_colmap(
    folder: Path,
    names: list[str],
    database: Path,
    settings: ReconstructionSettings,
    reader: pycolmap.ImageReaderOptions,
    tell: Callable[[int], None],
) -> None:
    """COLMAP's own features."""
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = settings.threads
    options.use_gpu = False
    options.sift.max_num_features = settings.max_features
    options.sift.first_octave = settings.first_octave
    # COLMAP counts the contrast per scale of an octave, and has three.
    options.sift.peak_threshold = settings.peak_threshold / options.sift.octave_resolution
    done = 0
    for batch in _batches(names, EXTRACTION_BATCHES):
        tell(done)
        call(
            partial(
                pycolmap.extract_features,
                database,
                folder,
                image_names=batch,
                camera_mode=pycolmap.CameraMode.SINGLE,
                reader_options=reader,
                extraction_options=options,
                device=pycolmap.Device.cpu,
            ),
            "features",
        )
        done += len(batch)
        if reader.existing_camera_id < 0 or done == len(batch):
            link = pycolmap.Database.open(database)
            reader.existing_camera_id = link.read_image_with_name(batch[0]).camera_id
            link.close()


def _match(
    database: Path,
    settings: ReconstructionSettings,
    pairs: Pairs,
    progress: Progress,
) -> None:
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads = settings.threads
    options.use_gpu = False
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = settings.random_seed
    pairing = pycolmap.ImportedPairingOptions()
    done = 0
    for batch in _batches(pairs, MATCHING_BATCHES):
        progress(done, len(pairs), "matches")
        with tempfile.TemporaryDirectory(prefix=".pairs.", dir=database.parent) as scratch:
            listing = Path(scratch) / "pairs.txt"
            listing.write_text("".join(f"{a} {b}\n" for a, b in batch), encoding="utf-8")
            pairing.match_list_path = str(listing)
            call(
                partial(
                    pycolmap.match_image_pairs,
                    database,
                    matching_options=options,
                    pairing_options=pairing,
                    verification_options=verification,
                    device=pycolmap.Device.cpu,
                ),
                "matching",
            )
        done += len(batch)
    progress(done, len(pairs), "matches")


def _batches(items: list[T], count: int) -> list[list[T]]:
    """Split into at most `count` runs of nearly equal length.

    COLMAP tells nothing on its way, and its database must not be looked at meanwhile: Python has an SQLite of its own,
    and two in one process undo each other's locks (sqlite.org, How To Corrupt An SQLite Database File, section 2.2.1).
    """
    size = max(1, -(-len(items) // count))
    return [items[k : k + size] for k in range(0, len(items), size)]


def _figures(database: Path, photos: int) -> dict[str, Any]:
    link = pycolmap.Database.open(database)
    try:
        return {
            "features_per_image": link.num_keypoints() / photos,
            "inlier_matches": int(link.num_inlier_matches()),
            "verified_pairs": int(np.count_nonzero(link.read_two_view_geometry_num_inliers()[1])),
        }
    finally:
        link.close()
