"""A patch of reef in two levels, beside a lawnmower at one height and orbits round everything: path and completeness.

Written down before the figures were known:

- Patches: the project's own (`target.kind: reef`, seeds 0 to `--seeds`), and a real one: 2 x 2 m of the height map
  `coral_mesh/horseshoe_dem_800x800_1cm.npz`, of its squares that with the median surface, where `--data` has it. What
  lies about it is there, too, and falls to the bed over `BORDER_M`; it is not counted.
- `two-level`: the transects and orbits of the preset `reef`. The map by which parts are chosen is the true surface
  where two photographs of the transects show it, off by 4 mm; a flight has its own (`wakewise scan --preset reef`).
- `transects`: its transects alone. `everywhere`: transects, and orbits side by side over the whole patch.
- `lawnmower`: transects alone, at heights and spacings of `DENSER`; the shortest that is as complete as `two-level`,
  to half a point; where none is, the most complete of them. `no_less_m`: path of the shortest that is no less complete
  at all; null where none is.
- Visible is what three photographs of any of these show at less than 78 degrees. Completeness is the share of the
  visible surface that is expected in the model by the coverage of the photographs; of a model (`--models`), that
  within 3 mm of its points. Photographs of models are in clear water, from poses off the plan as a flight's are.
- `cost`: D and a control step by the number of points of the region. `replanned_ms`: thread CPU of choosing orbits.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from wakewise.control import make_controller
from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError, StageError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal, Progress, TargetEstimate
from wakewise.experiments.campaigns.study import selected
from wakewise.experiments.trials.timing import BenchOptions, timed_us
from wakewise.operation import Scenario, load_scenario
from wakewise.operation.finding.find_parts import survey_pilot
from wakewise.operation.finding.survey_mission import OrbitPlanner
from wakewise.operation.parts import Parts, surroundings_of
from wakewise.perception.surface_map import VIEW_CELL_M
from wakewise.perception.target_shape import protected_region, thinned
from wakewise.scene.missions import Coverage, Route, VisibilityCriteria, check_clearance
from wakewise.scene.missions.visibility import SurfacePatches, patches_of, well_visible
from wakewise.scene.targets import Target, place_on_bed
from wakewise.scene.targets.reef import CELL_M, height_map_mesh
from wakewise.vision.evaluation import Crop, compare_surface
from wakewise.vision.reconstruction import read_cloud, reconstruct
from wakewise.wake.disturbance import gram
from wakewise_paper.photo_sets import DOUBT_M, DOUBT_RAD, WANDER_M, WANDER_RAD, PhotoPoses, disturbed, write_photos

PRESET = "reef"
ARMS = ("two-level", "transects", "lawnmower", "everywhere")
REAL, SQUARE = "coral_mesh/horseshoe_dem_800x800_1cm.npz", 200
REAL_WATER = {"tank.size_m": (6.0, 5.0, 3.0), "survey.height_m": 1.5, "imaging.width": 1440, "imaging.height": 1080}
BORDER_M = 0.25
FOOT_M = 0.05
"""Height of the lowest point of the real patch above the bed."""
DENSER = tuple(
    (over, space) for space in (0.5, 0.4, 0.333, 0.25, 0.2, 0.143, 0.1) for over in (0.2, 0.3, 0.4, 0.55, 0.7)
)
"""Height of a lawnmower over the highest point of the patch, and distance of its lines, m."""
SAME_PCT = 0.5
MAP_STD_M = 0.004
VISIBLE = VisibilityCriteria(incidence_rad=math.radians(78.0), pixel_m=0.004)
COVERED = VisibilityCriteria(incidence_rad=math.radians(70.0), support=0.0)
"""Of a whole patch: its samples lie too far apart to tell what surrounds a place."""
LEAST_SHOWN = 3
PATCHES, REACH_M = 1500, 0.003
POINTS = (100, 200, 300, 500, 700, 1000)
ROUNDS = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class Survey:
    """Camera poses of a survey, the way that its camera goes, orbits, and time of choosing these."""

    poses: tuple[Pose, ...]
    path_m: float
    orbits: int = 0
    replanned_ms: float | None = None
    names: str = ""


def run(options: BenchOptions) -> dict[str, Any]:
    """Figures of each patch and arm; models are made for the first patches only, as many as `options.models`."""
    patches: dict[str, tuple[Scenario, Target]] = {}
    for seed in range(min(options.seeds, 10)):
        scenario = load_scenario(PRESET, None, {"target.seed": seed})
        patches[f"reef {seed}"] = (scenario, scenario.parts().target)
    why: dict[str, str] = {}
    if options.data is not None and (options.data / REAL).is_file():
        scenario = load_scenario(PRESET, None, REAL_WATER)
        patches["real"] = (scenario, real_patch(options.data / REAL, scenario.tank.size_m[2]))
    else:
        why["real"] = f"needs {REAL} in --data"
    arms = selected("--methods", options.methods, ARMS)
    told: dict[str, Any] = {}
    with_model = [*(["real"] if "real" in patches else []), *(name for name in patches if name != "real")]
    for name, (scenario, target) in patches.items():
        modelled = arms if name in with_model[: options.models] else ()
        told[name] = patch_figures(scenario, target, modelled, options)
    ratios = {against: [row["path_ratio"][against] for row in told.values()] for against in ("lawnmower", "everywhere")}
    return {
        "patches": told,
        "path_ratio": {
            against: float(np.mean(known)) if (known := [r for r in each if r is not None]) else None
            for against, each in ratios.items()
        },
        "replanned_ms_max": max(row["arms"]["two-level"]["replanned_ms"] for row in told.values()),
        "orbits_min": min(row["arms"]["two-level"]["orbits"] for row in told.values()),
        "cost": region_cost(),
        "why": why,
    }


def real_patch(path: Path, bed_z_m: float) -> Target:
    """The square of the map with the median surface, its lowest point a little above the bed."""
    with np.load(path) as held:
        z = held["z"].astype(np.float64)
    border = round(BORDER_M / CELL_M)
    side = SQUARE + 1 + 2 * border
    squares = [(i, j) for i in range(0, len(z) - side + 1, 50) for j in range(0, z.shape[1] - side + 1, 50)]
    squares.sort(key=lambda at: _area(z[at[0] : at[0] + side, at[1] : at[1] + side][border:-border, border:-border]))
    first, second = squares[len(squares) // 2]
    square = z[first : first + side, second : second + side]
    return place_on_bed("real reef", height_map_mesh(square - square.min() + FOOT_M, CELL_M, BORDER_M), bed_z_m)


def _area(height_m: Array) -> float:
    along, across = np.gradient(height_m, CELL_M)
    return float(np.sqrt(1.0 + along**2 + across**2).mean())


def patch_figures(scenario: Scenario, target: Target, modelled: Sequence[str], options: BenchOptions) -> dict[str, Any]:
    """Path, photographs and completeness of each arm on one patch."""
    parts = scenario.parts().replace(target=target)
    patches = patches_of(target.mesh, target.bed_z_m, PATCHES)
    two, everywhere = surveyed(parts, patches, "chosen"), surveyed(parts, patches, "everywhere")
    alone = surveyed(parts, patches, "none")
    denser = [plan for over, spacing in DENSER if (plan := lawnmower(parts, over, spacing)) is not None]
    best = np.zeros(len(patches.points_W_m), dtype=np.int64)
    for plan in (two, everywhere, denser[-1]):
        best = np.maximum(best, shown_by(plan.poses, patches, parts))
    half = 0.5 * np.array(scenario.survey.size_m)
    visible = (best >= LEAST_SHOWN) & (np.abs(patches.points_W_m[:, :2]) <= half).all(axis=1)

    def complete(plan: Survey) -> float:
        return 100.0 * float(covered_by(plan.poses, patches, parts)[visible].mean())

    asked = complete(two)
    tried = [(plan, complete(plan)) for plan in denser]
    same = [plan for plan, share in tried if share >= asked - SAME_PCT]
    no_less = [plan.path_m for plan, share in tried if share >= asked]
    mower = min(same, key=lambda plan: plan.path_m) if same else max(tried, key=lambda each: each[1])[0]
    plans = {"two-level": two, "transects": alone, "lawnmower": mower, "everywhere": everywhere}
    rows: dict[str, Any] = {}
    for arm, plan in plans.items():
        rows[arm] = {
            "path_m": plan.path_m,
            "photographs": len(plan.poses),
            "orbits": plan.orbits,
            "expected_pct": complete(plan),
            "replanned_ms": plan.replanned_ms,
            "lines": plan.names,
        }
        if arm in modelled:
            seen = patches.points_W_m[visible]
            rows[arm] |= model_figures(scenario, target, plan, seen, options.progress)
    tried_rows = [{"lines": plan.names, "path_m": plan.path_m, "expected_pct": share} for plan, share in tried]
    return {
        "relief_m": float(np.ptp(target.mesh.vertices_m[:, 2])),
        "surface_m2": float(target.mesh.face_areas_m2.sum()),
        "visible_pct": 100.0 * float(visible.mean()),
        "arms": rows,
        "lawnmower_reaches": bool(same),
        "no_less_m": min(no_less, default=None),
        "path_ratio": {
            "lawnmower": two.path_m / mower.path_m,
            "everywhere": two.path_m / everywhere.path_m,
        },
        "lawnmowers": tried_rows,
    }


def surveyed(parts: Parts, patches: SurfacePatches, orbits: str) -> Survey:
    """The preset's survey, its parts chosen by a map as a flight makes one; `orbits` as of `survey.orbits`."""
    parts = parts.replace(**{"survey.orbits": orbits})
    pilot, survey = survey_pilot(parts), parts.scenario.survey
    route = pilot.transects
    poses, path_m = route.X_WC_planned, sum(leg.length_m for leg in route.legs)
    if orbits == "none":
        return Survey(poses=poses, path_m=path_m)
    target = mapped(patches_of(parts.target.mesh, None, PATCHES), poses, parts)
    began = time.thread_time()
    planner = OrbitPlanner(survey=survey, bed_z_m=parts.target.bed_z_m, views=pilot.chooser)
    chosen, more = planner.plan(target, poses, float(poses[0].p_m[2]), route.legs[-1])
    spent_ms = 1e3 * (time.thread_time() - began)
    return Survey(
        poses=(*poses, *more.X_WC_planned),
        path_m=path_m + sum(leg.length_m for leg in more.legs),
        orbits=len(chosen),
        replanned_ms=spent_ms,
    )


