"""Preview of photographs before a reconstruction: sharpness, exposure, overlap, and what to photograph again.

Small copies are matched fast (SIFT, fundamental matrix by RANSAC).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.core.threads import in_order
from wakewise.vision.image_decoding import grey_of, one_opencv_thread, shrunk
from wakewise.vision.reconstruction.photos.photo_folder import Image, PhotoStore, read_photos, unsupported_files
from wakewise.vision.reconstruction.photos.video_frames import sharpness_of
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.features import Features, photo_features

ANALYSED_PX, MATCHED_PX, FEATURES = 1600, 640, 700
"""Longest side for sharpness and exposure, for matching, and features matched of each photo."""
MOST_PAIRS, ORDER_NEIGHBOURS = 1600, 4
"""Most pairs that are matched: all pairs up to this number, else neighbours in order and similar photographs."""
LEAST_MATCHES, LEAST_PARTNERS = 16, 2
"""Least matches of partners that fit one geometry, and least partners of a photo."""
BLURRED_SHARE, DARK, BRIGHT = 0.4, 8, 250
MOST_DARK_PCT, MOST_BRIGHT_PCT, LEAST_COVERED_PCT = 40.0, 8.0, 25.0
CELLS = (8, 6)
"""The picture's parts, across and down, that coverage is counted in."""
THUMBS_PX = ((60, 640), (200, 400), (10**9, 240))
"""Longest side of small copies for up to so many photographs, so that a page holds them all."""
_LEAST_SIDE_PX = 4
"""Least side of the copy that is matched."""
_RATIO, _GEOMETRY_PX = 0.8, 2.0


@dataclass(frozen=True, kw_only=True)
class PhotoQuality:
    """One photo. sharpness_pct: of the median of all; mean: grey 0 to 255; dark_pct, bright_pct: of its pixels;
    partners: photos that overlap it, best first, and their matches; covered_pct: share of its parts that two or more
    partners show too; faults: words, empty where nothing is wrong.
    """

    name: str
    width: int
    height: int
    sharpness_pct: float
    mean: float
    dark_pct: float
    bright_pct: float
    features: int
    partners: tuple[tuple[str, int], ...]
    covered_pct: float
    group: int
    faults: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class PhotoPreview:
    """All photos, in order; groups: sizes of the connected sets, largest first; advice: what to photograph again."""

    photos: tuple[PhotoQuality, ...]
    groups: tuple[int, ...]
    pairs: int
    advice: tuple[str, ...]
    passed_over: dict[str, int]

    def summary(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**asdict(self), "groups": list(self.groups)}


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """What was measured of one photo by itself."""

    sharpness: float
    mean: float
    dark_pct: float
    bright_pct: float
    features: Features
    tiny: Array
    thumb: bytes
    size: tuple[int, int]


def preview_photos(
    folder: Path, threads: int = 2, progress: Progress = no_progress
) -> tuple[PhotoPreview, dict[str, bytes]]:
    """Preview of a folder of photographs, and small JPEG copies of them by name.

    Raises InputError if they cannot be read, see `read_photos`; if one is so narrow that nothing of it is left in a
    small copy.
    """
    store = PhotoStore(folder)
    found = read_photos(folder, store, threads)
    for photo in found:
        if min(photo.width, photo.height) * min(1.0, MATCHED_PX / max(photo.width, photo.height)) < _LEAST_SIDE_PX:
            size = f"{photo.width} x {photo.height}"
            raise InputError(f"{folder / photo.name}: {size} pixels, too narrow for a photograph; leave it out")
    names = [photo.name for photo in found]
    thumb_px = next(size for count, size in THUMBS_PX if len(names) <= count)
    with one_opencv_thread():
        seen = []
        for done, one in enumerate(in_order(lambda name: _measured(store.image(name), thumb_px), names, threads)):
            progress(done, 2 * len(names), "photos")
            seen.append(one)
        pairs = preview_pairs(np.array([one.tiny for one in seen]))
        matched: dict[tuple[int, int], IntArray] = {}
        work = in_order(lambda pair: matches(seen[pair[0]].features, seen[pair[1]].features), pairs, threads)
        for done, (pair, rows) in enumerate(zip(pairs, work, strict=True)):
            progress(len(pairs) + done, 2 * len(pairs), "overlap")
            if len(rows) >= LEAST_MATCHES:
                matched[pair] = rows
    preview = _preview(
        names, [(p.width, p.height) for p in found], seen, matched, len(pairs), unsupported_files(folder)
    )
    return preview, {name: one.thumb for name, one in zip(names, seen, strict=True)}


