"""SIFT features and verified matches: photos in, COLMAP's database.db out.

D. G. Lowe, Distinctive image features from scale-invariant keypoints, IJCV 60(2), 2004, doi
10.1023/B:VISI.0000029664.99615.94; descriptors are square roots of L1-normalised entries (R. Arandjelovic and A.
Zisserman, CVPR 2012, doi 10.1109/CVPR.2012.6248018), times 512 in a byte, as COLMAP stores them.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import BoolArray
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import whole_file
from wakewise.core.interfaces import Progress
from wakewise.core.run_lock import temporary_prefix
from wakewise.core.threads import in_order
from wakewise.vision.image_decoding import grey_of, one_opencv_thread
from wakewise.vision.reconstruction.photos.lens_groups import LensGroup, group_photos
from wakewise.vision.reconstruction.photos.masks import write_for_colmap
from wakewise.vision.reconstruction.photos.photo_folder import Image, Photo, PhotoStore
from wakewise.vision.reconstruction.settings import RANDOM_SEED, ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import (
    call,
    checkpoint_database,
    database_folder,
    open_database,
    pycolmap,
)
from wakewise.vision.reconstruction.sfm.guided_matching import Poses, match_by_poses
from wakewise.vision.reconstruction.sfm.pairs import Pairs, read_descriptors, retrieve_pairs

# OpenCV always doubles a photo first; the doubled one is kept to what COLMAP takes at most (its max_image_size).
PEAK_THRESHOLD = 0.02
"""Smallest SIFT contrast, grey levels 0 to 1, over all 3 scales of an octave."""
MAX_DOUBLED_PX = 3200
# Photos whose grey levels (1st to 99th percentile) span less are stretched to twice that, at most 8 times: the contrast
# threshold would drop everything in the dark or in haze.
LEAST_SPAN, MOST_GAIN = 64.0, 8.0


class Features(NamedTuple):
    """keypoints (n, 4) float32: x, y (pixel centres at +0.5), scale in px, angle in rad; descriptors (n, 128) uint8."""

    keypoints: NDArray[np.float32]
    descriptors: NDArray[np.uint8]


def photo_features(image: Image, settings: ReconstructionSettings) -> Features:
    """The strongest features of a photo, blue-first colours of shape (h, w, 3), in pixels of the photo."""
    grey = stretched(grey_of(image))
    height, width = grey.shape
    wanted = 1.0 if settings.first_octave == -1 else 0.5
    shrink = min(wanted, MAX_DOUBLED_PX / (2.0 * max(height, width)))
    small = grey
    if shrink < 1.0:
        size = (max(1, round(width * shrink)), max(1, round(height * shrink)))
        small = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    # Without the precise upscale keypoints are a quarter of a pixel to the right and below.
    detector = cv2.SIFT.create(
        nfeatures=settings.max_features, contrastThreshold=PEAK_THRESHOLD, enable_precise_upscale=True
    )
    points, raw = detector.detectAndCompute(small, None)
    if not points:
        return Features(np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8))
    scale = np.array([width / small.shape[1], height / small.shape[0]])
    place = (np.array([point.pt for point in points]) + 0.5) * scale
    # OpenCV's size is the diameter of what is described, twice the scale.
    more = np.array([(0.5 * point.size * scale[0], np.radians(point.angle)) for point in points])
    # OpenCV may keep a few more than asked for, those with several directions.
    keep = np.argsort([-point.response for point in points], kind="stable")[: settings.max_features]
    root = np.sqrt(raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-12))
    return Features(
        np.concatenate([place, more], axis=1).astype(np.float32)[keep],
        np.clip(np.rint(512.0 * root), 0, 255).astype(np.uint8)[keep],
    )


def within(features: Features, mask: BoolArray | None) -> Features:
    """Features less those whose pixel a mask, shape (h, w), hides."""
    if mask is None:
        return features
    column, row = np.floor(features.keypoints[:, :2]).astype(np.int64).T
    kept = mask[np.clip(row, 0, mask.shape[0] - 1), np.clip(column, 0, mask.shape[1] - 1)]
    return Features(features.keypoints[kept], features.descriptors[kept])


def stretched(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A photo of little contrast with more of it; any other as it is."""
    low, high = (float(v) for v in np.percentile(grey[::4, ::4], (1.0, 99.0)))
    span = high - low
    if span >= LEAST_SPAN:
        return grey
    gain = min(2.0 * LEAST_SPAN / max(span, 1.0), MOST_GAIN)
    return np.clip(np.rint((grey.astype(np.float32) - low) * gain + 32.0), 0, 255).astype(np.uint8)