def mapped(patches: SurfacePatches, poses: Sequence[Pose], parts: Parts) -> TargetEstimate:
    """The surface where two photographs show it, in cells, off by `MAP_STD_M`, as a flight would have mapped it."""
    need = VisibilityCriteria(incidence_rad=math.radians(75.0), pixel_m=0.003)
    towards, count = np.zeros_like(patches.points_W_m), np.zeros(len(patches.points_W_m), dtype=np.int64)
    for X_WC in poses:
        shown = well_visible(patches, X_WC, parts.camera, need)
        way = X_WC.p_m - patches.points_W_m[shown]
        towards[shown] += way / np.linalg.norm(way, axis=1, keepdims=True)
        count += shown
    known = np.flatnonzero(count >= 2)
    known = known[thinned(patches.points_W_m[known], VIEW_CELL_M)]
    points = patches.points_W_m[known] + np.random.default_rng(0).normal(0.0, MAP_STD_M, (len(known), 3))
    return TargetEstimate(
        time_s=0.0,
        status="tracked",
        centre_W_m=points.mean(axis=0),
        covariance=1e-4 * np.eye(3),
        radius_m=1.0,
        points_W_m=points,
        weights=np.ones(len(points)),
        distance_m=np.zeros(len(points)),
        version=0,
        surface_W_m=points,
        towards_W=towards[known],
    )