def preview_pairs(tiny: Array) -> list[tuple[int, int]]:
    """Pairs to match of photos whose tiny copies, shape (n, d), each of unit length, are given."""
    count = len(tiny)
    if count * (count - 1) // 2 <= MOST_PAIRS:
        return [(i, j) for i in range(count) for j in range(i + 1, count)]
    pairs = {(i, j) for i in range(count) for j in range(i + 1, min(i + ORDER_NEIGHBOURS + 1, count))}
    similarity = tiny @ tiny.T
    np.fill_diagonal(similarity, -1.0)
    order = np.argsort(-similarity, axis=1)
    for rank in range(count - 1):
        for i in range(count):
            if len(pairs) >= MOST_PAIRS:
                return sorted(pairs)
            j = int(order[i, rank])
            pairs.add((min(i, j), max(i, j)))
    return sorted(pairs)


def matches(one: Features, two: Features) -> IntArray:
    """Mutual nearest features that fit one fundamental matrix, as rows, shape (n, 2); none where too few do."""
    nothing = np.zeros((0, 2), dtype=np.int64)
    if min(len(one.keypoints), len(two.keypoints)) < LEAST_MATCHES:
        return nothing
    a, b = (each.descriptors.astype(np.float32) for each in (one, two))
    a /= np.maximum(np.linalg.norm(a, axis=1, keepdims=True), 1e-9)
    b /= np.maximum(np.linalg.norm(b, axis=1, keepdims=True), 1e-9)
    similarity = a @ b.T
    best = similarity.argmax(axis=1)
    rows = np.arange(len(a))
    top = similarity[rows, best]
    others = similarity.copy()
    others[rows, best] = -1.0
    second = others.max(axis=1)
    # Of unit vectors the squared distance is 2 - 2 times the product.
    clear = 2.0 - 2.0 * top < _RATIO**2 * (2.0 - 2.0 * second)
    good = np.flatnonzero(clear & (similarity.argmax(axis=0)[best] == rows))
    if len(good) < LEAST_MATCHES:
        return nothing
    pairs = np.stack([good, best[good]], axis=1)
    cv2.setRNGSeed(0)
    _, inside = cv2.findFundamentalMat(
        one.keypoints[pairs[:, 0], :2], two.keypoints[pairs[:, 1], :2], cv2.FM_RANSAC, _GEOMETRY_PX, 0.999, 1000
    )
    return nothing if inside is None else np.asarray(pairs[np.ravel(inside) == 1], dtype=np.int64)