def folder_features(store: PhotoStore, names: list[str], settings: ReconstructionSettings) -> Iterator[Features]:
    """Features of each photo, in order, several photos at a time."""

    def one(name: str) -> Features:
        return photo_features(store.image(name), settings)

    with one_opencv_thread():
        yield from in_order(one, names, settings.threads)


T = TypeVar("T")
FEW_FEATURES = 150
FISHEYE_FOCAL = 0.4
"""Where a fisheye's focal length is unknown: this much of the longer side, which is 180 deg across a 4:3 diagonal."""
BYTES_PER_PX, BYTES_DECODED, ROOM_BYTES = 72.0, 4.0, 6e9
"""What the scales of a photo take for each pixel that is looked at (71 measured), what the photo itself takes for each
of its pixels, and the room of all threads."""
EXTRACTION_BATCHES, MATCHING_BATCHES, LEAST_PAIRS = 12, 8, 120
"""Parts that the work is done in, for progress; descriptors are indexed anew in each, so few pairs are few parts."""


def match_photos(
    folder: Path,
    photos: tuple[Photo, ...],
    database: Path,
    settings: ReconstructionSettings,
    *,
    focal_px: float | None,
    pairs: Pairs,
    progress: Progress,
    store: PhotoStore | None = None,
    poses: Poses | None = None,
    groups: tuple[LensGroup, ...] | None = None,
    may_be_none: bool = False,
    retrieved: int = 0,
) -> dict[str, Any]:
    """Find SIFT features, match and verify; write COLMAP's database whole.

    `focal_px`: focal length to start from, in pixels of these photos; else from EXIF or 1.2 times the longer side, of a
    fisheye 0.4 times. `pairs`: what to match. `store`: photos that are decoded already. `groups`: which photos share a
    lens; found from the photos if not given.
    `poses`: rough R_WC, shape (3, 3), and p_WC_m, shape (3,), by photo name: pairs are matched along epipolar lines
    first, and only those that do not verify among all features. `may_be_none`: whether it is no failure that nothing
    matches, as where the cameras are known. `retrieved`: with how many others each is matched besides, because they
    look alike. Returns features_per_image, inlier_matches (verified, all pairs together), verified_pairs, pairs,
    posed_pairs (those verified along epipolar lines). Raises InputError if a pair names a photo that is not there;
    StageError if no pair of photos could be verified.
    """
    names = [photo.name for photo in photos]
    known = set(names)
    unknown = next((name for pair in pairs for name in pair if name not in known), None)
    if unknown is not None:
        raise InputError(f"pairs: {unknown} is not among the photos ({names[0]} ... {names[-1]})")
    pycolmap.set_random_seed(RANDOM_SEED)
    size = database_bytes(len(photos), len(pairs) + retrieved * len(photos), settings)
    with whole_file(database) as whole, database_folder(database, size) as room:
        work = room / "database.db"
        work.touch()
        lenses = group_photos(photos) if groups is None else groups
        store = store or PhotoStore(folder)
        _extract(store, lenses, work, settings, focal_px, progress, room)
        with open_database(work) as link:
            read = {image.name for image in link.read_all_images()}
        unread = next((name for name in names if name not in read), None)
        if unread is not None:
            raise StageError(f"features: COLMAP cannot read {folder / unread}; save it anew as PNG or remove it")
        if retrieved:
            pairs = sorted({*pairs, *retrieve_pairs(read_descriptors(work), retrieved)})
        left = pairs if poses is None else match_by_poses(work, pairs, poses, settings.threads, progress)
        match_pairs(work, settings, left, progress)
        figures = _figures(work, len(photos)) | {"pairs": len(pairs), "posed_pairs": len(pairs) - len(left)}
        checkpoint_database(work)
        shutil.copyfile(work, whole)
        if figures["inlier_matches"] == 0 and not may_be_none:
            count = figures["features_per_image"]
            hint = ""
            if count < FEW_FEATURES:
                hint = "; so few come from dark, blurred or hazy photos"
                if settings.detector == "colmap":
                    hint += ", which detector=opencv brightens"
            raise StageError(
                f"matching: no two of the {len(photos)} photos show the same thing "
                f"({count:.0f} features a photo, 0 verified matches{hint})"
            )
    return figures


