"""ONNX model of a detector: the session of ONNX Runtime, the layout of the picture, and settings of the metadata.

Settings are text entries of the model's metadata (`custom_metadata_map`), all optional;
`wakewise.perception.onnx_detector` describes them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.checks import one_of
from wakewise.core.errors import InputError
from wakewise.core.plugins import reason_of
from wakewise.perception.detector import Image

PREFIX = "wakewise."
KEYS = ("layout", "mean", "std", "values", "threshold", "least_area", "classes")
LAYOUTS = ("nchw", "nhwc")
VALUES = ("logits", "probabilities")
LEAST_AREA = 1e-4
"""Default of the least area of a detection, as a share of the picture: 31 px of 640 x 480."""
_TYPES: dict[str, type[np.float32] | type[np.uint8]] = {"tensor(float)": np.float32, "tensor(uint8)": np.uint8}


@dataclass(frozen=True, kw_only=True)
class OnnxSettings:
    """Settings of a detector's ONNX model; None where the model decides (`layout`) or the output does (the others)."""

    layout: str | None = None
    mean: tuple[float, ...] = (0.0,)
    std: tuple[float, ...] = (1.0,)
    values: str | None = None
    threshold: float | None = None
    least_area: float = LEAST_AREA
    classes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ImageInput:
    """Image input of a model: name, layout, type, and size in px; None for a size that the picture decides."""

    name: str
    layout: str
    dtype: type[np.float32] | type[np.uint8]
    width: int | None
    height: int | None

    def size(self, image: Image) -> tuple[int, int]:
        """Width and height in px that the model gets of this picture."""
        height, width = image.shape[:2]
        return self.width or width, self.height or height


@dataclass(frozen=True, kw_only=True, eq=False)
class OnnxModel:
    """Opened ONNX model with one image input; `session` is ONNX Runtime's `InferenceSession`."""

    path: Path
    image: ImageInput
    outputs: tuple[str, ...]
    settings: OnnxSettings
    session: Any

    def run(self, image: Image) -> dict[str, NDArray[np.floating[Any]]]:
        """Outputs by name for an RGB picture, shape (h, w, 3); raises InputError if one is no finite float array."""
        try:
            values: Sequence[object] = self.session.run(None, {self.image.name: model_input(self, image)})
        except Exception as fault:  # ONNX Runtime has many error types of its own
            width, height = self.image.size(image)
            raise InputError(f"{self.path}: cannot be run on {width} x {height} px, {reason_of(fault)}") from fault
        found: dict[str, NDArray[np.floating[Any]]] = {}
        for name, value in zip(self.outputs, values, strict=True):
            if not isinstance(value, np.ndarray) or not np.issubdtype(value.dtype, np.floating):
                what = value.dtype if isinstance(value, np.ndarray) else type(value).__name__
                raise InputError(f"{self.path}: output '{name}' is {what}, must be an array of float")
            if not np.isfinite(value).all():
                raise InputError(f"{self.path}: output '{name}' holds NaN or infinity, must be finite")
            found[name] = value
        return found


def open_onnx_model(path: Path, threads: int) -> OnnxModel:
    """Open a model file on the CPU.

    Raises InputError if there is no file, it is no ONNX model, its input is no image, or a setting of its metadata is
    wrong.
    """
    import onnxruntime

    if not path.is_file():
        raise InputError(f"{path}: no such file, must be an ONNX model")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Waiting threads would take the processor from the control loop.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    # Errors are raised as well; they need not be printed.
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as fault:  # ONNX Runtime has many error types of its own
        raise InputError(f"{path}: cannot be read as an ONNX model, {reason_of(fault)}") from fault
    settings = read_settings(session.get_modelmeta().custom_metadata_map, path)
    image = _image_input(session.get_inputs(), settings.layout, path)
    if image.dtype is np.uint8 and (any(settings.mean) or set(settings.std) != {1.0}):
        raise InputError(f"{path}: input '{image.name}' is uint8, must have no {PREFIX}mean and no {PREFIX}std")
    outputs = tuple(output.name for output in session.get_outputs())
    return OnnxModel(path=path, image=image, outputs=outputs, settings=settings, session=session)