def lawnmower(parts: Parts, over_m: float, spacing_m: float) -> Survey | None:
    """Transects alone so high over the highest point; None where the hull would come too near to the relief."""
    height = parts.target.bed_z_m - float(parts.target.mesh.vertices_m[:, 2].min()) + over_m
    changed = parts.replace(**{"survey.height_m": height, "survey.spacing_m": spacing_m, "survey.orbits": "none"})
    route: Route = survey_pilot(changed).transects
    solid, mission = parts.target.mesh.vertices_m, parts.scenario.mission
    try:
        check_clearance(route, parts.aim, parts.vehicle.size_m, changed.bounds, solid, mission.clearance_m)
    except InputError:
        return None
    names = f"{len(route.legs) // 2 + 1} at {height:.2g} m"
    return Survey(poses=route.X_WC_planned, path_m=sum(leg.length_m for leg in route.legs), names=names)


def shown_by(poses: Sequence[Pose], patches: SurfacePatches, parts: Parts) -> IntArray:
    """How many photographs show each sample, shape (n,)."""
    count = np.zeros(len(patches.points_W_m), dtype=np.int64)
    for X_WC in poses:
        count += well_visible(patches, X_WC, parts.camera, VISIBLE)
    return count


def covered_by(poses: Sequence[Pose], patches: SurfacePatches, parts: Parts) -> BoolArray:
    """Which samples the photographs show well, shape (n,)."""
    coverage = Coverage.begin(patches, need=COVERED)
    for X_WC in poses:
        coverage = coverage.seen(X_WC, parts.camera)
    return coverage.covered


