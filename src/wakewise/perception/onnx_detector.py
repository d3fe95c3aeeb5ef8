"""Detector from an ONNX file: segmentation by one mask output, or detection by boxes and scores (ONNX Runtime, CPU).

Input: one image, float32 or uint8, shape (1, 3, H, W) or (1, H, W, 3), RGB; H and W may be dynamic. The picture is
resized to a fixed H and W. A float32 input gets (pixel / 255 - mean) / std, a uint8 input the pixels.

Output, float, of any size:

- one mask, shape (1, 1, h, w): probability of the object, or its logit;
- one mask, shape (1, C, h, w): the same of each class, class 0 is the background; the most probable class of a pixel
  counts;
- `boxes`, shape (n, 4), as left, top, right, bottom in px of the input, and `scores`, shape (n,). A box gives a
  rectangular mask. Overlapping boxes stay.

Values are probabilities if all of them are within 0 to 1, else logits, of which the sigmoid (softmax for C > 1) is
taken. This is decided for each picture, so a model that gives logits should state it in its metadata. Connected parts
of a mask (8 neighbours) are separate detections; the score is the mean probability.

Metadata of the model, all optional, text; lists are separated by commas:

- `wakewise.layout`: `nchw` or `nhwc`; needed only if the shape fits both;
- `wakewise.mean`, `wakewise.std`: 1 or 3 numbers, for pixels of 0 to 1; 0 and 1;
- `wakewise.values`: `logits` or `probabilities`; decided as above;
- `wakewise.threshold`: least probability of a pixel or score of a box; 0.5, for C > 1 it is 0;
- `wakewise.least_area`: least share of the picture that a detection covers; 0.0001;
- `wakewise.classes`: names of the classes without the background: C - 1, or one for (1, 1, h, w) and boxes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, softmax

from wakewise.core.arrays import BoolArray
from wakewise.core.checks import path_of, whole_number
from wakewise.core.errors import InputError
from wakewise.core.optional_dependencies import need
from wakewise.perception.detector import Detection, Image, checked_image
from wakewise.perception.onnx_model import PREFIX, OnnxModel, OnnxSettings, open_onnx_model

MOST = 50
"""At most so many detections of a picture, the best, because each has a mask of the whole picture."""
BOXES = {"boxes", "scores"}
Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True, kw_only=True)
class _Part:
    """Detection before its mask is made: the mask within its bounding box, whose corner is (left, top) in px."""

    score: float
    name: str
    left: int
    top: int
    inside: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class OnnxDetector:
    """Detector that runs an ONNX model; `load_onnx_detector` makes it."""

    name: str
    model: OnnxModel

    def detect(self, image: Image) -> tuple[Detection, ...]:
        """Detections in an RGB picture, shape (h, w, 3), best first, at most `MOST`.

        Raises InputError if the picture is no such array, the model cannot be run on its size, or an output is not
        finite or has a wrong shape.
        """
        return _detect(self.model, checked_image(image))


def load_onnx_detector(path: str | Path, *, width: int = 640, height: int = 480, threads: int = 1) -> OnnxDetector:
    """Detector from an ONNX file, which has run once on a picture of noise.

    `width`, `height`: size in px of that picture. `threads`: 1 or 2. Raises InputError if there is no file, it is no
    ONNX model, has other inputs or outputs than this module describes, or cannot be run; MissingExtra if ONNX Runtime
    is not installed.
    """
    need("an ONNX detector", "detector")
    whole_number(threads, "threads", 1, 2)
    shape = whole_number(height, "height", 1), whole_number(width, "width", 1), 3
    model = open_onnx_model(path_of(path, "ONNX detector"), threads)
    if len(model.outputs) != 1 and set(model.outputs) != BOXES:
        raise InputError(f"{model.path}: outputs {', '.join(model.outputs)}, must be one mask, or boxes and scores")
    _detect(model, np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8))  # refused if it cannot be run
    return OnnxDetector(name=model.path.stem, model=model)


def _detect(model: OnnxModel, image: Image) -> tuple[Detection, ...]:
    """Detections of a model in a picture, best first."""
    found = model.run(image)
    height, width = image.shape[:2]
    parts = _of_boxes(model, found, image) if set(found) == BOXES else _of_mask(model, found, width, height)
    best = sorted(parts, key=lambda part: -part.score)[:MOST]
    return tuple(_detection(part, width, height) for part in best)


def _detection(part: _Part, width: int, height: int) -> Detection:
    """Detection with a mask of the whole picture."""
    mask = np.zeros((height, width), dtype=np.bool_)
    rows, columns = part.inside.shape
    mask[part.top : part.top + rows, part.left : part.left + columns] = part.inside
    return Detection(mask=mask, score=part.score, name=part.name)


def _of_mask(model: OnnxModel, found: dict[str, Floats], width: int, height: int) -> list[_Part]:
    """Connected parts of a mask output; raises InputError if it is no mask."""
    ((output, values),) = found.items()
    if values.ndim != 4 or values.shape[0] != 1 or not values.size:
        raise InputError(f"{model.path}: output '{output}' has shape {values.shape}, must be (1, C, h, w)")
    settings, count = model.settings, max(values.shape[1] - 1, 1)
    names = settings.classes or ("",) * count
    if len(names) != count:
        raise InputError(f"{model.path}: {PREFIX}classes has {len(names)} names, output '{output}' needs {count}")
    shares = _probabilities(values[0], settings)
    if len(shares) == 1:
        best = _resized(shares[0], width, height)
        which = (best >= (0.5 if settings.threshold is None else settings.threshold)).astype(np.int32)
    else:
        best = _resized(shares[0], width, height)
        which = np.zeros((height, width), dtype=np.int32)
        # One class at a time: all of them in the picture's size would need much memory.
        for number in range(1, len(shares)):
            share = _resized(shares[number], width, height)
            better = share > best
            best, which = np.where(better, share, best), np.where(better, number, which)
        which[best < (settings.threshold or 0.0)] = 0
    parts: list[_Part] = []
    for number in np.unique(which[which > 0]).tolist():
        parts += _components(which == number, best, names[number - 1], settings.least_area)
    return parts


def _components(mask: BoolArray, shares: Floats, name: str, least_area: float) -> list[_Part]:
    """Connected parts of one class, the best `MOST`; `shares`, shape (h, w): probabilities."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA]
    scores = np.clip(np.bincount(labels.ravel(), shares.ravel(), len(areas)) / np.maximum(areas, 1), 0.0, 1.0)
    large = [k for k in range(1, len(areas)) if areas[k] >= least_area * mask.size]
    parts: list[_Part] = []
    for k in sorted(large, key=lambda k: -scores[k])[:MOST]:
        left, top, width, height = (int(size) for size in stats[k, :4])
        inside = labels[top : top + height, left : left + width] == k
        parts.append(_Part(score=float(scores[k]), name=name, left=left, top=top, inside=inside))
    return parts


