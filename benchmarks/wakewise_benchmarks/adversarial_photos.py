"""Photographs that deceive, twenty and more ways: of each the model is right, or says that it is not.

A row per case: the verdict (`right`, `said`, or `silent`, a wrong model without a warning), how many photographs
found a place, how far the cameras are from where they were, in percent of their spread and after the similarity that
fits best, how far they are turned, and what was said. `right` asks for places within 1 % and turns within 1 deg of
every photograph that was given one, and for no place of a photograph that belongs elsewhere.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, StageError
from wakewise.core.interfaces import no_progress
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.vision.evaluation import umeyama
from wakewise.vision.reconstruction import KnownCameras, Lens, ReconstructionSettings, read_photos
from wakewise.vision.reconstruction.photos.lens_groups import group_photos, known_groups
from wakewise.vision.reconstruction.photos.photo_folder import Image, unsupported_files, without_duplicates
from wakewise.vision.reconstruction.sfm.colmap import pycolmap
from wakewise.vision.reconstruction.sfm.features import match_photos
from wakewise.vision.reconstruction.sfm.mapping import map_photos
from wakewise.vision.reconstruction.sfm.pairs import choose_pairs
from wakewise_benchmarks import adversarial_scenes as scenes
from wakewise_benchmarks.adversarial_scenes import SceneCamera

MOST_OFF_PCT, MOST_TURN_DEG = 1.0, 1.0
SETTINGS = ReconstructionSettings(detector="opencv", max_features=1500, mesh=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class TestPhoto:
    """A photograph and the camera that took it; None where it has no place in the scene that most show."""

    image: Image
    camera: SceneCamera | None


@dataclass(frozen=True, kw_only=True, eq=False)
class AdversarialCase:
    """Photographs by name, what was done to them, and what is handed in beside them."""

    why: str
    shots: Callable[[], list[TestPhoto]]
    references: Callable[[list[TestPhoto]], dict[str, Array]] | None = None
    cameras: Callable[[list[TestPhoto]], KnownCameras] | None = None
    focal_px: float | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class AdversarialResult:
    """What came of a case."""

    why: str
    verdict: str
    photos: int
    registered: int
    off_pct: float | None
    turn_deg: float | None
    said: list[str]
    cpu_s: float


def run(options: BenchOptions) -> dict[str, Any]:
    """A row per case and the number of each verdict; `scenarios` chooses cases by name."""
    names = list(CASES) if options.scenarios is None else list(options.scenarios)
    for name in names:
        if name not in CASES:
            raise InputError(f"case {name!r}: there is none, allowed {', '.join(CASES)}")
    rows = {}
    for done, name in enumerate(names):
        options.progress(done, len(names), name)
        rows[name] = asdict(judge_case(CASES[name]))
    count = {
        verdict: sum(row["verdict"] == verdict for row in rows.values()) for verdict in ("right", "said", "silent")
    }
    return {"cases": rows, **count, "silent_wrongs": count["silent"], "why": _why(rows)}


def _why(rows: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    few, one = "fewer than three photographs have a place", "taken from one place: there is no spread to be off by"
    missing = {name: one if row["registered"] >= 3 else few for name, row in rows.items() if row["off_pct"] is None}
    return {f"cases.{name}.off_pct": reason for name, reason in missing.items()}


def judge_case(case: AdversarialCase) -> AdversarialResult:
    """Make the photographs, and a model of them as `wakewise reconstruct` would; hold it against the truth."""
    begin = time.process_time()
    shots = case.shots()
    names = [f"{k:02d}.png" for k in range(len(shots))]
    with tempfile.TemporaryDirectory(prefix="wakewise-bench-") as scratch:
        folder = Path(scratch) / "photos"
        folder.mkdir()
        for name, shot in zip(names, shots, strict=True):
            (folder / name).write_bytes(cv2.imencode(".png", shot.image)[1].tobytes())
        said: list[str] = []
        placed: dict[str, SceneCamera] = {}
        try:
            said, placed = _model(case, shots, folder, Path(scratch))
        except (StageError, InputError) as fault:
            said = [str(fault)]
    truth = {name: shot.camera for name, shot in zip(names, shots, strict=True) if shot.camera is not None}
    off_pct, turn_deg = _error(placed, truth)
    stranger = any(name not in truth for name in placed)
    right = not stranger and off_pct is not None and off_pct <= MOST_OFF_PCT and (turn_deg or 0.0) <= MOST_TURN_DEG
    return AdversarialResult(
        why=case.why,
        verdict="said" if said else "right" if right else "silent",
        photos=len(shots),
        registered=len(placed),
        off_pct=off_pct,
        turn_deg=turn_deg,
        said=said,
        cpu_s=time.process_time() - begin,
    )


def _model(
    case: AdversarialCase, shots: list[TestPhoto], folder: Path, scratch: Path
) -> tuple[list[str], dict[str, SceneCamera]]:
    """Doubts, and the cameras of the photographs that found a place, in the model's frame."""
    settings = SETTINGS.model_copy(update=dict(case.settings))
    photos, _ = without_duplicates(read_photos(folder))
    assert not unsupported_files(folder)
    names = [photo.name for photo in photos]
    known = None if case.cameras is None else case.cameras(shots)
    poses = None if known is None else {name: (known.rotations[name], known.positions[name]) for name in names}
    groups = group_photos(photos) if known is None else known_groups(photos, known.lenses)
    database = scratch / "database.db"
    match_photos(
        folder,
        photos,
        database,
        settings,
        focal_px=case.focal_px,
        pairs=choose_pairs(names, settings),
        progress=no_progress,
        groups=groups,
        poses=poses,
        may_be_none=known is not None,
    )
    figures = map_photos(
        folder,
        database,
        scratch / "sparse",
        settings,
        photos=len(photos),
        references=None if case.references is None else case.references(shots),
        progress=no_progress,
        fixed=poses,
    )
    found = {}
    for image in pycolmap.Reconstruction(scratch / "sparse").images.values():
        if image.has_pose:
            R_CW = image.cam_from_world().rotation.matrix()
            found[image.name] = SceneCamera(R_WC=R_CW.T, p_WC_m=np.asarray(image.projection_center()))
    return figures["warnings"], found


