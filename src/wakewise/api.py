"""What `import wakewise` gives beside scenario, parts and flight: whole trials, single questions, things by name.

Thin: each function puts rooms together that do the work, and the command line calls the same ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from wakewise.allocation import Allocation, Weights, compile_layout, gentle_allocation, least_thrusts
from wakewise.arrays import Array, frozen
from wakewise.control import MAKERS
from wakewise.errors import InputError
from wakewise.geometry import Pose, quat_from_euler
from wakewise.interfaces import WakeModel
from wakewise.plugins import names
from wakewise.targets import Region, find_target
from wakewise.wake import Superposition, WakeView, wake_model
from wakewise.wake import disturbance as disturbance_of

if TYPE_CHECKING:
    from wakewise.evaluation import SurfaceScore
    from wakewise.operation import Parts, Scenario
    from wakewise.reconstruction import Model, ReconstructionSettings
    from wakewise.targets import Mesh, Target
    from wakewise.trials import Watch
    from wakewise.vehicles import Vehicle

PoseLike = Pose | Sequence[float] | Array
"""A pose of the body in the world, or its x, y, z (m), roll, pitch, yaw (rad)."""


@dataclass(frozen=True)
class Result:
    """What a trial or a comparison left: its folder, its figures (see docs/conventions.md), its report."""

    folder: Path
    figures: dict[str, Any]
    report: Path


def trial(
    flight: Parts | Scenario,
    folder: str | Path,
    watch: Watch | None = None,
    told: Callable[[dict[str, Any]], None] | None = None,
) -> Result:
    """Fly, photograph, reconstruct, evaluate and report; what is done already is skipped.

    Parameters
    ----------
    flight : Parts or Scenario
    folder : path
        Where everything goes; a trial that was cut off goes on there.
    watch : Watch, optional
        Is told how far each stage is.
    told : callable, optional
        Called with the figures as soon as they are known; mesh and report are made after that.

    Raises
    ------
    InputError
        If the parts do not fit each other, or the folder holds another trial.
    StageError
        If a stage cannot finish.

    Examples
    --------
    >>> import wakewise as ww
    >>> scenario = ww.Scenario.preset("quick", **{"mission.views": [8, 6, 4]})
    >>> ww.trial(scenario, "runs/few")  # doctest: +SKIP
    """
    from wakewise.reports import Draft, begin_report, write_report
    from wakewise.trials import Quiet, run_trial

    watch, place, draft = watch or Quiet(), Path(folder), Draft()
    figures = run_trial(flight, place, watch, told, lambda missing: begin_report(place, draft, missing))
    with watch.stage("report") as progress:
        report = write_report(place, draft)
        progress(1, 1)
    return Result(place, figures, report)


def compare(flights: Mapping[str, Parts | Scenario], folder: str | Path, watch: Watch | None = None) -> Result:
    """One trial for each flight, in its own folder, and their outcomes side by side; ratios are to the first.

    Parameters
    ----------
    flights : mapping
        Name to parts or scenario; the same seed gives all of them the same water.
    folder : path
    watch : Watch, optional

    Raises
    ------
    InputError, StageError
        As `trial`.

    Examples
    --------
    >>> import wakewise as ww
    >>> parts = ww.Scenario.preset("quick").parts()
    >>> flights = {"dp": parts.replace(method="dp"), "ours": parts}
    >>> ww.compare(flights, "runs/both").figures["ratios"]["ours"]  # doctest: +SKIP
    """
    from wakewise.reports import Draft, begin_report, write_comparison, write_report
    from wakewise.trials import Quiet, compare_methods

    if not flights:
        raise InputError("compare: no flights, at least one is needed")
    for name in flights:
        if not name or "/" in name or "\\" in name or name.startswith("."):
            raise InputError(f"compare: '{name}' names a folder, it must hold no separator and not begin with a dot")
    watch, place = watch or Quiet(), Path(folder)
    drafts = {name: Draft() for name in flights}
    figures = compare_methods(
        flights, place, watch, lambda name, lacks: begin_report(place / name, drafts[name], lacks)
    )
    with watch.stage("report") as progress:
        for name in flights:
            write_report(place / name, drafts.pop(name))
        report = write_comparison({name: place / name for name in flights}, place)
        progress(1, 1)
    return Result(place, figures, report)


def allocate(
    vehicle: Vehicle,
    wrench_B: ArrayLike,
    pose: PoseLike | None = None,
    region: Region | ArrayLike | None = None,
    wake: WakeModel | str = "jet",
    *,
    w_effort: float = 1e-3,
    w_previous: float = 0.0,
    previous_N: ArrayLike | None = None,
    failed: Sequence[int] = (),
    superposition: Superposition = "coherent",
    priority: str | None = None,
    budget: int = 2000,
) -> Allocation:
    """The gentlest thrusts for one wrench; without a region, the least ones (pseudo-inverse within limits).

    Parameters
    ----------
    vehicle : Vehicle
    wrench_B : array_like, shape (6,)
        Force (N) and moment (N m) on the body, in its frame.
    pose : Pose or six numbers
        Where the body is.
    region : Region or array_like, shape (n, 3)
        The water to spare: a target's region, or points in the world (m) that count alike.
    wake : WakeModel or str
    w_effort, w_previous : float
        Weights of squared thrusts, and of squared change from `previous_N`, beside D.
    failed : sequence of int
        Thrusters that give nothing, from 0.
    superposition : "coherent" or "incoherent"
        How jets that meet add up.
    priority : str, optional
        Which axes to give up last where limits bind, such as "ZKMN,XY".
    budget : int
        Most boxes that branch and bound looks at.

    Returns
    -------
    Allocation
        With `thrusts_N`, shape (m,), `disturbance` D in (m/s)^2, and the proven `gap` to the minimum.

    Raises
    ------
    InputError
        If something does not belong together or is not finite.

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
    lower, upper = vehicle.thrust_lower_N.copy(), vehicle.thrust_upper_N.copy()
    for i in failed:
        if not 0 <= i < len(lower):
            raise InputError(f"failed: {i}, allowed 0 to {len(lower) - 1}")
        lower[i] = upper[i] = 0.0
    layout = compile_layout(vehicle.allocation_matrix, lower, upper)
    wrench = frozen(wrench_B, (6,), "wrench_B")
    if region is None:
        return least_thrusts(layout, wrench, None, priority)
    if pose is None:
        raise InputError("pose: is missing, where the region is to be spared the body's pose is needed")
    G = _view(vehicle, region, wake, superposition).gram(_pose(pose))
    cost = Weights(disturbance=1.0, effort=w_effort, previous=w_previous)
    before = None if previous_N is None else frozen(previous_N, (len(lower),), "previous_N")
    return gentle_allocation(layout, wrench, G, cost, before, priority, budget)