def _measured(image: Image, thumb_px: int) -> _Seen:
    grey = grey_of(shrunk(image, ANALYSED_PX))
    small = shrunk(image, MATCHED_PX)
    settings = ReconstructionSettings(max_features=FEATURES, first_octave=0)
    tiny = cv2.resize(small, (12, 9), interpolation=cv2.INTER_AREA).astype(np.float64).ravel()
    tiny -= tiny.mean()
    return _Seen(
        sharpness=sharpness_of(grey),
        mean=float(grey.mean()),
        dark_pct=100.0 * float((grey <= DARK).mean()),
        bright_pct=100.0 * float((grey >= BRIGHT).mean()),
        features=photo_features(small, settings),
        tiny=tiny / max(float(np.linalg.norm(tiny)), 1e-9),
        thumb=cv2.imencode(".jpg", shrunk(image, thumb_px), [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes(),
        size=(small.shape[1], small.shape[0]),
    )


def _preview(
    names: list[str],
    sizes: list[tuple[int, int]],
    seen: list[_Seen],
    matched: dict[tuple[int, int], IntArray],
    pairs: int,
    others: dict[str, int],
) -> PhotoPreview:
    count = len(names)
    usual = float(np.median([one.sharpness for one in seen]))
    ends = np.array(list(matched), dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    by_size = np.argsort(-np.bincount(label), kind="stable")
    group = np.argsort(by_size)[label]
    photos = []
    for i, one in enumerate(seen):
        mine = [(len(rows), a + b - i, rows[:, 0 if a == i else 1]) for (a, b), rows in matched.items() if i in (a, b)]
        mine.sort(key=lambda entry: -entry[0])
        covered = _covered(one, [rows for _, _, rows in mine])
        photo = PhotoQuality(
            name=names[i],
            width=sizes[i][0],
            height=sizes[i][1],
            sharpness_pct=100.0 * one.sharpness / max(usual, 1e-12),
            mean=one.mean,
            dark_pct=one.dark_pct,
            bright_pct=one.bright_pct,
            features=len(one.features.keypoints),
            partners=tuple((names[j], n) for n, j, _ in mine),
            covered_pct=covered,
            group=int(group[i]),
            faults=(),
        )
        photos.append(_with_faults(photo))
    groups = tuple(int(n) for n in np.bincount(group))
    return PhotoPreview(
        photos=tuple(photos), groups=groups, pairs=pairs, advice=_advice(photos, groups), passed_over=others
    )


def _covered(one: _Seen, partners: list[IntArray]) -> float:
    """Share of a photo's parts, in percent, in which two or more partners show the same, of those with any features."""
    across, down = CELLS
    place = one.features.keypoints[:, :2] / np.array(one.size)
    cell = np.clip((place * [across, down]).astype(np.int64), 0, [across - 1, down - 1]) @ [1, across]
    counts = np.zeros(across * down, dtype=np.int64)
    for rows in partners:
        here: BoolArray = np.zeros(across * down, dtype=np.bool_)
        here[cell[rows]] = True
        counts += here
    return 100.0 * float((counts >= LEAST_PARTNERS).mean())


def _with_faults(photo: PhotoQuality) -> PhotoQuality:
    faults = []
    if photo.sharpness_pct < 100.0 * BLURRED_SHARE:
        faults.append(f"blurred: {photo.sharpness_pct:.0f} % of the usual sharpness")
    if photo.dark_pct > MOST_DARK_PCT:
        faults.append(f"too dark: {photo.dark_pct:.0f} % of it is black")
    if photo.bright_pct > MOST_BRIGHT_PCT:
        faults.append(f"burnt out: {photo.bright_pct:.0f} % of it is white")
    if not photo.partners:
        faults.append("alone: overlaps no other photo")
    elif len(photo.partners) < LEAST_PARTNERS:
        faults.append(f"one partner: overlaps {photo.partners[0][0]} only")
    elif photo.covered_pct < LEAST_COVERED_PCT:
        faults.append(f"little shared: two other photos show {photo.covered_pct:.0f} % of it")
    return replace(photo, faults=tuple(faults))


def _advice(photos: Sequence[PhotoQuality], groups: tuple[int, ...]) -> tuple[str, ...]:
    """What to shoot again or between, most important first."""
    out = []
    parts = [number for number, count in enumerate(groups) if count > 1]
    if len(parts) > 1:
        first = {number: next(p.name for p in photos if p.group == number) for number in parts}
        others = ", ".join(f"{groups[number]} with {first[number]}" for number in parts[1:])
        out.append(
            f"the photos fall into {len(parts)} groups that share nothing: {groups[0]} with {first[0]}, {others}; "
            "photograph the way from one to the other"
        )
    # A gap is between neighbours in order that do not overlap, though both overlap others.
    for one, two in pairwise(photos):
        partners = {name for name, _ in one.partners}
        if one.group != two.group and one.partners and two.partners and two.name not in partners:
            out.append(f"between {one.name} and {two.name} there is a gap: two or three photos on the way")
    for word, what in (("blurred", "hold still, or more light"), ("dark", "more light, or a longer exposure"),
                       ("burnt", "less light, or a shorter exposure")):  # fmt: skip
        names = [photo.name for photo in photos if any(word in fault for fault in photo.faults)]
        if names:
            out.append(f"again, as {'they are' if len(names) > 1 else 'it is'} {word}: {_some(names)} ({what})")
    lonely = [p.name for p in photos if any(f.startswith(("alone", "one partner", "little shared")) for f in p.faults)]
    if lonely:
        out.append(f"more photos around {_some(lonely)}: each part of the subject must be in three or more")
    return tuple(out)


def _some(names: list[str]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{', '.join(names[:6])} and {len(names) - 6} more"