def model_figures(
    scenario: Scenario, target: Target, plan: Survey, visible_W_m: Array, progress: Progress
) -> dict[str, Any]:
    """The model of a survey's photographs, held against the truth: one scale, by the poses that the vehicle knows."""
    rng = np.random.default_rng(scenario.seed)
    views = []
    for number, planned in enumerate(plan.poses):
        middle = disturbed(planned, rng, WANDER_M, WANDER_RAD)
        known = disturbed(middle, rng, DOUBT_M, DOUBT_RAD)
        views.append(PhotoPoses(name=f"{number:03d}.png", X_WC=(middle, middle, middle), X_WC_est=known))
    began = time.process_time()
    with tempfile.TemporaryDirectory(prefix="wakewise-bench-") as scratch:
        folder = Path(scratch)
        photos = write_photos(folder, views, None, scenario.imaging, target, seed=scenario.seed, progress=progress)
        settings = scenario.reconstruction.model_copy(update={"mesh": False, "check_shared_intrinsics": False})
        try:
            model = reconstruct(
                photos.folder,
                folder / "model",
                settings,
                focal_px=photos.focal_px,
                reference_positions=photos.references,
                reference_rotations=photos.rotations,
                progress=progress,
            ).summary()
            cloud = read_cloud(folder / "model" / "dense.ply").points_m
            compared = compare_surface(cloud, target.mesh, crop=Crop(bed_z_m=target.bed_z_m))
        except StageError as fault:
            return {"failure": str(fault)}
    away = np.asarray(KDTree(compared.points_W_m).query(visible_W_m)[0])
    return {
        "failure": None,
        "rmse_mm": compared.score.rmse_mm,
        "complete_pct": 100.0 * float((away < REACH_M).mean()),
        "complete_5mm_pct": 100.0 * float((away < 0.005).mean()),
        "registered_images": model["registered_images"],
        "model_cpu_s": time.process_time() - began,
    }


