"""From a finished trial folder to a film: frame by frame, each kept until the film is whole, so that it can go on."""

from __future__ import annotations

import hashlib
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import polars as pl
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid, no_progress
from wakewise.operation import Parts, Scenario, read_exposures, read_scenario
from wakewise.operation.flight_log import ExposureRecord
from wakewise.scene.targets import stony_kinds
from wakewise.ui.film.encode import check_film_name, film_writer
from wakewise.ui.film.external_view import FOV_RAD, ExternalView, choose_viewpoint
from wakewise.ui.film.layout import HEIGHT, VIEWS, WIDTH, FilmFrame, FilmOverview, FrameComposer, View
from wakewise.ui.film.wash import RecordedMotion, Tracers, wash_of
from wakewise.ui.reports import figures
from wakewise.ui.reports.trial import Trial, read_trial
from wakewise.ui.reports.vehicle.hull import hull_of
from wakewise.vision.image_decoding import read_picture
from wakewise.vision.imaging import PinholeCamera

FPS = 12.0
SECONDS = 20.0
LOOK = 1
"""Raised when frames look different, so that frames kept by an older version are not mixed in."""
_TRACK_S = 14.0
_TRACK_RGB, _SHOT_RGB = (235, 243, 240), (255, 150, 105)


def write_film(
    folder: Path,
    out: Path,
    *,
    seconds: float = SECONDS,
    fps: float = FPS,
    view: View = "both",
    progress: Callable[..., None] = no_progress,
) -> Path:
    """Film a trial, and give the film's path.

    Frames are kept in a hidden folder beside the film until it is whole: the same call again goes on where it stopped.

    Raises InputError if the folder is no finished trial, or an option is out of range; StageError if no encoder works.

    Parameters
    ----------
    folder : Path
        A trial folder with scenario.yaml, steps.parquet, exposures.npz, images.csv and images/.
    out : Path
        Ends in .mp4, .webm or .webp.
    seconds : float
        Length of the film; the whole flight is played in it.
    fps : float
        Frames per second.
    view : str
        ``both``, ``outside`` or ``camera``.
    """
    if view not in VIEWS:
        raise InputError(f"--view: '{view}', allowed are {', '.join(VIEWS)}")
    if not 1.0 <= seconds <= 3600.0:
        raise InputError(f"--seconds: {seconds:g}, allowed 1 to 3600")
    if not 1.0 <= fps <= 60.0:
        raise InputError(f"--fps: {fps:g}, allowed 1 to 60")
    check_film_name(out)
    film = _Film(folder, max(2, round(seconds * fps)), fps, view)
    kept = out.parent / f".{out.stem}.frames"
    kept.mkdir(parents=True, exist_ok=True)
    names = [kept / f"{film.key}-{k:05d}.jpg" for k in range(len(film.times_s))]
    missing = [k for k, name in enumerate(names) if not name.exists()]
    if missing:
        film.prepare(kept / "wash.npz", progress)
    for done, k in enumerate(missing):
        progress(done, len(missing), f"frame {k + 1} of {len(names)}")
        _keep(names[k], film.frame(k))
    progress(len(missing), max(len(missing), 1), "writing")
    with film_writer(out, fps, (WIDTH, HEIGHT)) as sink:
        for name in names:
            sink.add(_again(name))
    shutil.rmtree(kept, ignore_errors=True)
    return out