def _error(placed: Mapping[str, SceneCamera], truth: Mapping[str, SceneCamera]) -> tuple[float | None, float | None]:
    """Places off, rms, in percent of their true spread, and the median turn in degrees, after the similarity.

    None of fewer than three, and where all were taken from one place.
    """
    both = sorted(placed.keys() & truth.keys())
    if len(both) < 3:
        return None, None
    a = np.array([placed[name].p_WC_m for name in both])
    b = np.array([truth[name].p_WC_m for name in both])
    spread = float(np.sqrt(((b - b.mean(axis=0)) ** 2).sum(axis=1).mean()))
    if spread < 1e-6:
        return None, None
    try:
        fit = umeyama(a, b)
        R_AB, moved = fit.R_AB, fit.apply(a)
    except InputError:  # places on a line leave the turn about it open: the mean of the cameras' own turns
        u, _, vt = np.linalg.svd(np.sum([truth[n].R_WC @ placed[n].R_WC.T for n in both], axis=0))
        R_AB = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        size = float(np.sqrt(((a - a.mean(axis=0)) ** 2).sum(axis=1).mean()))
        moved = spread / max(size, 1e-12) * (a - a.mean(axis=0)) @ R_AB.T + b.mean(axis=0)
    off = np.linalg.norm(moved - b, axis=1)
    turns = [
        np.degrees(np.arccos(np.clip(0.5 * (np.trace(truth[n].R_WC.T @ R_AB @ placed[n].R_WC) - 1.0), -1.0, 1.0)))
        for n in both
    ]
    return 100.0 * float(np.sqrt((off**2).mean())) / spread, float(np.median(turns))


def _take(surface: scenes.Surface, cameras: list[SceneCamera]) -> list[TestPhoto]:
    return [TestPhoto(image=scenes.photograph(surface, camera), camera=camera) for camera in cameras]


def _altered(shots: list[TestPhoto], change: Callable[[Image], Image], every: int = 2) -> list[TestPhoto]:
    """Every second photograph (or each) changed."""
    return [
        TestPhoto(image=change(shot.image), camera=shot.camera) if k % every == every - 1 else shot
        for k, shot in enumerate(shots)
    ]


def _plain() -> list[TestPhoto]:
    return _take(scenes.relief(), scenes.over(12))


def _lenses(*focals_px: float) -> list[TestPhoto]:
    cameras = [scenes.over(12, focals_px[k % len(focals_px)])[k] for k in range(12)]
    return _take(scenes.relief(), cameras)


def _two_scenes(first: int, second: int) -> list[TestPhoto]:
    other = _take(scenes.relief(5), scenes.over(second))
    return _take(scenes.relief(), scenes.over(first)) + [TestPhoto(image=shot.image, camera=None) for shot in other]


