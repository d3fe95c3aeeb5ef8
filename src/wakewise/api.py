"""Functional interface of the package: trials, allocation of one wrench, photogrammetry, and objects by name.

The command line calls the same functions. They check their arguments and call the packages that do the work.

`trial`, `compare`: fly, photograph, reconstruct, evaluate and report.
`allocate`, `disturbance`, `velocity`: control allocation of one wrench; wake of the thrusts at a pose.
`reconstruct`, `evaluate`: photographs to a model; a point cloud against the true surface.
`load_target`, `methods`: targets and control methods by name.

The module is long because each function checks its arguments and states them in full.
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from wakewise import wake as wake_models
from wakewise.allocation import Allocation, Layout, Weights, compile_layout, min_norm_allocation, min_wash_allocation
from wakewise.control import MAKERS
from wakewise.core.arrays import Array, frozen
from wakewise.core.checks import (
    boolean,
    callable_of,
    finite_number,
    has_methods,
    instance_of,
    path_of,
    quoted,
    whole_number,
)
from wakewise.core.defaults import BUDGET, CHANGE_WEIGHT, DISTURBANCE_WEIGHT, EFFORT_WEIGHT
from wakewise.core.errors import InputError
from wakewise.core.files import child_path
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import WakeModel
from wakewise.core.optional_dependencies import need
from wakewise.core.plugins import names
from wakewise.core.settings import seed_number
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region, find_target, is_mesh_file
from wakewise.wake import InfluenceModel, Superposition, wake_model

if TYPE_CHECKING:
    from wakewise.experiments.trials import ProgressListener
    from wakewise.operation import Parts, Scenario
    from wakewise.scene.targets import Mesh, Target
    from wakewise.vision.evaluation import SurfaceScore
    from wakewise.vision.reconstruction import Model, ReconstructionSettings

log = logging.getLogger(__name__)

MAX_WRENCH = 1e9
"""Largest force (N), moment (N m) or thrust (N) that is accepted; squares of larger numbers may overflow."""
PoseLike = Pose | Sequence[float] | Array
"""Pose of the body in the world frame, or its x, y, z (m), roll, pitch, yaw (rad)."""
_EXTRAS = ("photos", "reports", "logs")


@dataclass(frozen=True)
class Result:
    """Output of a trial or comparison.

    `figures`: content of metrics.json or comparison.json (docs/conventions.md). `report`: path of the page; None if it
    could not be written, for the reason in `report_fault`.
    """

    folder: Path
    figures: dict[str, Any]
    report: Path | None
    report_fault: str | None = None


def trial(
    flight: Parts | Scenario,
    folder: str | Path,
    progress: ProgressListener | None = None,
    on_figures: Callable[[dict[str, Any]], None] | None = None,
) -> Result:
    """Fly, photograph, reconstruct, evaluate and report one trial.

    Stages that are complete in `folder` are skipped, so an interrupted trial continues. `on_figures` is called with the
    figures as soon as they are written, before the mesh and the report are made.

    Raises
    ------
    InputError
        If the parts do not fit each other, or the folder holds another trial.
    StageError
        If a stage cannot finish.
    MissingExtra
        Without the extras `photos`, `reports` and `logs`; checked before anything is written.

    Examples
    --------
    >>> import wakewise as ww
    >>> scenario = ww.Scenario.preset("quick", **{"mission.views": [8, 6, 4]})
    >>> ww.trial(scenario, "runs/few")  # doctest: +SKIP
    """
    need("ww.trial", *_EXTRAS)
    from wakewise.experiments.trials import run_trial
    from wakewise.ui.reports import PageParts, begin_report, write_report

    path, draft = path_of(folder, "folder"), PageParts()
    listener = _listener(progress)
    if on_figures is not None:
        callable_of(on_figures, "on_figures")
    begin = _without_raising(lambda missing: begin_report(path, draft, missing))
    figures = run_trial(flight, path, listener, on_figures, begin)
    return _reported(path, figures, listener, lambda: write_report(path, draft))


def compare(
    flights: Mapping[str, Parts | Scenario], folder: str | Path, progress: ProgressListener | None = None
) -> Result:
    """Run one trial per flight, each in its own folder, and compare their figures.

    Ratios are relative to the first flight. Flights with the same seed have the same water.

    Raises
    ------
    InputError, StageError, MissingExtra
        As `trial`.

    Examples
    --------
    >>> import wakewise as ww
    >>> parts = ww.Scenario.preset("quick").parts()
    >>> flights = {"dp": parts.replace(method="dp"), "ours": parts}
    >>> ww.compare(flights, "runs/both").figures["ratios"]["ours"]  # doctest: +SKIP
    """
    need("ww.compare", *_EXTRAS)
    from wakewise.experiments.trials import compare_methods
    from wakewise.ui.reports import PageParts, begin_report, write_comparison, write_report

    if not isinstance(flights, Mapping):
        raise InputError(f"flights: {quoted(flights)}, must be names with parts or scenarios")
    if len(flights) < 2:
        raise InputError(f"compare: {len(flights)} flights, at least two are needed to compare; one alone is a `trial`")
    path = path_of(folder, "folder")
    for name in flights:
        if not isinstance(name, str):
            raise InputError(f"flights: {quoted(name)}, must be a name")
        child_path(path, name, "compare")
    listener = _listener(progress)
    drafts = {name: PageParts() for name in flights}
    begin = _without_raising(lambda name, missing: begin_report(path / name, drafts[name], missing))
    figures = compare_methods(flights, path, listener, begin)

    def write() -> Path:
        for name in flights:
            write_report(path / name, drafts.pop(name))
        return write_comparison({name: path / name for name in flights}, path)

    return _reported(path, figures, listener, write)


def _listener(progress: ProgressListener | None) -> ProgressListener:
    from wakewise.experiments.trials import SilentProgress

    return SilentProgress() if progress is None else has_methods(progress, ("stage",), "progress", "progress listener")


def _reported(folder: Path, figures: dict[str, Any], listener: ProgressListener, write: Callable[[], Path]) -> Result:
    """The result with its report; a report that fails costs only the page."""
    from wakewise.experiments.trials.stages import report_attempt

    report = None
    with report_attempt() as attempt, listener.stage("report") as advance:
        report = write()
        advance(1, 1)
    return Result(folder, figures, report, attempt.fault)


def _without_raising(begin: Callable[..., None]) -> Callable[..., None]:
    """Wrap the early parts of a report: a fault there must not end the trial; `write_report` meets it again."""
    from wakewise.experiments.trials.stages import report_attempt

    def parts(*given: str) -> None:
        with report_attempt():
            begin(*given)

    return parts


def allocate(
    vehicle: Vehicle,
    wrench_B: ArrayLike,
    pose: PoseLike | None = None,
    region: Region | ArrayLike | None = None,
    wake: WakeModel | str = "jet",
    *,
    w_disturbance: float = DISTURBANCE_WEIGHT,
    w_effort: float = EFFORT_WEIGHT,
    w_previous: float = CHANGE_WEIGHT,
    previous_N: ArrayLike | None = None,
    failed: Sequence[int | str] = (),
    superposition: Superposition = "coherent",
    priority: str | None = None,
    budget: int = BUDGET,
) -> Allocation:
    """Control allocation of one wrench with minimum wash at a region; minimum norm without a region.

    The cost is that of a flight: w_disturbance D / (sum of the region's weights) + w_effort |T|^2
    + w_previous |T - T_previous|^2, with D in (m/s)^2 and T in N. The defaults of the first two weights are those of a
    scenario's `control`.

    Parameters
    ----------
    wrench_B : array_like, shape (6,)
        Force (N) and moment (N m) on the body, in the body frame.
    region : Region or array_like, shape (n, 3)
        The region of a target, or points in the world frame (m) of equal weight.
    failed : sequence
        Thrusters without thrust: names, or indices into `thrusts_N`.
    superposition : "coherent" or "incoherent"
        How overlapping jets add: velocities or squares.
    priority : str, optional
        Order in which axes are kept where limits bind, such as "ZKMN,XY".
    budget : int
        Maximum number of boxes of the branch and bound search.

    Returns
    -------
    Allocation
        `thrusts_N`, shape (m,); `disturbance` D in (m/s)^2; `gap`, the proven distance to the minimum; `given_up` and
        `scale`, the part of the wrench that is not produced.

    Raises
    ------
    InputError
        If shapes do not match, a number is not finite, or a word is unknown.

    Examples
    --------
    >>> import wakewise as ww
    >>> rov = ww.load_vehicle("bluerov2-heavy")
    >>> points = [[0.6, 0.3, 1.0], [0.6, -0.3, 1.0]]
    >>> gentle = ww.allocate(rov, [-5, 0, 2, 0, 0, 0], [0, 0, 1, 0, 0, 0], points)
    >>> least = ww.allocate(rov, [-5, 0, 2, 0, 0, 0])
    >>> before = ww.disturbance(rov, least.thrusts_N, [0, 0, 1, 0, 0, 0], points)
    >>> gentle.disturbance < 0.3 * before
    True
    """
    layout = layout_of(vehicle, failed)
    wrench = _bounded(frozen(wrench_B, (6,), "wrench_B"), "wrench_B")
    w_disturbance = finite_number(w_disturbance, "w_disturbance", least=0.0)
    w_effort = finite_number(w_effort, "w_effort", above=0.0)
    w_previous = finite_number(w_previous, "w_previous", least=0.0)
    shape = (len(vehicle.thrusters),)
    previous = None if previous_N is None else _bounded(frozen(previous_N, shape, "previous_N"), "previous_N")
    whole_number(budget, "budget", 1)
    view = None if region is None else view_of(vehicle, region, wake, superposition)
    X_WB = None if pose is None else pose_of(pose)
    if view is None:
        return min_norm_allocation(layout, wrench, None, priority)
    if X_WB is None:
        raise InputError("pose: is missing; with a region the pose of the body is needed")
    cost = Weights(disturbance=w_disturbance / view.total_weight, effort=w_effort, previous=w_previous)
    return min_wash_allocation(layout, wrench, _gram(view, X_WB), cost, previous, priority, budget)


def disturbance(
    vehicle: Vehicle,
    thrusts_N: ArrayLike,
    pose: PoseLike,
    region: Region | ArrayLike,
    wake: WakeModel | str = "jet",
    *,
    superposition: Superposition = "coherent",
) -> float:
    """Disturbance D of thrusts at a pose: weighted sum over the region of the squared water speed, in (m/s)^2.

    Divided by the sum of the region's weights, D is a mean square speed. Arguments are those of `allocate`.

    Raises
    ------
    InputError
        If shapes do not match, a number is not finite, or a word is unknown.

    Examples
    --------
    >>> import numpy as np, wakewise as ww
    >>> parts = ww.Scenario.preset("quick").parts()
    >>> X_WB = parts.start.X_WB
    >>> ww.disturbance(parts.vehicle, np.zeros(8), X_WB, parts.region)
    0.0
    """
    thrusts = _thrusts(vehicle, thrusts_N)
    view = view_of(vehicle, region, wake, superposition)
    return wake_models.disturbance(_gram(view, pose_of(pose)), thrusts)


def velocity(
    vehicle: Vehicle, thrusts_N: ArrayLike, pose: PoseLike, points_W_m: ArrayLike, wake: WakeModel | str = "jet"
) -> Array:
    """Water velocity of all jets at points of shape (n, 3): m/s in the world frame (north, east, down), shape (n, 3).

    The sum of the squares is the disturbance D of the points with weight 1 (`disturbance`). Thrusts beyond the
    vehicle's limits are logged as a warning.

    Raises
    ------
    InputError
        If shapes do not match or a number is not finite.

    Examples
    --------
    >>> import wakewise as ww
    >>> rov = ww.load_vehicle("bluerov2-heavy")
    >>> astern = ww.allocate(rov, [-5, 0, 0, 0, 0, 0]).thrusts_N
    >>> water = ww.velocity(rov, astern, [0, 0, 1, 0, 0, 0], [[0.8, 0.35, 1.0]])
    >>> water.shape, bool(water[0, 0] > 0.01)  # thrust astern, jets ahead
    ((1, 3), True)
    """
    thrusts, X_WB, model = _thrusts(vehicle, thrusts_N), pose_of(pose), _model(wake)
    origins, axes = X_WB.apply(vehicle.thruster_positions_B_m), vehicle.thruster_axes_B @ X_WB.R.T
    points = frozen(points_W_m, (None, 3), "points_W_m")
    return wake_models.velocity(model, points, origins, axes, vehicle.disk_areas_m2, thrusts)


def layout_of(vehicle: Vehicle, failed: Sequence[int | str] = ()) -> Layout:
    """Allocation matrix and thrust limits of a vehicle; limits of `failed` thrusters (names or indices) are zero.

    Raises
    ------
    InputError
        If there is no such thruster.
    """
    lower, upper = _vehicle(vehicle).thrust_lower_N.copy(), vehicle.thrust_upper_N.copy()
    if isinstance(failed, (str, bytes)) or not hasattr(failed, "__iter__") or getattr(failed, "ndim", 1) == 0:
        raise InputError(f"failed: {quoted(failed)}, must be a list of thrusters' names or places")
    known = [thruster.name for thruster in vehicle.thrusters]
    for which in failed:
        if isinstance(which, str) and which not in known:
            raise InputError(f"failed: {quoted(which)}: no such thruster, allowed: {', '.join(known)}")
        index = known.index(which) if isinstance(which, str) else whole_number(which, "failed", 0, len(known) - 1)
        lower[index] = upper[index] = 0.0
    return compile_layout(vehicle.allocation_matrix, lower, upper)


def pose_of(pose: PoseLike, name: str = "pose") -> Pose:
    """Pose of x, y, z (m), roll, pitch, yaw (rad); a `Pose` is returned as it is.

    Raises
    ------
    InputError
        If these are not six finite numbers, or an angle exceeds 2 pi, as degrees do.
    """
    if isinstance(pose, Pose):
        return pose
    six = frozen(pose, (6,), name)
    if np.abs(six[3:]).max() > 2.0 * math.pi:
        angles = " ".join(f"{angle:g}" for angle in six[3:])
        raise InputError(f"{name}: angles {angles}, allowed radians up to 2 pi (are these degrees?)")
    return Pose(six[:3], quat_from_euler(*(float(angle) for angle in six[3:])))


def view_of(
    vehicle: Vehicle, region: Region | ArrayLike, wake: WakeModel | str, superposition: Superposition
) -> InfluenceModel:
    """Influence of the thrusters on a region by a wake model; points without weights have weight 1."""
    model = _model(wake)
    if not isinstance(region, Region):
        points = frozen(region, (None, 3), "region")
        region = Region(points_W_m=points, weights=np.ones(len(points)), distance_m=np.zeros(len(points)))
    return InfluenceModel.of(_vehicle(vehicle), region, model, superposition)


def _vehicle(vehicle: Vehicle) -> Vehicle:
    return instance_of(vehicle, Vehicle, "vehicle")


def _bounded(values: Array, name: str) -> Array:
    largest = float(np.abs(values).max(initial=0.0))
    if largest > MAX_WRENCH:
        raise InputError(f"{name}: holds {largest:.3g}, allowed at most {MAX_WRENCH:g} N or N m")
    return values


def _model(wake: WakeModel | str) -> WakeModel:
    return wake_model(wake) if isinstance(wake, str) else has_methods(wake, ("unit_velocity",), "wake", "wake model")


def _thrusts(vehicle: Vehicle, thrusts_N: ArrayLike) -> Array:
    thrusts = _bounded(frozen(thrusts_N, (len(_vehicle(vehicle).thrusters),), "thrusts_N"), "thrusts_N")
    lower, upper = vehicle.thrust_lower_N, vehicle.thrust_upper_N
    for k in np.flatnonzero((thrusts < lower - 1e-6) | (thrusts > upper + 1e-6))[:1]:  # less is rounding
        log.warning("thrusts_N: %s %g N, allowed %g to %g", vehicle.thrusters[k].name, thrusts[k], lower[k], upper[k])
    return thrusts


def _gram(view: InfluenceModel, X_WB: Pose) -> Array:
    """Gram matrix at a pose, shape (2 n, 2 n); NaN of a wake model is refused."""
    n = len(view.positions_B_m)
    return frozen(view.gram(X_WB), (2 * n, 2 * n), "wake model: its Gram matrix")


def reconstruct(
    photos: str | Path,
    out: str | Path,
    *,
    settings: ReconstructionSettings | None = None,
    reference_cameras: str | Path | None = None,
    focal_px: float | None = None,
    camera: str | Path | None = None,
    region: tuple[ArrayLike, float] | None = None,
) -> Model:
    """Photogrammetry with COLMAP and stereo: a folder of photographs to a sparse model, a dense cloud and a mesh.

    Stages that are complete in `out` are skipped. `Model.summary()` holds the figures.

    Parameters
    ----------
    reference_cameras : path, optional
        Known camera centres (m), which give scale and frame: CSV or COLMAP's images.txt.
    focal_px : float, optional
        Initial focal length in pixels.
    camera : path, optional
        Folder with the known lens, COLMAP's cameras.txt.
    region : (centre, radius), optional
        Sphere to reconstruct, in the frame of the references (m).

    Raises
    ------
    InputError, StageError
        If photographs or references cannot be used; if too few of them match.

    Examples
    --------
    >>> import wakewise as ww
    >>> ww.reconstruct("photos", "runs/photos").summary()["registered_images"]  # doctest: +SKIP
    """
    need("ww.reconstruct", "photos")
    from wakewise.vision.reconstruction import ReconstructionSettings, read_lens, read_reference_cameras
    from wakewise.vision.reconstruction import reconstruct as run_reconstruction

    if region is not None and (not isinstance(region, (tuple, list)) or len(region) != 2):
        raise InputError(f"region: {quoted(region)}, must be a centre and a radius, ((x, y, z), r) in m")
    sphere = None if region is None else (frozen(region[0], (3,), "region"), finite_number(region[1], "region", 0.0))
    photo_folder, model_folder = path_of(photos, "photos"), path_of(out, "out")
    lens = None if camera is None else path_of(camera, "camera")
    references = None if reference_cameras is None else path_of(reference_cameras, "reference_cameras")
    return run_reconstruction(
        photo_folder,
        model_folder,
        None if settings is None else instance_of(settings, ReconstructionSettings, "settings"),
        focal_px=None if focal_px is None else finite_number(focal_px, "focal_px", above=0.0),
        lens=None if lens is None else read_lens(lens),
        reference_positions=None if references is None else read_reference_cameras(references),
        region=sphere,
    )


def evaluate(
    cloud: str | Path | ArrayLike,
    reference: str | Path | Mesh,
    *,
    bed_z_m: float | None = None,
    camera_centres_m: ArrayLike | None = None,
    icp: bool = True,
) -> SurfaceScore:
    """Accuracy, completeness and F-score of a point cloud of shape (n, 3) in m against a true surface.

    The reference is in m and in the frame of the cloud up to a few millimetres; `icp` aligns the cloud rigidly first.
    Points less than 10 mm above `bed_z_m` do not count. With `camera_centres_m`, shape (k, 3), the surface that at
    least three cameras see is evaluated separately.

    Raises
    ------
    InputError, StageError
        If a file cannot be used; if the cloud does not resemble the reference.

    Examples
    --------
    >>> import numpy as np, wakewise as ww
    >>> coral = ww.load_target("brain").mesh
    >>> corners = coral.triangles_m.reshape(-1, 3)
    >>> score = ww.evaluate(corners, coral)
    >>> bool(score.rmse_mm < 0.01)
    True
    """
    need("ww.evaluate", "photos", only=("embreex", "small_gicp"))
    from wakewise.scene.targets import Mesh, read_mesh
    from wakewise.vision.evaluation import Crop, evaluate_surface
    from wakewise.vision.reconstruction import read_cloud

    icp = boolean(icp, "icp")
    if isinstance(cloud, (str, os.PathLike)):
        points = read_cloud(path_of(cloud, "cloud")).points_m
    else:
        points = frozen(cloud, (None, 3), "cloud")
    bed = None if bed_z_m is None else finite_number(bed_z_m, "bed_z_m")
    if isinstance(reference, (str, os.PathLike)):
        mesh = read_mesh(path_of(reference, "reference"))
    else:
        mesh = instance_of(reference, Mesh, "reference")
    centres = None if camera_centres_m is None else frozen(camera_centres_m, (None, 3), "camera_centres_m")
    return evaluate_surface(points, mesh, crop=Crop(bed_z_m=bed), camera_centres_W_m=centres, icp=icp)


def load_target(kind: str | Path, *, bed_z_m: float = 1.5, seed: int = 0, size_m: float | None = None) -> Target:
    """Target on the bed at depth `bed_z_m` (> 0): a procedural coral, a mesh file, a plug-in, or `package.module:make`.

    `seed` selects the individual of a procedural target. `size_m` scales the largest extent of a mesh file.

    Raises
    ------
    InputError
        If there is no such target, or its file cannot be used.

    Examples
    --------
    >>> import wakewise as ww
    >>> ww.load_target("plate").bed_z_m
    1.5
    """
    if seed_number(seed) != 0 and is_mesh_file(kind):
        raise InputError(f"seed: {seed}, a mesh file has only one individual, leave it out")
    return find_target(kind, bed_z_m, seed, size_m)


def methods() -> list[str]:
    """Names of the control methods of a scenario: those of this package, then those of installed plug-ins.

    Examples
    --------
    >>> import wakewise as ww
    >>> "wake-aware" in ww.methods()
    True
    """
    return names("method", MAKERS)