class _Film:
    """Everything that frames of one film share."""

    def __init__(self, folder: Path, count: int, fps: float, view: View) -> None:
        self.folder, self.view = folder, view
        self.trial = read_trial(folder)
        for part in ("scenario.yaml", "steps.parquet", "images.csv"):
            if part in self.trial.missing:
                raise InputError(f"{folder / part}: {self.trial.missing[part]}, a film needs a finished trial")
        self.scenario: Scenario = read_scenario(folder / "scenario.yaml")
        if self.trial.steps is None:
            raise InputError(f"{folder / 'steps.parquet'}: cannot be read, a film needs a finished trial")
        self.steps: pl.DataFrame = self.trial.steps
        self.motion = RecordedMotion.of(self.steps)
        duration_s = float(self.motion.time_s[-1])
        self.times_s: Array = np.linspace(float(self.motion.time_s[0]), duration_s, count)
        self.story = story_of(self.trial, self.scenario, duration_s, duration_s / (count / fps))
        self.page = FrameComposer(self.story, view).scaled_to(
            float(np.nanquantile(np.abs(self.motion.thrusts_N), 0.998))
        )
        digest = hashlib.sha256((folder / "steps.parquet").read_bytes())
        digest.update((folder / "images.csv").read_bytes())
        digest.update(repr((LOOK, count, fps, view)).encode())
        self.key = digest.hexdigest()[:12]
        self._speed = self.trial.column("target_speed_mean_m_s")
        self._turbidity = self.trial.column("turbidity_per_m")
        self._outside: ExternalView | None = None
        self._tracers: list[Tracers] = []
        self._exposures: list[ExposureRecord] = []
        self._photo: tuple[int, NDArray[np.uint8] | None] = (-1, None)

    def prepare(self, wash: Path, progress: Callable[..., None]) -> None:
        """Do what takes time and serves all frames."""
        if self.view == "camera":
            return
        scenario = self.scenario
        progress(0, 1, "building the scene")
        parts = scenario.parts()
        exposures = self.folder / "exposures.npz"
        self._exposures = read_exposures(exposures) if exposures.is_file() else []
        camera = PinholeCamera(*self.page.main_size, FOV_RAD * self.page.main_size[0] / 852.0)
        first = min((shot.time_s for shot in self.trial.photographs), default=0.0)
        self._outside = view_of_flight(parts, camera, self.motion.p_W_m[self.motion.row(first) :])
        self._tracers = wash_of(scenario, self.folder / "steps.parquet", self.times_s, wash, progress)

    def frame(self, k: int) -> NDArray[np.uint8]:
        """Frame `k`, RGB."""
        time_s = float(self.times_s[k])
        row = self.motion.row(time_s)
        shots = [i for i, shot in enumerate(self.trial.photographs) if shot.time_s <= time_s + 1e-6]
        last = shots[-1] if shots else None
        since_s = math.inf if last is None else time_s - self.trial.photographs[last].time_s
        leg = next((name for name, start, stop in self.story.legs if start <= time_s <= stop), "")
        return self.page.frame(
            FilmFrame(
                time_s=time_s,
                leg=leg,
                speed_m_s=_at(self._speed, row),
                turbidity_per_m=_at(self._turbidity, row),
                thrusts_N=self.motion.thrusts_N[row],
                outside=None
                if self._outside is None
                else self._seen_from_outside(self._outside, k, row, last, since_s),
                photo=None if last is None else self._photograph(last),
                shot=last,
                since_shot_s=since_s,
            )
        )

    def _seen_from_outside(
        self, outside: ExternalView, k: int, row: int, last: int | None, since_s: float
    ) -> NDArray[np.uint8]:
        pose = Pose(self.motion.p_W_m[row], self.motion.q_WB[row])
        picture, depth = outside.picture(pose, silt_at(self._exposures, float(self.times_s[k])), self._tracers[k])
        back = self.motion.row(float(self.times_s[k]) - _TRACK_S)
        _track(picture, outside, depth, self.motion.p_W_m[back : row + 1 : 5])
        fresh = 1.0 - since_s / (0.3 * self.story.pace)
        if last is not None and fresh > 0.0:
            shot = self.trial.photographs[last]
            _view_cone(picture, outside, shot.X_WC_true or shot.X_WC_est, self.scenario, fresh)
        return picture

    def _photograph(self, index: int) -> NDArray[np.uint8] | None:
        if self._photo[0] != index:
            image = read_picture(self.trial.photographs[index].path)
            self._photo = (index, None if image is None else np.ascontiguousarray(image[..., ::-1]))
        return self._photo[1]


def view_of_flight(parts: Parts, camera: PinholeCamera, path_W_m: Array) -> ExternalView:
    """The external view that shows the target and a path of the vehicle, shape (n, 3)."""
    radius_m = 0.5 * float(np.linalg.norm(parts.vehicle.size_m))
    X_WC = choose_viewpoint(camera, parts.target.centre_W_m, path_W_m, radius_m)
    lights = parts.scenario.imaging.lights()
    return ExternalView.build(parts.scene, camera, X_WC, hull_of(parts.vehicle), lights, parts.grains)


def story_of(trial: Trial, scenario: Scenario, duration_s: float, pace: float) -> FilmOverview:
    """What every frame of a trial's film says."""
    speed = trial.column("target_speed_mean_m_s")
    steps = trial.steps
    time_s = np.zeros(0) if speed is None or steps is None else steps["time_s"].to_numpy().astype(np.float64)
    kind = scenario.target.kind
    target = f"{kind} coral" if kind in stony_kinds() else Path(kind).stem
    return FilmOverview(
        title=scenario.method,
        subtitle=f"{target}, vehicle {Path(scenario.vehicle).stem}, seed {scenario.seed}",
        duration_s=duration_s,
        pace=pace,
        legs=tuple(figures.legs(trial)),
        time_s=time_s,
        speed_m_s=np.zeros(0) if speed is None else speed,
        shots=tuple((shot.time_s, shot.sharpness) for shot in trial.photographs),
    )