def _turning() -> list[TestPhoto]:
    """From one place, in twelve directions."""
    eye = np.array([0.0, 0.0, -0.4])
    aims = [np.array([0.02 * (k - 5.5), 0.03 * (k % 3), 0.0]) for k in range(12)]
    return _take(scenes.relief(), [scenes.looking(eye, aim) for aim in aims])


def _straight(step: Array, n: int, surface: scenes.Surface) -> list[TestPhoto]:
    """One after the other along a line, all looking straight down."""
    down = scenes.looking(np.array([0.0, 0.0, -0.4]), np.zeros(3)).R_WC
    centres = [np.array([0.0, 0.0, -0.45]) + (k - (n - 1) / 2) * step for k in range(n)]
    return _take(surface, [SceneCamera(R_WC=down, p_WC_m=centre) for centre in centres])


def _symmetric() -> list[TestPhoto]:
    """Two floors far apart with one texture, photographed alike: they look the same, and are two places."""
    shots = _take(scenes.relief(tile=160), scenes.over(6))
    way = np.array([160 * 0.0007, 0.0, 0.0])
    there = [SceneCamera(R_WC=c.R_WC, p_WC_m=c.p_WC_m + way) for c in scenes.over(6, step_deg=11.0)]
    return shots + _take(scenes.relief(tile=160), there)


def _watermark(image: Image) -> Image:
    """A mask about the picture, as of a housing, with letters on it: it goes with the camera."""
    frame = (40.0 + 200.0 * scenes.photograph(scenes.relief(9), scenes.over(1)[0]) / 255.0).astype(np.uint8)
    keep = np.zeros(image.shape[:2], dtype=bool)
    keep[50:-50, 66:-66] = True
    return np.where(keep[..., None], image, frame)


def _half_sharp(image: Image) -> Image:
    half = image.shape[1] // 2
    return np.concatenate([image[:, :half], scenes.blurred(image, 4.0)[:, half:]], axis=1)