def disturbance(
    vehicle: Vehicle,
    thrusts_N: ArrayLike,
    pose: PoseLike,
    region: Region | ArrayLike,
    wake: WakeModel | str = "jet",
    *,
    superposition: Superposition = "coherent",
) -> float:
    """Disturbance D of thrusts at a pose, in (m/s)^2: weighted squares of the water's speed, summed over the region.

    Parameters
    ----------
    vehicle : Vehicle
    thrusts_N : array_like, shape (m,)
    pose, region, wake, superposition
        As for `allocate`. Over the sum of the region's weights, D is a mean square speed.

    Raises
    ------
    InputError
        If something does not belong together or is not finite.

    Examples
    --------
    >>> import numpy as np, wakewise as ww
    >>> parts = ww.Scenario.preset("quick").parts()
    >>> X_WB = parts.start.X_WB
    >>> ww.disturbance(parts.vehicle, np.zeros(8), X_WB, parts.region)
    0.0
    """
    thrusts = frozen(thrusts_N, (len(vehicle.thrusters),), "thrusts_N")
    return disturbance_of(_view(vehicle, region, wake, superposition).gram(_pose(pose)), thrusts)


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
    """Photographs to a sparse model, a dense cloud and a mesh (photogrammetry with COLMAP and stereo).

    Parameters
    ----------
    photos, out : path
        Folder of photographs; folder for the model. Stages that are done are skipped.
    settings : ReconstructionSettings, optional
    reference_cameras : path, optional
        Known camera centres (m), which give scale and frame: CSV or COLMAP's images.txt.
    focal_px : float, optional
        Focal length to start from.
    camera : path, optional
        A known lens: folder with COLMAP's cameras.txt.
    region : (centre, radius), optional
        What is wanted, in the frame of the references (m).

    Returns
    -------
    Model
        Its `summary()` holds the figures.

    Raises
    ------
    InputError, StageError
        If photographs or references cannot be used; if too little of them fits together.

    Examples
    --------
    >>> import wakewise as ww
    >>> ww.reconstruct("photos", "runs/photos").summary()["registered_images"]  # doctest: +SKIP
    """
    from wakewise.reconstruction import read_lens, read_reference_cameras
    from wakewise.reconstruction import reconstruct as build

    return build(
        Path(photos),
        Path(out),
        settings,
        focal_px=focal_px,
        lens=None if camera is None else read_lens(Path(camera)),
        reference_positions=None if reference_cameras is None else read_reference_cameras(Path(reference_cameras)),
        region=None if region is None else (frozen(region[0], (3,), "region"), float(region[1])),
    )


