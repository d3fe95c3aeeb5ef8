"""Which photos are matched: all pairs, neighbours by name, neighbours by pose, or similar ones by image retrieval.

Image retrieval: the residuals of a photo's descriptors from a few cluster centres, summed to one vector (VLAD: H. Jegou
et al., CVPR 2010, doi 10.1109/CVPR.2010.5540039), normalised by centre (R. Arandjelovic and A. Zisserman, All about
VLAD, CVPR 2013, doi 10.1109/CVPR.2013.207).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.settings import RANDOM_SEED, ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import open_database

Pairs = list[tuple[str, str]]
# Views whose axes differ by more hardly share a SIFT match (Mikolajczyk & Schmid 2005, doi 10.1109/TPAMI.2005.188).
EXHAUSTIVE_UP_TO, SEQUENCE_OVERLAP, POSE_NEIGHBOURS, BAND_NEIGHBOURS = 80, 10, 8, 6
"""Photos up to which `auto` matches every pair; photos that each is matched with, in sequence, by poses, and along
epipolar lines of poses: those find more in a pair, and with 6 cameras came out as precise as with 8."""
MAX_ANGLE_RAD = np.radians(45.0)


def choose_pairs(
    names: list[str],
    settings: ReconstructionSettings,
    centres_W_m: dict[str, Array] | None = None,
    axes_W: dict[str, Array] | None = None,
    neighbours: int = POSE_NEIGHBOURS,
) -> Pairs:
    """Pairs by the settings.

    `names`: photo names in order. `centres_W_m`, `axes_W`: camera centres and optical axes, shape (3,) each, by name.
    Without axes all have the same direction. `neighbours`: least number for each photo, by poses.
    Raises InputError if pairs by poses are asked for and not every photo has a known position.
    """
    known = centres_W_m is not None and all(name in centres_W_m for name in names)
    if settings.matching == "poses" and not known:
        raise InputError("matching by poses: needs a known position of every photo's camera")
    if known and centres_W_m is not None and (settings.matching == "poses" or (settings.matching == "auto" and axes_W)):
        centres = np.array([centres_W_m[name] for name in names])
        axes = None
        if axes_W is not None and all(name in axes_W for name in names):
            axes = np.array([axes_W[name] for name in names])
        return pose_pairs(names, centres, axes, neighbours)
    if settings.matching == "sequential" or uses_retrieval(len(names), settings):
        return sequence_pairs(names, SEQUENCE_OVERLAP)
    return list(combinations(names, 2))


def uses_retrieval(photos: int, settings: ReconstructionSettings) -> bool:
    """Whether similar photos are matched as well; image retrieval needs features."""
    return settings.matching == "look-alike" or (settings.matching == "auto" and photos > EXHAUSTIVE_UP_TO)


def sequence_pairs(names: list[str], overlap: int) -> Pairs:
    """Each photo with the next few in order of name, and ever wider ones.

    The steps that double (1, 2, 4, ...) beyond the overlap tie later laps of an orbit to earlier ones; the last photos
    are tied to the first, as an orbit closes.
    """
    n = len(names)
    powers = [2**k for k in range(n.bit_length()) if overlap < 2**k < n]
    steps = [*range(1, min(overlap, n - 1) + 1), *powers]
    found = {(i, i + step) for step in steps for i in range(n - step)}
    found |= {(i, n - j) for j in range(1, overlap + 1) for i in range(overlap - j + 1) if i < n - j}
    return [(names[i], names[j]) for i, j in sorted(found)]


def pose_pairs(names: list[str], centres_W_m: Array, axes_W: Array | None, neighbours: int) -> Pairs:
    """Each photo with the nearest others of about its direction, and a tree that connects all.

    `centres_W_m` has shape (n, 3). `axes_W`, shape (n, 3): unit optical axes; photos whose axes are more than 45 deg
    apart are no neighbours. `neighbours`: how many each is paired with at least, if there are so many.
    """
    n = len(names)
    centres = np.asarray(centres_W_m, dtype=np.float64)
    distance = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    away = np.zeros((n, n), dtype=np.bool_)
    if axes_W is not None:
        unit = np.asarray(axes_W) / np.linalg.norm(axes_W, axis=1, keepdims=True)
        away = unit @ unit.T < np.cos(MAX_ANGLE_RAD)
    near = np.where(away, np.inf, distance)
    np.fill_diagonal(near, np.inf)
    found: set[tuple[int, int]] = set()
    for i in range(n):
        order = np.argsort(near[i], kind="stable")[:neighbours]
        found |= {(min(i, int(j)), max(i, int(j))) for j in order if np.isfinite(near[i, j])}
    # A spanning tree, with high costs where axes differ, so that all photos are connected.
    span = float(distance.max()) + 1.0
    one, two = np.triu_indices(n, 1)
    tree = minimum_spanning_tree(
        coo_array((1e-9 + distance[one, two] + span * away[one, two], (one, two)), shape=(n, n)).tocsr()
    )
    found |= {(min(a, b), max(a, b)) for a, b in zip(*(index.tolist() for index in tree.nonzero()), strict=True)}
    return [(names[a], names[b]) for a, b in sorted(found)]


WORDS, ROUNDS = 64, 8
"""Typical descriptors, and rounds of k-means that find them."""
SAMPLE, MOST_FEATURES = 20_000, 2_000
"""Descriptors that the words are learnt from, and most of a photograph that count."""
Descriptors = NDArray[np.uint8]
Singles = NDArray[np.float32]
RETRIEVED_NEIGHBOURS = 20
"""Photographs that each is matched with for its described."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageDescriptors:
    """Names, and a unit vector of each photograph, shape (n, 128 WORDS); zeros for one without features."""

    names: tuple[str, ...]
    vectors: Array

    def __post_init__(self) -> None:
        freeze(self, vectors=(len(self.names), None))

    def likeness(self) -> Array:
        """Cosine between all, shape (n, n), -1 of each with itself."""
        found: Array = self.vectors @ self.vectors.T
        np.fill_diagonal(found, -1.0)
        return found