def _of_boxes(model: OnnxModel, found: dict[str, Floats], image: Image) -> list[_Part]:
    """Boxes within the picture, the best `MOST`; raises InputError if shapes are wrong."""
    boxes, scores = found["boxes"], found["scores"]
    if scores.ndim != 1 or boxes.shape != (len(scores), 4):
        shapes = f"outputs 'boxes' of shape {boxes.shape} and 'scores' of {scores.shape}"
        raise InputError(f"{model.path}: {shapes}, must be (n, 4) and (n,)")
    if len(model.settings.classes) > 1:
        raise InputError(f"{model.path}: {PREFIX}classes has {len(model.settings.classes)} names, boxes need one")
    (name,) = model.settings.classes or ("",)
    height, width = image.shape[:2]
    given_width, given_height = model.image.size(image)
    threshold = 0.5 if model.settings.threshold is None else model.settings.threshold
    shares = _probabilities(scores[None], model.settings)[0]
    scale = np.array([width / given_width, height / given_height] * 2)
    edges = np.clip(np.rint(boxes.astype(np.float64) * scale), 0, [width, height] * 2).astype(np.int64)
    sizes = (edges[:, 2:] - edges[:, :2]).clip(0)
    large = sizes.prod(axis=1) >= max(1.0, model.settings.least_area * width * height)
    parts: list[_Part] = []
    for k in np.argsort(-shares, kind="stable").tolist():
        if large[k] and shares[k] >= threshold and len(parts) < MOST:
            inside = np.ones((int(sizes[k, 1]), int(sizes[k, 0])), dtype=np.bool_)
            left, top = int(edges[k, 0]), int(edges[k, 1])
            parts.append(_Part(score=float(shares[k]), name=name, left=left, top=top, inside=inside))
    return parts


def _probabilities(values: Floats, settings: OnnxSettings) -> Floats:
    """Probabilities of values, shape (C, ...): themselves, or the sigmoid (softmax for C > 1) of logits.

    Values that the metadata calls probabilities are clipped to 0 to 1.
    """
    exact: Floats = values.astype(np.result_type(values, np.float32))
    if not exact.size:
        return exact
    within = float(exact.min()) >= 0.0 and float(exact.max()) <= 1.0
    if settings.values == "probabilities" or (settings.values is None and within):
        return np.clip(exact, 0.0, 1.0)
    return np.asarray(expit(exact) if len(exact) == 1 else softmax(exact, axis=0))


def _resized(share: Floats, width: int, height: int) -> Floats:
    """A map of probabilities in the picture's size, linearly interpolated."""
    if share.shape == (height, width):
        return share
    return np.asarray(cv2.resize(share, (width, height), interpolation=cv2.INTER_LINEAR))