def database_bytes(photos: int, pairs: int, settings: ReconstructionSettings) -> float:
    """Room for the database: 128 bytes of descriptor, up to 24 of keypoint, a few matches, twice; and a log."""
    return 2.0 * settings.max_features * (152 * photos + 2 * pairs)


def _extract(
    store: PhotoStore,
    groups: tuple[LensGroup, ...],
    database: Path,
    settings: ReconstructionSettings,
    focal_px: float | None,
    progress: Progress,
    room: Path,
) -> None:
    """Features of all photos; those of one group share a camera. Masks are laid out in `room` for COLMAP."""
    if focal_px is not None and len({frozenset((g.width, g.height)) for g in groups}) > 1:
        raise InputError("photos: have different sizes, one focal length cannot hold for all: give --camera and --lens")
    done, total = 0, sum(len(group.photos) for group in groups)

    def report(more: int) -> None:
        progress(done + more, total, "features")

    for group in groups:
        reader = pycolmap.ImageReaderOptions()
        fisheye = settings.lens == "fisheye"
        reader.camera_model = "RADIAL_FISHEYE" if fisheye else "SIMPLE_RADIAL"
        if store.masks is not None:
            write_for_colmap(store.masks, list(group.photos), room / "masks")
            reader.mask_path = room / "masks"
        focal = FISHEYE_FOCAL * max(group.width, group.height) if fisheye and focal_px is None else focal_px
        if focal is not None:
            reader.camera_params = f"{focal},{group.width / 2},{group.height / 2},{'0,0' if fisheye else '0'}"
        if group.lens is not None:
            reader.camera_model, reader.camera_params = group.lens.for_colmap()
        work = _by_opencv if settings.detector == "opencv" else _by_colmap
        here = settings.model_copy(update={"threads": threads_for(settings, group.width, group.height)})
        work(store, list(group.photos), database, here, reader, report)
        done += len(group.photos)
    progress(done, total, "features")


def threads_for(settings: ReconstructionSettings, width: int, height: int) -> int:
    """Threads of feature extraction for photos of this size, within `ROOM_BYTES` of memory."""
    doubled = 4 if settings.first_octave == -1 else 1
    shrink = min(1.0, MAX_DOUBLED_PX / max(width, height))  # COLMAP looks at no larger ones either
    each = (BYTES_PER_PX * doubled * shrink**2 + BYTES_DECODED) * width * height
    return max(1, min(settings.threads, int(ROOM_BYTES / each)))


def _by_opencv(
    store: PhotoStore,
    names: list[str],
    database: Path,
    settings: ReconstructionSettings,
    reader: pycolmap.ImageReaderOptions,
    report: Callable[[int], None],
) -> None:
    """List the photos in COLMAP's database and write OpenCV's features beside them."""
    call(
        lambda **_: pycolmap.import_images(
            database, store.folder, camera_mode=pycolmap.CameraMode.SINGLE, image_names=names, options=reader
        ),
        "features",
    )
    # Before the database is opened: two SQLite libraries must not use it together, and an interrupt leaves it whole.
    found = []
    for k, features in enumerate(folder_features(store, names, settings)):
        report(k)
        found.append(features if store.masks is None else within(features, store.masks.of(names[k])))
    with open_database(database) as link:
        for name, features in zip(names, found, strict=True):
            image_id = link.read_image_with_name(name).image_id
            link.write_keypoints(image_id, features.keypoints)
            kind = pycolmap.FeatureExtractorType.SIFT
            link.write_descriptors(image_id, pycolmap.FeatureDescriptors(kind, features.descriptors))