def region_cost() -> dict[str, Any]:
    """Thread CPU by the number of points of a region over a patch: of its Gram matrix, and of a whole control step.

    A line is fitted to the Gram matrix's.
    """
    parts = load_scenario(PRESET, None, {}).parts()
    X_WC = parts.route.X_WC_planned[5]
    seen = parts.target.mesh.vertices_m[::23]
    seen = seen[np.linalg.norm(seen - X_WC.p_m, axis=1) < parts.scenario.perception.view_distance_m]
    X_WB = X_WC @ parts.aim.mount(0.0).inverse()
    vehicle, goal, estimate = parts.vehicle, Goal(X_WB=X_WB), BodyState(X_WB=X_WB)
    origins, axes = X_WB.apply(vehicle.thruster_positions_B_m), vehicle.thruster_axes_B @ X_WB.R.T
    regions = [protected_region(seen, None, points) for points in POINTS]
    controllers = [
        make_controller(
            parts.scenario.method, vehicle, region, parts.wake, parts.control, surroundings_of(parts.scenario)
        )
        for region in regions
    ]
    gram_ms, step_ms = (np.full((ROUNDS, len(POINTS)), np.inf) for _ in range(2))
    for lap in range(ROUNDS):  # in turn, so that what else the machine does meets all of them
        for k, (region, controller) in enumerate(zip(regions, controllers, strict=True)):
            place = region.points_W_m, region.weights / POINTS[k], origins, axes, vehicle.disk_areas_m2
            gram_ms[lap, k] = timed_us(partial(gram, parts.wake, *place), 100)["median_us"] / 1e3
            state = [controller.init()]

            def step(controller: Any = controller, state: list[Any] = state) -> None:
                state[0] = controller.step(state[0], 0.02, estimate, goal)[0]

            step_ms[lap, k] = timed_us(step, 60)["median_us"] / 1e3
    n, ms = np.array(POINTS, dtype=np.float64), gram_ms.min(axis=0)
    slope, offset = np.polyfit(n, ms, 1)
    left = ms - (slope * n + offset)
    return {
        "gram_ms": dict(zip(map(str, POINTS), ms.tolist(), strict=True)),
        "step_ms": dict(zip(map(str, POINTS), step_ms.min(axis=0).tolist(), strict=True)),
        "gram_us_per_point": 1e3 * float(slope),
        "linear_r2": 1.0 - float(left @ left) / max(float(((ms - ms.mean()) ** 2).sum()), 1e-12),
    }


def show_reef(result: Mapping[str, Any]) -> None:
    """A row per patch and arm, then the ratios and what a region costs."""
    import typer

    from wakewise.ui.cli.console import format_value, print_table

    columns = (
        ("path_m", "path m"), ("photographs", "photos"), ("orbits", "orbits"), ("expected_pct", "expected %"),
        ("complete_pct", "complete %"), ("rmse_mm", "RMSE mm"), ("replanned_ms", "replanned ms"), ("lines", "lines"),
    )  # fmt: skip
    rows = [
        (name, arm, *(row.get(key) for key, _ in columns))
        for name, patch in result["patches"].items()
        for arm, row in patch["arms"].items()
    ]
    print_table(
        "tt" + "n" * (len(columns) - 1) + "t", ("patch", "survey", *(head for _, head in columns)), rows, "reef"
    )
    for against, ratio in result["path_ratio"].items():
        typer.echo(f"  path over {against}'s: {format_value(ratio)}")
    for name, patch in result["patches"].items():
        if not patch["lawnmower_reaches"]:
            typer.echo(f"  {name}: no lawnmower is as complete; the most complete one is shown")
        longer = "none" if patch["no_less_m"] is None else f"{patch['no_less_m']:.0f} m"
        typer.echo(f"  {name}: shortest lawnmower that is no less complete: {longer}")
    cost = result["cost"]
    typer.echo(
        f"  a control step at 300 and 1000 points: {format_value(cost['step_ms']['300'])} and "
        f"{format_value(cost['step_ms']['1000'])} ms; D {format_value(cost['gram_us_per_point'])} us a point, linear "
        f"with R2 {format_value(cost['linear_r2'])}"
    )
    for what, reason in result["why"].items():
        typer.echo(f"  {what}: {reason}")