def evaluate(
    cloud: str | Path | ArrayLike,
    reference: str | Path | Mesh,
    *,
    bed_z_m: float | None = None,
    camera_centres_m: ArrayLike | None = None,
    icp: bool = True,
) -> SurfaceScore:
    """A cloud against a true surface: accuracy, completeness, F-score.

    Parameters
    ----------
    cloud : path or array_like, shape (n, 3)
        Points in m.
    reference : path or Mesh
        The true surface, in m and in the same frame up to a few millimetres.
    bed_z_m : float, optional
        Depth of the bed: what lies less than 10 mm above it does not count.
    camera_centres_m : array_like, shape (k, 3), optional
        With them the surface that at least three cameras see is judged apart.
    icp : bool
        Move the cloud onto the surface first, rigidly.

    Raises
    ------
    InputError, StageError
        If a file cannot be used; if the cloud is no model of the reference.

    Examples
    --------
    >>> import numpy as np, wakewise as ww
    >>> coral = ww.load_target("brain").mesh
    >>> corners = coral.triangles_m.reshape(-1, 3)
    >>> score = ww.evaluate(corners, coral)
    >>> bool(score.rmse_mm < 0.01)
    True
    """
    from wakewise.evaluation import Crop, evaluate_surface
    from wakewise.reconstruction import read_cloud
    from wakewise.targets import read_mesh

    points = read_cloud(Path(cloud)).points_m if isinstance(cloud, (str, Path)) else frozen(cloud, (None, 3), "cloud")
    mesh = read_mesh(Path(reference)) if isinstance(reference, (str, Path)) else reference
    centres = None if camera_centres_m is None else frozen(camera_centres_m, (None, 3), "camera_centres_m")
    return evaluate_surface(points, mesh, crop=Crop(bed_z_m=bed_z_m), camera_centres_W_m=centres, icp=icp)


def load_target(kind: str, *, bed_z_m: float = 1.5, seed: int = 0, size_m: float | None = None) -> Target:
    """A target standing on the bed: a procedural coral by name, a mesh file, or one from outside.

    Parameters
    ----------
    kind : str
        "branching", "brain", "plate", the path of a mesh file, a plug-in's name, or ``package.module:make``.
    bed_z_m : float
        Depth of the bed.
    seed : int
        Which individual of a procedural one.
    size_m : float, optional
        Scale a mesh file's largest extent to this.

    Raises
    ------
    InputError
        If there is no such target, or its file is not usable.

    Examples
    --------
    >>> import wakewise as ww
    >>> ww.load_target("plate").bed_z_m
    1.5
    """
    return find_target(kind, bed_z_m, seed, size_m)


def methods() -> list[str]:
    """Names of the methods that a scenario may ask for: ours, then those that installed packages offer.

    Examples
    --------
    >>> import wakewise as ww
    >>> "wake-aware" in ww.methods()
    True
    """
    return names("method", MAKERS)


def _pose(pose: PoseLike) -> Pose:
    if isinstance(pose, Pose):
        return pose
    six = frozen(pose, (6,), "pose")
    return Pose(six[:3], quat_from_euler(*(float(angle) for angle in six[3:])))


def _view(
    vehicle: Vehicle, region: Region | ArrayLike, wake: WakeModel | str, superposition: Superposition
) -> WakeView:
    model = wake_model(wake) if isinstance(wake, str) else wake
    if not isinstance(region, Region):
        points = frozen(region, (None, 3), "region")
        region = Region(points_W_m=points, weights=np.ones(len(points)), distance_m=np.zeros(len(points)))
    return WakeView.of(vehicle, region, model, superposition)
