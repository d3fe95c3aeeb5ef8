"""Which photographs look alike, by their features: whom to match where there are too many to match all with all.

Each photograph becomes one vector: its descriptors' differences from a few typical ones, summed (H. Jegou et al.,
Aggregating local descriptors into a compact image representation, CVPR 2010, doi 10.1109/CVPR.2010.5540039), evened out
word by word (R. Arandjelovic and A. Zisserman, All about VLAD, CVPR 2013, doi 10.1109/CVPR.2013.207).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.vision.reconstruction.colmap import pycolmap
from wakewise.vision.reconstruction.pairs import Pairs
from wakewise.vision.reconstruction.settings import RANDOM_SEED

WORDS, ROUNDS = 64, 8
"""Typical descriptors, and rounds of k-means that find them."""
SAMPLE, MOST_FEATURES = 20_000, 2_000
"""Descriptors that the words are learnt from, and most of a photograph that count."""
Descriptors = NDArray[np.uint8]
Singles = NDArray[np.float32]
LOOK_ALIKES = 20
"""Photographs that each is matched with for its looks."""


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
    link = pycolmap.Database.open(database)
    try:
        images = sorted(link.read_all_images(), key=lambda image: image.name)
        described = [
            np.asarray(link.read_descriptors(image.image_id).data, dtype=np.uint8).reshape(-1, 128)[:MOST_FEATURES]
            for image in images
        ]
    finally:
        link.close()
    words = learn_words(np.concatenate(described), np.random.default_rng(RANDOM_SEED))
    vectors = np.array([describe(one, words) for one in described])
    return ImageDescriptors(names=tuple(image.name for image in images), vectors=vectors)


def retrieve_pairs(looks: ImageDescriptors, most: int = LOOK_ALIKES) -> Pairs:
    """Each photograph with those that look most like it."""
    likeness = looks.likeness()
    found = set()
    for i, row in enumerate(likeness):
        for j in np.argsort(-row, kind="stable")[: min(most, len(looks.names) - 1)].tolist():
            found.add((min(i, j), max(i, j)))
    return [(looks.names[a], looks.names[b]) for a, b in sorted(found)]


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