def _by_colmap(
    store: PhotoStore,
    names: list[str],
    database: Path,
    settings: ReconstructionSettings,
    reader: pycolmap.ImageReaderOptions,
    report: Callable[[int], None],
) -> None:
    """COLMAP's own features."""
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = settings.threads
    options.use_gpu = False
    options.sift.max_num_features = settings.max_features
    options.sift.first_octave = settings.first_octave
    # COLMAP counts the contrast per scale of an octave, and has three.
    options.sift.peak_threshold = PEAK_THRESHOLD / options.sift.octave_resolution
    done = 0
    for batch in _batches(names, EXTRACTION_BATCHES):
        report(done)
        call(
            partial(
                pycolmap.extract_features,
                database,
                store.folder,
                image_names=batch,
                camera_mode=pycolmap.CameraMode.SINGLE,
                reader_options=reader,
                extraction_options=options,
                device=pycolmap.Device.cpu,
            ),
            "features",
            disk=database.parent,
        )
        done += len(batch)
        if reader.existing_camera_id < 0 or done == len(batch):
            with open_database(database) as link:
                read = [image.camera_id for image in link.read_all_images() if image.name in batch]
            if read:
                reader.existing_camera_id = read[0]


def match_pairs(
    database: Path,
    settings: ReconstructionSettings,
    pairs: Pairs,
    progress: Progress,
) -> None:
    """Match pairs of photos, by name, among all their features, and write what verifies into COLMAP's database."""
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads = settings.threads
    options.use_gpu = False
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = RANDOM_SEED
    pairing = pycolmap.ImportedPairingOptions()
    # COLMAP's list of pairs is split at spaces, which names may have: numbers stand for them meanwhile.
    ids = _renamed(database, lambda image: str(image.image_id))
    done = 0
    for batch in _batches(pairs, min(MATCHING_BATCHES, -(-len(pairs) // LEAST_PAIRS))):
        progress(done, len(pairs), "matches")
        with tempfile.TemporaryDirectory(prefix=temporary_prefix("pairs"), dir=database.parent) as scratch:
            listing = Path(scratch) / "pairs.txt"
            listing.write_text("".join(f"{ids[a]} {ids[b]}\n" for a, b in batch), encoding="utf-8")
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
                disk=database.parent,
            )
        done += len(batch)
    names = {number: name for name, number in ids.items()}
    _renamed(database, lambda image: names[image.name])
    progress(done, len(pairs), "matches")


def _renamed(database: Path, name: Callable[[pycolmap.Image], str]) -> dict[str, str]:
    """Give every photo of the database another name; the new ones by the old ones."""
    out = {}
    with open_database(database) as link:
        for image in link.read_all_images():
            out[image.name] = name(image)
            image.name = out[image.name]
            link.update_image(image)
    return out


def _batches(items: list[T], count: int) -> list[list[T]]:
    """Split into at most `count` runs of nearly equal length.

    COLMAP reports no progress, and its database must not be read meanwhile: Python has an SQLite of its own, and two in
    one process undo each other's locks (sqlite.org, How To Corrupt An SQLite Database File, section 2.2.1).
    """
    size = max(1, -(-len(items) // max(count, 1)))
    return [items[k : k + size] for k in range(0, len(items), size)]


def _figures(database: Path, photos: int) -> dict[str, Any]:
    with open_database(database) as link:
        return {
            "features_per_image": link.num_keypoints() / photos,
            "inlier_matches": int(link.num_inlier_matches()),
            "verified_pairs": int(np.count_nonzero(link.read_two_view_geometry_num_inliers()[1])),
        }
