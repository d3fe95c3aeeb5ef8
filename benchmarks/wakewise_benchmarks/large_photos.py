"""Photographs of 12 million pixels: memory and time by their number, beside plain pycolmap, and what 500 would take.

The photographs are rendered: a textured bed with plateaus at several heights, seen from a grid of places 2 m above it.
Ours and pycolmap's own calls (features, all pairs, incremental mapping) have the same number of features, one thread
and the same lens model; pycolmap has no dense points without CUDA. Each part runs in a process of its own, so that its
memory is its own. Figures of 500 photographs are extrapolated, not measured: features, pairs and stereo take a time for
each, mapping follows a power of the number, and the memory of each stage a line. That of fusion and mesh is a line over
the points, of which there are `dense_points.MOST_POINTS` at most; reading and stereo have stores of bounded size beside
a small picture of each photograph. Each further thread of feature extraction has 2.2 GB of its own.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.errors import StageError
from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.vision.reconstruction import ReconstructionRequest, ReconstructionSettings, reconstruct
from wakewise.vision.reconstruction.dense.dense_points import HELD_BYTES, MOST_POINTS
from wakewise.vision.reconstruction.sfm.colmap import pycolmap
from wakewise.vision.reconstruction.sfm.pairs import RETRIEVED_NEIGHBOURS, SEQUENCE_OVERLAP, sequence_pairs
from wakewise_benchmarks.peak_memory import forget_peak, peak_memory_MB

WIDTH, HEIGHT, FOCAL_PX = 4000, 3000, 3600.0
ABOVE_M, STEP_M, TEXEL_M, TILT_RAD = 2.0, 0.3, 0.001, 0.08
"""Height of the cameras above the bed, their distance, size of the texture's pixels, and largest tilt."""
PLATEAUS, HIGHEST_M, RADIUS_M, SEED = 40, 0.4, 0.15, 1
SMALL_MB = 3e-6 * (WIDTH // (WIDTH // 640)) * (HEIGHT // (WIDTH // 640))
"""Of a photograph as stereo keeps it, at the usual `dense_px` of 640."""
COUNTS, MANY = (12, 24), 500
"""At 12 the room for decoded photographs is full (`photo_folder.KEPT_BYTES`), from where memory follows a line."""


def run(options: BenchOptions) -> dict[str, Any]:
    """Memory and time of each number of photographs, ours and pycolmap's, and those extrapolated to 500."""
    counts = tuple(sorted(set(options.photographs or COUNTS)))
    found: dict[str, dict[str, Any]] = {}
    with tempfile.TemporaryDirectory(prefix="wakewise-bench-") as name:
        for done, count in enumerate(counts):
            options.progress(done, len(counts), f"{count} photographs")
            photos = Path(name) / f"photos-{count}"
            render(photos, count)
            model = Path(name) / f"model-{count}"
            sparse, dense, plain = (
                _in_a_process(work, photos, folder)
                for work, folder in ((ours_sparse, model), (ours_dense, model), (plain_sparse, Path(name) / "plain"))
            )
            found[str(count)] = {"sparse": sparse, "dense": dense, "pycolmap": plain}
    return {"megapixels": 1e-6 * WIDTH * HEIGHT, "photographs": found} | extrapolated(found)


def render(folder: Path, count: int) -> None:
    """Write photographs of a bed with plateaus, JPEG, from a grid of places in rows."""
    rng = np.random.default_rng(SEED)
    columns = math.ceil(math.sqrt(count))
    reach_m = 0.5 * ABOVE_M * WIDTH / FOCAL_PX + 2.0 * ABOVE_M * TILT_RAD
    side_m = (columns - 1) * STEP_M + 2.0 * reach_m
    size = math.ceil(side_m / TEXEL_M)
    texture = _texture(size, rng)
    corners = rng.uniform(0.0, side_m, (PLATEAUS, 2))
    layers: list[tuple[float, Array | None, NDArray[np.uint8]]] = [(0.0, None, np.full_like(texture, 255))]
    for height, (x, y) in zip(np.linspace(0.05, HIGHEST_M, PLATEAUS), corners, strict=True):
        mask = np.zeros_like(texture)
        cv2.circle(mask, (int(x / TEXEL_M), int(y / TEXEL_M)), int(RADIUS_M / TEXEL_M), 255, -1)
        layers.append((float(height), np.array([x, y]) / TEXEL_M, mask))
    folder.mkdir()
    for k in range(count):
        row, column = divmod(k, columns)
        eye = np.array([reach_m + column * STEP_M, reach_m + row * STEP_M, ABOVE_M])
        tilt = matrix_from_quat(quat_from_rotvec(rng.uniform(-TILT_RAD, TILT_RAD, 3)))
        grey = np.zeros((HEIGHT, WIDTH), np.uint8)
        for height, middle, mask in layers:  # the higher ones hide the others
            H = _homography(eye, tilt, height)
            if middle is not None and _is_outside(H, middle):
                continue
            seen = cv2.warpPerspective(mask, H, (WIDTH, HEIGHT), flags=cv2.INTER_NEAREST) > 0
            if seen.any():
                np.copyto(grey, cv2.warpPerspective(texture, H, (WIDTH, HEIGHT)), where=seen)
        cv2.imwrite(str(folder / f"{k:04d}.jpg"), cv2.merge([grey, grey, grey]))


def _texture(size: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Noise of several sizes, shape (size, size)."""
    total = np.zeros((size, size), np.float32)
    for cell in (6, 20, 70, 200):
        few = rng.standard_normal((size // cell + 2, size // cell + 2)).astype(np.float32)
        total += cv2.resize(few, (size, size), interpolation=cv2.INTER_CUBIC)
    return np.clip(128.0 + 30.0 * total, 0, 255).astype(np.uint8)


def _is_outside(H: Array, middle: Array) -> bool:
    """Whether no part of a plateau about this pixel of the texture can lie in the photograph."""
    x, y, w = H @ np.append(middle, 1.0)
    margin = 2.0 * RADIUS_M * FOCAL_PX / (ABOVE_M - HIGHEST_M)
    return not (-margin < x / w < WIDTH + margin and -margin < y / w < HEIGHT + margin)


def _homography(eye: Array, tilt: Array, height_m: float) -> Array:
    """From the texture's pixels at a height to the photograph's; the camera looks down, its x and y along the bed's."""
    R = tilt @ np.diag([1.0, -1.0, -1.0])
    K = np.array([[FOCAL_PX, 0.0, 0.5 * WIDTH], [0.0, FOCAL_PX, 0.5 * HEIGHT], [0.0, 0.0, 1.0]])
    plane = np.array([[TEXEL_M, 0.0, 0.0], [0.0, TEXEL_M, 0.0], [0.0, 0.0, height_m]])
    place = plane - np.outer(eye, [0.0, 0.0, 1.0])
    return np.asarray(K @ R @ place)


class _Marks:
    """Wall and processor seconds, those of child processes included, and greatest memory by name of what was begun."""

    def __init__(self) -> None:
        self.wall_s: dict[str, float] = {}
        self.cpu_s: dict[str, float] = {}
        self.memory_MB: dict[str, float] = {}
        self._name, self._at = "read", _clocks()

    def begin(self, name: str) -> None:
        """Close what is under way and begin another."""
        if name == self._name:
            return
        now = _clocks()
        for kept, begun, ended in zip((self.wall_s, self.cpu_s), self._at, now, strict=True):
            kept[self._name] = kept.get(self._name, 0.0) + ended - begun
        self.memory_MB[self._name] = max(self.memory_MB.get(self._name, 0.0), peak_memory_MB())
        forget_peak()
        self._name, self._at = name, now

    def note(self, _done: float, _total: float, words: str) -> None:
        """As a progress: the first word is the name."""
        self.begin(words.partition(" ")[0])

    def figures(self) -> dict[str, Any]:
        """What was measured; the mesh is made by a child process, whose memory is added."""
        self.begin("")
        if "mesh" in self.memory_MB:
            self.memory_MB["mesh"] += resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024 / 1e6
        return {"wall_s": self.wall_s, "cpu_s": self.cpu_s, "memory_MB": self.memory_MB}


def _clocks() -> tuple[float, float]:
    """Wall and processor time, s."""
    return time.perf_counter(), sum(os.times()[:4])


def _settings() -> ReconstructionSettings:
    return ReconstructionSettings(check_shared_intrinsics=False, threads=1)


def ours_sparse(photos: Path, out: Path) -> dict[str, Any]:
    """Sparse model by `reconstruct`."""
    marks = _Marks()
    request = ReconstructionRequest(until="sparse")
    model = reconstruct(photos, out, _settings(), request=request, progress=marks.note)
    return marks.figures() | {"registered": model.registered_images, "pairs": model.pairs}


def ours_dense(photos: Path, out: Path) -> dict[str, Any]:
    """Dense points and surface of the same model."""
    marks = _Marks()
    model = reconstruct(photos, out, _settings(), progress=marks.note)
    return marks.figures() | {"dense_points": model.dense_points}


def plain_sparse(photos: Path, out: Path) -> dict[str, Any]:
    """Sparse model by pycolmap's own calls: features, all pairs, incremental mapping."""
    settings, marks = _settings(), _Marks()
    out.mkdir(exist_ok=True)
    database = out / f"{photos.name}.db"
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.num_threads, extraction.use_gpu = settings.threads, False
    extraction.sift.max_num_features = settings.max_features
    matching = pycolmap.FeatureMatchingOptions()
    matching.num_threads, matching.use_gpu = settings.threads, False
    mapping = pycolmap.IncrementalPipelineOptions()
    mapping.num_threads = settings.threads
    marks.begin("features")
    pycolmap.extract_features(
        database,
        photos,
        camera_mode=pycolmap.CameraMode.SINGLE,
        extraction_options=extraction,
        device=pycolmap.Device.cpu,
    )
    marks.begin("matches")
    pycolmap.match_exhaustive(database, matching_options=matching, device=pycolmap.Device.cpu)
    marks.begin("mapping")
    models = pycolmap.incremental_mapping(database, photos, out, options=mapping)
    if not models:
        raise StageError("bench photographs: pycolmap made no model")
    most = max(model.num_reg_images() for model in models.values())
    return marks.figures() | {"registered": most}


def _in_a_process(work: Callable[[Path, Path], dict[str, Any]], photos: Path, out: Path) -> dict[str, Any]:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work, photos, out).result()


def pairs_of_many(count: int) -> int:
    """Most pairs that are matched of so many photographs beyond those of which all pairs are."""
    return len(sequence_pairs([str(k) for k in range(count)], SEQUENCE_OVERLAP)) + RETRIEVED_NEIGHBOURS * count


def extrapolated(found: dict[str, dict[str, Any]], many: int = MANY) -> dict[str, Any]:
    """Memory and processor time of 500 photographs from those of the least and the most that were measured.

    `found`: by number of photographs, what the parts returned. Null with a reason for fewer than two numbers.
    """
    keys = (f"memory_{many}_MB", f"cpu_{many}_s", f"pycolmap_memory_{many}_MB", f"pycolmap_cpu_{many}_s")
    if len(found) < 2:
        return dict.fromkeys(keys) | {"why": dict.fromkeys(keys, "needs two numbers of photographs (--photographs)")}
    few, most = min(map(int, found)), max(map(int, found))
    low, high = found[str(few)], found[str(most)]

    def line(part: str) -> float:
        """Of the stage that has most in the end."""
        ends = []
        for stage, b in high[part]["memory_MB"].items():
            a = low[part]["memory_MB"].get(stage, b)
            ends.append(b + max(0.0, b - a) / (most - few) * (many - most))
        return float(max(ends))

    def power(a: float, b: float) -> float:
        return float(b * (many / most) ** max(0.0, math.log(max(b, 1e-9) / max(a, 1e-9)) / math.log(most / few)))

    def cpu(part: str, pairs: int) -> float:
        times = high[part]["cpu_s"]
        each = times["features"] / most * many + times["matches"] / (most * (most - 1) / 2) * pairs
        rest = (sum(t for key, t in one[part]["cpu_s"].items() if key not in ("features", "matches"))
                for one in (low, high))  # fmt: skip
        return float(each + power(*rest))

    def dense_MB() -> float:
        a, b = low["dense"], high["dense"]
        more = b["dense_points"] - a["dense_points"]
        points = min(b["dense_points"] + more / (most - few) * (many - most), MOST_POINTS)
        ends = []
        for stage, memory_MB in b["memory_MB"].items():
            if stage in ("fusion", "mesh"):
                each = max(0.0, memory_MB - a["memory_MB"].get(stage, memory_MB)) / max(more, 1)
                ends.append(memory_MB + each * max(0.0, points - b["dense_points"]))
            else:
                ends.append(memory_MB + 1e-6 * HELD_BYTES + SMALL_MB * (many - most))
        return float(max(ends))

    dense = sum(high["dense"]["cpu_s"].values()) / most * many
    return {
        keys[0]: max(line("sparse"), dense_MB()),
        keys[1]: cpu("sparse", pairs_of_many(many)) + dense,
        keys[2]: line("pycolmap"),
        keys[3]: cpu("pycolmap", many * (many - 1) // 2),
        "why": {},
    }
