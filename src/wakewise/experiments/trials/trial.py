"""One trial in one folder: fly, photograph, reconstruct, evaluate. Each stage leaves files and is skipped when done.

How far the size of a model is from the truth's, and what is left of its error once that is taken out.

A model's scale comes from the vehicle's own estimates of where it was. Where these are off by millimetres for seconds,
the model is too large or too small, and no alignment may mend it; the figures say how much it costs.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import child_path, write_json
from wakewise.core.geometry import matrix_from_quat
from wakewise.core.jit.precompile import compile_kernels, is_warm
from wakewise.core.optional_dependencies import need
from wakewise.core.run_lock import exclusive_run
from wakewise.experiments.trials.coverage import FROM_MODEL, coverage_figures, mapped_figures
from wakewise.experiments.trials.metrics import Figures, MetricsCollector, add_reference_values, comparison
from wakewise.experiments.trials.stages import ProgressListener, SilentProgress, StageCosts, of_the_computer
from wakewise.experiments.trials.surface import SurfaceMaker
from wakewise.operation import BackgroundRenderer, Parts, Scenario, fly_trial, photograph_flight, read_exposures
from wakewise.operation.finding import SURFACE_FILE
from wakewise.operation.flight_log import has_parts
from wakewise.operation.flying import FLIGHT_JOBS, parts_of
from wakewise.operation.teleop.live import collect_flight
from wakewise.operation.teleop.replay import replay_input
from wakewise.operation.trial_folder import BY_HAND, check_place, resolved_scenario, write_or_check_scenario, write_plan
from wakewise.scene.missions import SETTLING
from wakewise.scene.targets import Mesh, MeshDistance, procedural_kinds
from wakewise.vision.evaluation import SWAY_FIGURES, Crop, compare_surface, evaluate_surface, flight_figures
from wakewise.vision.evaluation.alignment import umeyama
from wakewise.vision.evaluation.cloud_to_surface import MeshArrays
from wakewise.vision.reconstruction import read_cloud, read_lens, reconstruct

SIZE_FIGURES = ("scale_error_pct", "rmse_scaled_mm")
SAMPLES = 5_000
"""Samples of the true surface, which the error of the cloud hardly hangs on: they carry the alignment alone."""


def size_figures(
    cloud_W_m: Array,
    mesh: MeshArrays,
    crop: Crop,
    model_centres: Mapping[str, Array],
    true_centres: Mapping[str, Array],
    distance: MeshDistance | None = None,
) -> dict[str, float]:
    """`scale_error_pct` and `rmse_scaled_mm` of a model.

    `cloud_W_m`, shape (n, 3), are the model's points in its own frame; `mesh` and `crop` the truth and what counts of
    it; the centres, shape (3,) each, where each photograph was taken from, by the model in its own frame and in truth.

    Returns by how much the model is too large, from the spread of its camera centres; and `rmse_mm` of the model
    brought to the truth's frame and size by them. Raises InputError if fewer than three photographs are in both, or
    they were taken from one line. Raises StageError if the model so brought does not lie about the truth.
    """
    names = sorted(model_centres.keys() & true_centres.keys())
    if len(names) < 3:
        raise InputError(f"scale: {len(names)} photographs are in model and truth, needs at least 3")
    to_truth = umeyama(np.array([model_centres[n] for n in names]), np.array([true_centres[n] for n in names]))
    score = evaluate_surface(to_truth.apply(cloud_W_m), mesh, crop=crop, samples=SAMPLES, distance=distance)
    return {"scale_error_pct": 100.0 * (1.0 / to_truth.scale - 1.0), "rmse_scaled_mm": score.rmse_mm}


JOBS = (*FLIGHT_JOBS, "photograph", "reconstruct")
"""What is compiled before a trial, if it is not yet: photographs are rendered while the vehicle flies."""

MAIN_SURFACE_FIGURES = (
    "rmse_mm",
    "rmse_cap_mm",
    "accuracy_median_mm",
    "completeness_pct",
    "completeness_visible_pct",
    "completeness_1mm_pct",
    "completeness_2mm_pct",
    "f_score",
)
"""Of a model against the truth, in the order of tables."""
_SURFACE_FIGURES = (
    *MAIN_SURFACE_FIGURES,
    "accuracy_p90_mm",
    "completeness_visible_1mm_pct",
    "completeness_visible_2mm_pct",
    "visible_pct",
    "icp_displacement_mm",
    "icp_matched_pct",
    "outside_pct",
)
_MODEL_FIGURES = ("reprojection_px", "cameras_rmse_mm", "features_per_image", "inlier_matches", "mapping")

FEWEST_PHOTOS = 3
"""A model is put in its place by the estimates of at least as many cameras."""

REGION_SHARE = 1.25
"""What is reconstructed is a little more than the target: estimated cameras put it some millimetres off its place."""


def run_trial(
    flight: Parts | Scenario,
    folder: Path,
    watch: ProgressListener | None = None,
    told: Callable[[Figures], None] | None = None,
    meanwhile: Callable[[str], None] | None = None,
) -> Figures:
    """Run what is left of a trial and return its figures, which are the content of metrics.json.

    `told` is called with the figures as soon as they are there and written, before the mesh and its colours are made.
    With `meanwhile` another process makes them: it is called with "mesh" and with "colours" while that is at work, not
    where they are there already or there is no such process.

    Raises InputError if the scenario cannot be flown, or the folder holds another trial, or another run is at it.
    Raises MissingExtra without the extras `photos` and `logs`. Raises EnvironmentFailure if the disk is full, or a
    file cannot be read or written; the stages before it are kept.
    """
    need("a trial", "photos", "logs")
    watch = watch or SilentProgress()
    parts = parts_of(flight)
    scenario = resolved_scenario(parts)
    check_place(folder, scenario)
    _ = parts.external_parts  # a name that leads nowhere is refused before a kernel is compiled or a folder made
    if not is_warm(JOBS):
        _ = parts.vehicle  # a file that cannot be used is refused before minutes of compiling
        if scenario.target.kind not in procedural_kinds():
            _ = parts.target
        with watch.stage("compile") as progress:
            compile_kernels(JOBS, progress)
    with BackgroundRenderer(parts, folder) as darkroom:
        if not ((folder / "steps.parquet").exists() or has_parts(folder)):
            if not _by_hand(parts):
                darkroom.ready()  # loads and makes its scene while this process looks through the parts
            _ = parts.pilot, parts.preflight
        write_or_check_scenario(folder, scenario)
        with exclusive_run(folder), SurfaceMaker(folder, scenario.reconstruction, parts.target.bed_z_m) as surface:
            modelled = surface.begin if meanwhile is not None else lambda: None
            result = _figures(parts, scenario, folder, watch, darkroom, modelled)
            if told is not None:
                told(result)
            surface.make(watch, meanwhile)
            return result


def _figures(
    parts: Parts,
    scenario: Scenario,
    folder: Path,
    watch: ProgressListener,
    darkroom: BackgroundRenderer,
    modelled: Callable[[], None],
) -> Figures:
    """Run the stages that figures come from and write metrics.json; `modelled` is called when the model is there."""
    stage_costs = StageCosts(folder / "stages.json")

    def stage(name: str, product: str, work: Callable[[Callable[..., None]], None]) -> None:
        if (folder / product).exists():
            watch.skipped(name)
            return
        with watch.stage(name) as progress, stage_costs.account(name):
            work(progress)

    _forget_what_was_not_measured(folder)
    if not has_parts(folder):  # a flight by hand has no plan
        stage("plan", "planned.csv", lambda _: write_plan(parts, folder))
    stage("fly", "steps.parquet", lambda progress: _fly(parts, folder, darkroom, progress))
    stage("photograph", "images.csv", lambda progress: _photograph(parts, folder, darkroom, progress))
    stage("reconstruct", "model.json", lambda progress: reconstruct_trial(parts, folder, progress))
    modelled()
    stage("evaluate", "score.json", lambda _: write_json(folder / "score.json", evaluate_trial(parts, folder)))
    figures = json.loads((folder / "score.json").read_text(encoding="utf-8"))
    gathering = MetricsCollector(figures=figures["figures"], reasons=figures["reasons"])
    gathering.add({"method": scenario.method, "seed": scenario.seed})
    gathering.add({"from_outside": parts.external_parts})
    gathering.add({"wall_s": stage_costs.total("wall_s"), "cpu_s": stage_costs.total("cpu_s")})
    result = gathering.finish()
    write_json(folder / "metrics.json", result)
    return result


def _by_hand(parts: Parts) -> bool:
    return parts.scenario.pilot == BY_HAND and "pilot" not in parts.given


def _fly(parts: Parts, folder: Path, darkroom: BackgroundRenderer, progress: Callable[..., None]) -> None:
    """Fly, or put together what a flight by hand left that was cut off."""
    if collect_flight(parts, folder):
        return
    if _by_hand(parts):
        replay_input(parts, folder)
    else:
        darkroom.ready()
        fly_trial(parts, folder, progress, darkroom.take)


def _photograph(parts: Parts, folder: Path, darkroom: BackgroundRenderer, progress: Callable[..., None]) -> None:
    """Wait for the photographs that were begun during the flight, and render the others."""
    if not (folder / "exposures.npz").exists():
        raise StageError(f"{folder}: no photograph was taken in its flight, so there is nothing to make a model of")
    progress(0, 1, "photographs begun during the flight")
    darkroom.finish()
    photograph_flight(parts, folder, progress)


def compare_methods(
    flights: Mapping[str, Parts | Scenario],
    folder: Path,
    watch: ProgressListener | None = None,
    meanwhile: Callable[[str, str], None] | None = None,
) -> Figures:
    """Run one trial per method, each in its own folder, and set their figures side by side (comparison.json).

    `meanwhile` is that of `run_trial`, with the method's name before.
    """
    folders = {name: child_path(folder, name, "compare") for name in flights}
    for flight in flights.values():  # what does not fit is refused before the first of them flies
        _ = parts_of(flight).preflight
    result = comparison(
        {
            name: run_trial(flight, folders[name], watch, None, None if meanwhile is None else partial(meanwhile, name))
            for name, flight in flights.items()
        }
    )
    write_json(folder / "comparison.json", result)
    return result


def reconstruct_trial(parts: Parts, folder: Path, progress: Callable[..., None]) -> None:
    """Reconstruct from the photographs and the vehicle's own estimates; model.json says how it went.

    Nothing true goes in: pairs, scale and place come from the estimated camera poses, the region from where the target
    was taken to be, the lens from the crew's calibration. A model
    that does not come about is a result too, so its reason is kept instead of its figures. That the disk is full is no
    result.

    Raises EnvironmentFailure if the disk is full, or a file cannot be read or written.
    """
    from wakewise.operation.finding.find_parts import found_region  # needs OpenCV, which flights do without

    photos = pl.read_csv(folder / "images.csv")
    names = photos["name"].to_list()
    centres = photos.select("est_x_m", "est_y_m", "est_z_m").to_numpy()
    if len(names) < FEWEST_PHOTOS:
        failure = f"{len(names)} photographs were taken, at least {FEWEST_PHOTOS} are needed"
        write_json(folder / "model.json", {"figures": {}, "failure": failure})
        return
    surveyed = parts.surveyed_target
    centre_W_m, radius_m = found_region(folder) or (surveyed.centre_W_m, surveyed.radius_m)
    # A patch is photographed from within the ball round it: its depths are those of what each photograph shows.
    region = None if parts.scenario.pilot == "survey" else (centre_W_m, REGION_SHARE * radius_m)
    rotations = matrix_from_quat(photos.select("est_qw", "est_qx", "est_qy", "est_qz").to_numpy())
    try:
        model = reconstruct(
            folder / "images",
            folder,
            # One camera took them all: whether they share a lens, which takes longer than all else, is no question.
            parts.scenario.reconstruction.model_copy(update={"mesh": False, "check_shared_intrinsics": False}),
            lens=read_lens(folder),
            reference_positions=dict(zip(names, centres, strict=True)),
            reference_rotations=dict(zip(names, rotations, strict=True)),
            region=region,
            replace=True,
            progress=progress,
        )
        summary: dict[str, Any] = model.summary()
        write_json(folder / "model.json", {"figures": summary, "failure": None})
    except StageError as fault:
        write_json(folder / "model.json", {"figures": {}, "failure": str(fault)})


def _forget_what_was_not_measured(folder: Path) -> None:
    """Have reconstruction and score done again where model.json holds a full disk as if it had been measured."""
    path = folder / "model.json"
    if path.exists() and of_the_computer(json.loads(path.read_text(encoding="utf-8"))["failure"]):
        (folder / "score.json").unlink(missing_ok=True)
        path.unlink()


def evaluate_trial(parts: Parts, folder: Path) -> dict[str, Any]:
    """Judge flight and model against the truth; what could not be computed gets a reason."""
    gathering = MetricsCollector()
    steps = pl.read_parquet(folder / "steps.parquet")
    flown = steps.filter(pl.col("leg") != SETTLING)
    gathering.add(flight_figures(flown))
    gathering.missing(("exceedance_ambient_pct",), "the water is still without the vehicle")
    add_reference_values(gathering, parts, flown)
    solve_ms = pl.read_parquet(folder / "timings.parquet")["solve_ms"].to_numpy()
    solve_ms = solve_ms[min(50, len(solve_ms) // 2) :]  # the first ones load what later ones find loaded
    gathering.add({"solve_ms_median": float(np.median(solve_ms)), "solve_ms_p99": float(np.percentile(solve_ms, 99))})
    photos = pl.read_csv(folder / "images.csv")
    gathering.add({"images": len(photos)})
    model = json.loads((folder / "model.json").read_text(encoding="utf-8"))
    summary, failure = model["figures"], model["failure"]
    gathering.add({"registered_images": summary.get("registered_images", 0)})
    gathering.add({key: summary.get(key) for key in _MODEL_FIGURES})
    if failure is None:
        try:
            cloud, mesh = read_cloud(folder / "dense.ply").points_m, parts.target.mesh
            distance = MeshDistance(mesh.vertices_m, mesh.faces)
            compared = compare_surface(
                cloud,
                mesh,
                distance=distance,
                crop=Crop(bed_z_m=parts.target.bed_z_m),
                camera_centres_W_m=photos.select("true_x_m", "true_y_m", "true_z_m").to_numpy(),
            )
            gathering.add(_coverage_figures(parts, folder, photos, compared.points_W_m))
            gathering.add({key: getattr(compared.score, key) for key in (*_SURFACE_FIGURES, "success")})
            gathering.add({"rmse_mean_shape_mm": _rmse_mean_shape_mm(parts, folder, cloud)})
            gathering.add(_size(parts, folder, photos, cloud, distance))
        except StageError as fault:
            failure = str(fault)
    if parts.compliance is None:
        gathering.missing((*SWAY_FIGURES, "rmse_mean_shape_mm"), "the target is rigid and held")
    elif failure is not None:
        gathering.missing(("rmse_mean_shape_mm",), f"no model: {failure}")
    if failure is not None:
        gathering.add({"success": False} | _coverage_figures(parts, folder, photos, None))
        gathering.missing((*_SURFACE_FIGURES, *FROM_MODEL, *_MODEL_FIGURES, *SIZE_FIGURES), f"no model: {failure}")
    return {"figures": gathering.figures, "reasons": gathering.reasons}


def _coverage_figures(parts: Parts, folder: Path, photos: pl.DataFrame, cloud_W_m: Array | None) -> dict[str, float]:
    """Figures of the guide by the surface that it had: the mapped one, or that of the surveyed target."""
    if (folder / SURFACE_FILE).is_file():
        return mapped_figures(parts, folder, photos, cloud_W_m)
    return coverage_figures(parts, photos, cloud_W_m)


def _rmse_mean_shape_mm(parts: Parts, folder: Path, cloud: Array) -> float | None:
    """`rmse_mm` against the mean of the shapes that were photographed; None of a target that does not yield."""
    if parts.compliance is None:
        return None
    from wakewise.operation.photography import moved_m

    exposures = read_exposures(folder / "exposures.npz")
    moved = np.mean([moved_m(parts, exposure) for exposure in exposures], axis=0)
    mesh = parts.target.mesh
    score = evaluate_surface(cloud, Mesh(mesh.vertices_m + moved, mesh.faces), crop=Crop(bed_z_m=parts.target.bed_z_m))
    return score.rmse_mm


def _size(parts: Parts, folder: Path, photos: pl.DataFrame, cloud: Array, distance: MeshDistance) -> dict[str, float]:
    """Figures of the model's size; that they could not be computed takes no other figure away."""
    from wakewise.vision.reconstruction.sfm.registered_photos import camera_centres

    true = dict(zip(photos["name"], photos.select("true_x_m", "true_y_m", "true_z_m").to_numpy(), strict=True))
    crop = Crop(bed_z_m=parts.target.bed_z_m)
    with suppress(StageError, InputError):
        return size_figures(cloud, parts.target.mesh, crop, camera_centres(folder / "sparse"), true, distance)
    return {}