def read_descriptors(database: Path) -> ImageDescriptors:
    """Looks of every photograph in COLMAP's database."""
    with open_database(database) as link:
        images = sorted(link.read_all_images(), key=lambda image: image.name)
        described = [
            np.asarray(link.read_descriptors(image.image_id).data, dtype=np.uint8).reshape(-1, 128)[:MOST_FEATURES]
            for image in images
        ]
    words = learn_words(np.concatenate(described), np.random.default_rng(RANDOM_SEED))
    vectors = np.array([describe(one, words) for one in described])
    return ImageDescriptors(names=tuple(image.name for image in images), vectors=vectors)


def retrieve_pairs(described: ImageDescriptors, most: int = RETRIEVED_NEIGHBOURS) -> Pairs:
    """Each photograph with the most similar ones."""
    likeness = described.likeness()
    found = set()
    for i, row in enumerate(likeness):
        for j in np.argsort(-row, kind="stable")[: min(most, len(described.names) - 1)].tolist():
            found.add((min(i, j), max(i, j)))
    return [(described.names[a], described.names[b]) for a, b in sorted(found)]


def learn_words(descriptors: Descriptors, rng: np.random.Generator) -> Singles:
    """Typical descriptors, shape (at most WORDS, 128), by k-means of a sample."""
    if len(descriptors) == 0:
        return np.zeros((1, 128), dtype=np.float32)
    chosen = rng.choice(len(descriptors), min(len(descriptors), SAMPLE), replace=False)
    sample = np.asarray(descriptors)[np.sort(chosen)].astype(np.float32)
    words = sample[rng.choice(len(sample), min(WORDS, len(sample)), replace=False)]
    for _ in range(ROUNDS):
        nearest = _nearest(sample, words)
        count = np.bincount(nearest, minlength=len(words))
        total = np.zeros_like(words)
        np.add.at(total, nearest, sample)
        words = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], words).astype(np.float32)
    return words


def describe(descriptors: Descriptors, words: Singles) -> Singles:
    """Vector of a photograph with such descriptors, shape (words x 128,)."""
    own = np.asarray(descriptors).astype(np.float32)
    sums = np.zeros_like(words)
    if len(own):
        nearest = _nearest(own, words)
        np.add.at(sums, nearest, own - words[nearest])
    sums = np.sign(sums) * np.sqrt(np.abs(sums))
    sums /= np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-9)
    flat = sums.ravel()
    return np.asarray(flat / max(float(np.linalg.norm(flat)), 1e-9), dtype=np.float32)


def _nearest(points: Singles, words: Singles) -> IntArray:
    """Number of the nearest word of each, shape (n,): |p - w|^2 without the part that all words share."""
    return np.asarray(np.argmin((words**2).sum(axis=1) - 2.0 * points @ words.T, axis=1), dtype=np.int64)
