"""Features of each photo and verified matches between photos: photos in, database.db out."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pycolmap

from wakewise.errors import InputError, StageError
from wakewise.files import whole_file
from wakewise.interfaces import Progress
from wakewise.reconstruction.colmap import call, remove_logs, settle
from wakewise.reconstruction.photos import Photo
from wakewise.reconstruction.settings import ReconstructionSettings

T = TypeVar("T")
EXTRACTION_BATCHES, MATCHING_BATCHES = 12, 8
"""Parts that the work is done in, for progress; each costs a little, as descriptors are indexed anew."""


def match_photos(
    folder: Path,
    photos: tuple[Photo, ...],
    database: Path,
    settings: ReconstructionSettings,
    *,
    focal_px: float | None,
    pairs: list[tuple[str, str]] | None,
    progress: Progress,
) -> dict[str, Any]:
    """Find SIFT features, match and verify; write COLMAP's database whole.

    Parameters
    ----------
    focal_px : float, optional
        Focal length to start from, in pixels of these photos; else from EXIF or 1.2 times the longer side.
    pairs : list of two photo names, optional
        What to match; else all pairs, or neighbours in order of name when there are many photos.

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
            _match(names, temporary, settings, pairs, progress)
            figures = _figures(temporary, len(photos))
            settle(temporary)
        finally:
            remove_logs(temporary)
        if figures["inlier_matches"] == 0:
            raise StageError(
                f"matching: no two of the {len(photos)} photos show the same thing "
                f"({figures['features_per_image']:.0f} features a photo, 0 verified matches)"
            )
    return figures


def _check_pairs(names: list[str], pairs: list[tuple[str, str]] | None) -> None:
    known = set(names)
    for pair in pairs or ():
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
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = "SIMPLE_RADIAL"
    sizes = {(photo.width, photo.height) for photo in photos}
    one_camera = len(sizes) == 1
    if focal_px is not None:
        if not one_camera:
            raise InputError("photos: have different sizes, so one focal length in pixels cannot hold for all of them")
        width, height = sizes.pop()
        reader.camera_params = f"{focal_px},{width / 2},{height / 2},0"
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = settings.threads
    options.use_gpu = False
    options.sift.max_num_features = settings.max_features
    options.sift.first_octave = settings.first_octave
    options.sift.peak_threshold = settings.peak_threshold
    done = 0
    for batch in _batches([photo.name for photo in photos], EXTRACTION_BATCHES):
        progress(done, len(photos), "features")
        call(
            partial(
                pycolmap.extract_features,
                database,
                folder,
                image_names=batch,
                camera_mode=pycolmap.CameraMode.SINGLE if one_camera else pycolmap.CameraMode.PER_IMAGE,
                reader_options=reader,
                extraction_options=options,
                device=pycolmap.Device.cpu,
            ),
            "features",
        )
        done += len(batch)
        if one_camera:
            reader.existing_camera_id = 1
    progress(done, len(photos), "features")


def _match(
    names: list[str],
    database: Path,
    settings: ReconstructionSettings,
    pairs: list[tuple[str, str]] | None,
    progress: Progress,
) -> None:
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads = settings.threads
    options.use_gpu = False
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = settings.random_seed
    if pairs is None:
        pairs = default_pairs(names, settings)
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


def default_pairs(names: list[str], settings: ReconstructionSettings) -> list[tuple[str, str]]:
    """Every pair of a small set; of a large one each photo with the next few in order of name, and ever wider ones.

    The steps that double (1, 2, 4, ...) beyond the overlap tie later laps of an orbit to earlier ones.
    """
    n = len(names)
    if n <= settings.exhaustive_up_to:
        steps = list(range(1, n))
    else:
        powers = [2**k for k in range(n.bit_length()) if settings.sequence_overlap < 2**k < n]
        steps = [*range(1, settings.sequence_overlap + 1), *powers]
    return [(names[i], names[i + step]) for step in steps for i in range(n - step)]


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