def silt_at(exposures: list[ExposureRecord], time_s: float) -> ScalarGrid | None:
    """Silt between two exposures by straight lines in time; none before the first, the last one's after it."""
    if not exposures:
        return None
    times = np.array([exposure.time_s for exposure in exposures])
    k = int(np.searchsorted(times, time_s))
    if k == 0:
        first = exposures[0].silt
        share = float(np.clip(time_s / times[0], 0.0, 1.0)) if times[0] > 0.0 else 1.0
        return _mixed(first, first, share, 0.0)
    if k == len(times):
        return exposures[-1].silt
    a, b = exposures[k - 1].silt, exposures[k].silt
    share = float((time_s - times[k - 1]) / (times[k] - times[k - 1]))
    return _mixed(a, b, 1 - share, share)


def _mixed(a: ScalarGrid, b: ScalarGrid, of_a: float, of_b: float) -> ScalarGrid:
    """Weighted sum of two grids that lie alike, and of their outer ones."""
    outer = None if a.outer is None or b.outer is None else _mixed(a.outer, b.outer, of_a, of_b)
    return replace(a, values=of_a * a.values + of_b * b.values, outer=outer)


def _at(column: Array | None, row: int) -> float | None:
    return None if column is None or not np.isfinite(column[row]) else float(column[row])


def _track(picture: NDArray[np.uint8], outside: ExternalView, depth_m: NDArray[np.float32], path_W_m: Array) -> None:
    """Draw where the vehicle came from, fading with time, dotted where something hides it."""
    if len(path_W_m) < 2:
        return
    pixels, away = outside.project(path_W_m)
    layer = picture.copy()
    h, w = depth_m.shape
    for i in range(len(pixels) - 1):
        a, b = pixels[i], pixels[i + 1]
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            continue
        x, y = int(np.clip(a[0], 0, w - 1)), int(np.clip(a[1], 0, h - 1))
        if away[i] > depth_m[y, x]:
            continue
        share = ((i + 1) / len(pixels)) ** 1.5
        under = picture[y, x].astype(float)
        colour = (under + 0.75 * share * (np.array(_TRACK_RGB) - under)).tolist()
        cv2.line(layer, _fixed(a), _fixed(b), colour, 2, cv2.LINE_AA, 4)
    picture[:] = layer


def _view_cone(
    picture: NDArray[np.uint8], outside: ExternalView, X_WC: Pose | None, scenario: Scenario, strength: float
) -> None:
    """Draw what the camera sees as a pyramid of light for the moment of the shutter."""
    if X_WC is None:
        return
    imaging = scenario.imaging
    half = math.tan(0.5 * math.radians(imaging.fov_deg))
    reach = 0.6 * scenario.mission.standoff_m
    tall = half * imaging.height / imaging.width
    corners = reach * np.array([[-half, -tall, 1.0], [half, -tall, 1.0], [half, tall, 1.0], [-half, tall, 1.0]])
    pixels, _ = outside.project(X_WC.apply(np.concatenate([np.zeros((1, 3)), corners])))
    if not np.isfinite(pixels).all():
        return
    layer = picture.copy()
    cv2.fillConvexPoly(layer, cv2.convexHull(np.array([_fixed(p) for p in pixels])), (255, 226, 205), cv2.LINE_AA, 4)
    picture[:] = cv2.addWeighted(layer, 0.16 * strength, picture, 1.0 - 0.16 * strength, 0.0)
    layer = picture.copy()
    for k in range(4):
        cv2.line(layer, _fixed(pixels[0]), _fixed(pixels[k + 1]), _SHOT_RGB, 1, cv2.LINE_AA, 4)
        cv2.line(layer, _fixed(pixels[k + 1]), _fixed(pixels[(k + 1) % 4 + 1]), _SHOT_RGB, 2, cv2.LINE_AA, 4)
    picture[:] = cv2.addWeighted(layer, strength, picture, 1.0 - strength, 0.0)


def _fixed(pixel: Array) -> tuple[int, int]:
    """Pixel coordinates with four binary places, as OpenCV's lines take them; its pixel centres are whole numbers."""
    return round(16.0 * float(np.clip(pixel[0] - 0.5, -2000, 4000))), round(
        16.0 * float(np.clip(pixel[1] - 0.5, -2000, 4000))
    )


def _keep(path: Path, frame: NDArray[np.uint8]) -> None:
    with whole_file(path) as temporary:
        jpeg = cv2.imencode(".jpg", np.ascontiguousarray(frame[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 96])[1]
        temporary.write_bytes(jpeg.tobytes())


def _again(path: Path) -> NDArray[np.uint8]:
    image = read_picture(path)
    if image is None:
        path.unlink(missing_ok=True)
        raise InputError(f"{path}: a kept frame cannot be read; run the same command again to draw it anew")
    return np.ascontiguousarray(image[..., ::-1])