def model_input(model: OnnxModel, image: Image) -> NDArray[Any]:
    """Input of the model for an RGB picture: resized without regard to its aspect ratio, normalised, in its layout."""
    width, height = model.image.size(image)
    shrinks = width * height < image.shape[0] * image.shape[1]
    pixels = image
    if (height, width) != image.shape[:2]:
        pixels = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    values: NDArray[Any] = pixels
    if model.image.dtype is np.float32:
        mean, std = np.array([model.settings.mean], np.float32), np.array([model.settings.std], np.float32)
        values = (pixels.astype(np.float32) / np.float32(255.0) - mean) / std
    return np.ascontiguousarray((values.transpose(2, 0, 1) if model.image.layout == "nchw" else values)[None])


def read_settings(metadata: Mapping[str, str], path: Path) -> OnnxSettings:
    """Settings in a model's metadata; raises InputError if one is unknown or out of range."""
    given = {key.removeprefix(PREFIX): text for key, text in metadata.items() if key.startswith(PREFIX)}
    for key in given:
        one_of(key, KEYS, f"{path}: metadata {PREFIX}")
    found: dict[str, Any] = {}
    for key, text in given.items():
        where = f"{path}: {PREFIX}{key}"
        words = tuple(word.strip() for word in text.split(","))
        if key in ("layout", "values"):
            found[key] = one_of(text.strip().lower(), LAYOUTS if key == "layout" else VALUES, where)
        elif key == "classes":
            found[key] = words
        elif key in ("mean", "std"):
            found[key] = _numbers(words, (1, 3), where)
            if key == "std" and min(found[key]) <= 0.0:
                raise InputError(f"{where}: {text}, must be above 0")
        else:
            (found[key],) = _numbers(words, (1,), where)
            if not 0.0 <= found[key] <= 1.0:
                raise InputError(f"{where}: {text}, must be 0 to 1")
    return OnnxSettings(**found)


def _numbers(words: tuple[str, ...], lengths: tuple[int, ...], where: str) -> tuple[float, ...]:
    """Finite numbers of a list; raises InputError if it is of another length or holds anything else."""
    try:
        numbers = tuple(float(word) for word in words)
    except ValueError:
        numbers = ()
    if len(numbers) not in lengths or not all(map(math.isfinite, numbers)):
        allowed = " or ".join(map(str, lengths))
        raise InputError(f"{where}: {','.join(words)}, must be {allowed} finite numbers, separated by commas")
    return numbers


def _image_input(inputs: Sequence[Any], layout: str | None, path: Path) -> ImageInput:
    """The one image input; `inputs` are ONNX Runtime's, whose free sizes are texts or None."""
    if len(inputs) != 1:
        raise InputError(f"{path}: {len(inputs)} inputs ({', '.join(i.name for i in inputs)}), must be one image")
    (given,) = inputs
    where = f"{path}: input '{given.name}'"
    if given.type not in _TYPES:
        raise InputError(f"{where} is {given.type}, must be float32 or uint8")
    shape = tuple(size if isinstance(size, int) else None for size in given.shape)
    shown = f"({', '.join('?' if size is None else str(size) for size in shape)})"
    allowed = "must be (1, 3, H, W) or (1, H, W, 3)"
    if len(shape) != 4 or shape[0] not in (1, None):
        raise InputError(f"{where} has shape {shown}, {allowed}")
    channels = {"nchw": shape[1], "nhwc": shape[3]}
    fitting = [name for name in LAYOUTS if channels[name] == 3]
    if layout is None and len(fitting) != 1:
        if not fitting and set(channels.values()) != {None}:
            raise InputError(f"{where} has shape {shown}, {allowed}")
        raise InputError(f"{where} has shape {shown}, which fits both layouts: must have {PREFIX}layout")
    layout = layout or fitting[0]
    if channels[layout] not in (3, None):
        raise InputError(f"{where} has shape {shown}, which is not {layout} with 3 channels, as {PREFIX}layout says")
    height, width = shape[2:] if layout == "nchw" else shape[1:3]
    return ImageInput(name=given.name, layout=layout, dtype=_TYPES[given.type], width=width, height=height)