def _off_centre(image: Image) -> Image:
    """A crop of the left, enlarged to the old size."""
    crop = np.ascontiguousarray(image[: image.shape[0] * 3 // 4, : image.shape[1] * 3 // 4])
    return np.asarray(cv2.resize(crop, image.shape[1::-1], interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def _squeezed(image: Image) -> Image:
    """A tenth narrower, and the rest cut off above and below: pixels that are not square."""
    height, width = image.shape[:2]
    narrow = cv2.resize(image, (width, int(height * 1.15)), interpolation=cv2.INTER_CUBIC)
    top = (narrow.shape[0] - height) // 2
    return np.ascontiguousarray(narrow[top : top + height])


def _again(image: Image) -> Image:
    """The same picture saved anew: other bytes."""
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)


def _twice(shots: list[TestPhoto], change: Callable[[Image], Image]) -> list[TestPhoto]:
    return [one for shot in shots for one in (shot, TestPhoto(image=change(shot.image), camera=shot.camera))]


def _rocking() -> list[TestPhoto]:
    """A rock turned on a table before a floor that stays, so that it is not told which of the two moved."""
    shots = []
    for k, camera in enumerate(scenes.over(12)):
        floor = scenes.photograph(scenes.relief(bumps_m=0.0), camera)
        held = scenes.looking(np.array([0.0, 0.05, -0.42 - 0.01 * k]), np.zeros(3))
        rock = scenes.photograph(scenes.rock(), held)
        _, depth = scenes.rock()(np.asarray(held.p_WC_m), held.rays_W())
        shots.append(TestPhoto(image=np.where(depth[..., None] > 0.0, rock, floor), camera=camera))
    return shots


def _places(shots: list[TestPhoto]) -> dict[str, Array]:
    return {f"{k:02d}.png": np.array(s.camera.p_WC_m) for k, s in enumerate(shots) if s.camera is not None}


def _shuffled(shots: list[TestPhoto]) -> dict[str, Array]:
    places = _places(shots)
    order = np.random.default_rng(3).permutation(len(places))
    return {name: list(places.values())[k] for name, k in zip(places, order, strict=True)}


def _known(shots: list[TestPhoto], shift_m: float = 0.0) -> KnownCameras:
    rng = np.random.default_rng(4)
    params = np.array([scenes.FOCAL_PX, scenes.FOCAL_PX, 0.5 * scenes.WIDTH, 0.5 * scenes.HEIGHT, 0.0, 0.0, 0.0, 0.0])
    lens = Lens(width=scenes.WIDTH, height=scenes.HEIGHT, params=params)
    cameras = {f"{k:02d}.png": shot.camera for k, shot in enumerate(shots) if shot.camera is not None}
    return KnownCameras(
        rotations={name: np.array(camera.R_WC) for name, camera in cameras.items()},
        positions={name: camera.p_WC_m + rng.normal(0.0, shift_m, 3) for name, camera in cameras.items()},
        lenses=dict.fromkeys(cameras, lens),
    )


_RELIEF, _PLANE = scenes.relief(), scenes.relief(bumps_m=0.0)
CASES: dict[str, AdversarialCase] = {
    "none": AdversarialCase(why="photographs as they should be", shots=_plain),
    "two-lenses": AdversarialCase(why="every second lens half as long again", shots=lambda: _lenses(300.0, 450.0)),
    "two-near-lenses": AdversarialCase(why="every second lens a tenth longer", shots=lambda: _lenses(300.0, 330.0)),
    "zoom": AdversarialCase(
        why="another focal length in each", shots=lambda: _lenses(*(300.0 + 15.0 * k for k in range(12)))
    ),
    "off-centre-crops": AdversarialCase(
        why="every second cropped to its corner", shots=lambda: _altered(_plain(), _off_centre)
    ),
    "squeezed": AdversarialCase(
        why="pixels of every second are not square", shots=lambda: _altered(_plain(), _squeezed)
    ),
    "two-scenes": AdversarialCase(why="half show something else", shots=lambda: _two_scenes(7, 5)),
    "few-strangers": AdversarialCase(why="three of twelve show something else", shots=lambda: _two_scenes(9, 3)),
    "half-mirrored": AdversarialCase(
        why="every second left for right", shots=lambda: _altered(_plain(), scenes.mirrored)
    ),
    "all-mirrored": AdversarialCase(
        why="all left for right, camera places known",
        shots=lambda: _altered(_plain(), scenes.mirrored, every=1),
        references=_places,
    ),
    "duplicated": AdversarialCase(
        why="each twice, to the byte", shots=lambda: _twice(_plain()[::2], lambda image: image)
    ),
    "saved-anew": AdversarialCase(why="each twice, saved anew", shots=lambda: _twice(_plain()[::2], _again)),
    "half-blurred": AdversarialCase(
        why="every second out of focus", shots=lambda: _altered(_plain(), lambda image: scenes.blurred(image, 4.0))
    ),
    "blurred-halves": AdversarialCase(
        why="the right half of each out of focus", shots=lambda: _altered(_plain(), _half_sharp, 1)
    ),
    "repeated-pattern": AdversarialCase(
        why="a texture that repeats every 45 mm", shots=lambda: _take(scenes.relief(tile=64), scenes.over(12))
    ),
    "one-texture-twice": AdversarialCase(why="two places that look the same", shots=_symmetric),
    "turning-only": AdversarialCase(why="from one place in twelve directions", shots=_turning),
    "planar": AdversarialCase(why="a plane", shots=lambda: _take(_PLANE, scenes.over(12))),
    "planar-straight-down": AdversarialCase(
        why="a plane, from a line, all straight down", shots=lambda: _straight(np.array([0.04, 0.0, 0.0]), 12, _PLANE)
    ),
    "forwards": AdversarialCase(
        why="towards the thing, along the line of sight",
        shots=lambda: _straight(np.array([0.0, 0.0, 0.015]), 12, _RELIEF),
    ),
    "far-apart": AdversarialCase(
        why="a ring of twelve, 30 deg apart", shots=lambda: _take(scenes.rock(), scenes.ring(12))
    ),
    "far-apart-known": AdversarialCase(
        why="the same with cameras that are known",
        shots=lambda: _take(scenes.rock(), scenes.ring(12)),
        cameras=_known,
    ),
    "known-wrongly": AdversarialCase(
        why="cameras given 20 mm off", shots=_plain, cameras=lambda shots: _known(shots, 0.02)
    ),
    "frame-goes-along": AdversarialCase(
        why="a textured frame that goes with the camera", shots=lambda: _altered(_plain(), _watermark, 1)
    ),
    "thing-that-moved": AdversarialCase(why="a rock that moves before a floor that stays", shots=_rocking),
    "names-mixed-up": AdversarialCase(
        why="known places under other photographs' names", shots=_plain, references=_shuffled
    ),
    "wrong-lens-kept": AdversarialCase(
        why="a focal length of 450 px handed in and kept",
        shots=_plain,
        focal_px=450.0,
        settings={"refine_camera": False},
    ),
}
"""By name. `none` shows that a good set is not doubted."""
