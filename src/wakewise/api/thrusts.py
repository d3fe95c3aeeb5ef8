"""One wrench to thrusts, and what thrusts do to the water by a wake model; `wakewise allocate` asks the same."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from wakewise import wake as wakes
from wakewise.allocation import Allocation, Layout, Weights, compile_layout, min_norm_allocation, min_wash_allocation
from wakewise.core.arrays import Array, frozen
from wakewise.core.checks import finite_number, has_methods, instance_of, quoted, whole_number
from wakewise.core.defaults import BUDGET, CHANGE_WEIGHT, DISTURBANCE_WEIGHT, EFFORT_WEIGHT
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import WakeModel
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel, Superposition, wake_model

LARGEST = 1e9
"""In N and N m: larger forces and moments, whose squares overflow sooner or later, are those of no vehicle."""
PoseLike = Pose | Sequence[float] | Array
"""A pose of the body in the world, or its x, y, z (m), roll, pitch, yaw (rad)."""


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
    """The gentlest thrusts for one wrench; without a region, the least ones (pseudo-inverse within limits).

    The cost is that of a flight's allocation: w_disturbance D / (sum of the region's weights) + w_effort |T|^2
    + w_previous |T - T_previous|^2. Defaults of the first two are those of a scenario's `control`.

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
    w_disturbance, w_effort, w_previous : float
        Weights of the mean square speed (per (m/s)^2), of squared thrusts (per N^2, more than 0), and of squared change
        from `previous_N` (per N^2).
    failed : sequence of str or int
        Thrusters that give nothing: names, or places in `thrusts_N`, from 0 as in any Python array.
    superposition : "coherent" or "incoherent"
        How jets that meet add up.
    priority : str, optional
        Which axes to give up last where limits bind, such as "ZKMN,XY".
    budget : int
        Most boxes that branch and bound looks at.

    Returns
    -------
    Allocation
        With `thrusts_N`, shape (m,), `disturbance` D in (m/s)^2, the proven `gap` to the minimum, and what of the
        wrench is not made: `given_up`, by axis, and `scale`. Printed, it is one line.

    Raises
    ------
    InputError
        If something does not belong together, is no finite number, or is a word that is not known.

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
    wrench = _within(frozen(wrench_B, (6,), "wrench_B"), "wrench_B")
    weights = {
        "w_disturbance": finite_number(w_disturbance, "w_disturbance", least=0.0),
        "w_effort": finite_number(w_effort, "w_effort", above=0.0),
        "w_previous": finite_number(w_previous, "w_previous", least=0.0),
    }
    before = (
        None
        if previous_N is None
        else _within(frozen(previous_N, (len(vehicle.thrusters),), "previous_N"), "previous_N")
    )
    whole_number(budget, "budget", 1)
    view = None if region is None else view_of(vehicle, region, wake, superposition)
    X_WB = None if pose is None else pose_of(pose)
    if view is None:
        return min_norm_allocation(layout, wrench, None, priority)
    if X_WB is None:
        raise InputError("pose: is missing, where the region is to be spared the body's pose is needed")
    cost = Weights(
        disturbance=weights["w_disturbance"] / view.total_weight,
        effort=weights["w_effort"],
        previous=weights["w_previous"],
    )
    return min_wash_allocation(layout, wrench, _gram(view, X_WB), cost, before, priority, budget)


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
        If something does not belong together, is no finite number, or is a word that is not known.

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
    return wakes.disturbance(_gram(view, pose_of(pose)), thrusts)


def velocity(
    vehicle: Vehicle, thrusts_N: ArrayLike, pose: PoseLike, points_W_m: ArrayLike, wake: WakeModel | str = "jet"
) -> Array:
    """Velocity of the water that thrusts make at points, by a wake model: the jets of all thrusters, added up.

    Parameters
    ----------
    vehicle : Vehicle
    thrusts_N : array_like, shape (m,)
    pose : Pose or six numbers
        Where the body is.
    points_W_m : array_like, shape (n, 3)
        Places in the world (m).
    wake : WakeModel or str

    Returns
    -------
    ndarray, shape (n, 3)
        In m/s, in the world (north, east, down). The sum of its squares is D of the points (`disturbance`).

    Raises
    ------
    InputError
        If something does not belong together or is no finite number.

    Examples
    --------
    >>> import wakewise as ww
    >>> rov = ww.load_vehicle("bluerov2-heavy")
    >>> astern = ww.allocate(rov, [-5, 0, 0, 0, 0, 0]).thrusts_N
    >>> water = ww.velocity(rov, astern, [0, 0, 1, 0, 0, 0], [[0.8, 0.35, 1.0]])
    >>> water.shape, bool(water[0, 0] > 0.01)  # pushed astern, the jets go ahead
    ((1, 3), True)
    """
    thrusts, X_WB, model = _thrusts(vehicle, thrusts_N), pose_of(pose), _model(wake)
    origins, axes = X_WB.apply(vehicle.thruster_positions_B_m), vehicle.thruster_axes_B @ X_WB.R.T
    points = frozen(points_W_m, (None, 3), "points_W_m")
    return wakes.velocity(model, points, origins, axes, vehicle.disk_areas_m2, thrusts)


def layout_of(vehicle: Vehicle, failed: Sequence[int | str] = ()) -> Layout:
    """Allocation matrix and limits of a vehicle, those of thrusters that failed (names, or places from 0) at zero.

    Raises
    ------
    InputError
        If there is no such thruster.
    """
    lower, upper = _vehicle(vehicle).thrust_lower_N.copy(), vehicle.thrust_upper_N.copy()
    if isinstance(failed, (str, bytes)) or not hasattr(failed, "__iter__"):
        raise InputError(f"failed: {quoted(failed)}, must be a list of thrusters' names or places")
    names = [thruster.name for thruster in vehicle.thrusters]
    for which in failed:
        if isinstance(which, str) and which not in names:
            raise InputError(f"failed: {quoted(which)}: no such thruster, allowed: {', '.join(names)}")
        place = names.index(which) if isinstance(which, str) else whole_number(which, "failed", 0, len(names) - 1)
        lower[place] = upper[place] = 0.0
    return compile_layout(vehicle.allocation_matrix, lower, upper)


def pose_of(pose: PoseLike, name: str = "pose") -> Pose:
    """The pose itself, or that of six numbers.

    Raises
    ------
    InputError
        If these are not six finite numbers, or an angle is beyond a turn, as degrees are.
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
    """What a wake model sees of a region from a vehicle; points that are no region count alike."""
    model = _model(wake)
    if not isinstance(region, Region):
        points = frozen(region, (None, 3), "region")
        region = Region(points_W_m=points, weights=np.ones(len(points)), distance_m=np.zeros(len(points)))
    return InfluenceModel.of(_vehicle(vehicle), region, model, superposition)


def _vehicle(vehicle: Vehicle) -> Vehicle:
    return instance_of(vehicle, Vehicle, "vehicle")


def _within(values: Array, name: str) -> Array:
    worst = float(np.abs(values).max(initial=0.0))
    if worst > LARGEST:
        raise InputError(f"{name}: holds {worst:.3g}, allowed at most {LARGEST:g} N or N m")
    return values


def _model(wake: WakeModel | str) -> WakeModel:
    return wake_model(wake) if isinstance(wake, str) else has_methods(wake, ("unit_velocity",), "wake", "wake model")


def _thrusts(vehicle: Vehicle, thrusts_N: ArrayLike) -> Array:
    return _within(frozen(thrusts_N, (len(_vehicle(vehicle).thrusters),), "thrusts_N"), "thrusts_N")


def _gram(view: InfluenceModel, X_WB: Pose) -> Array:
    """The Gram matrix at a pose; a wake model that answers NaN there is refused."""
    n = len(view.positions_B_m)
    return frozen(view.gram(X_WB), (2 * n, 2 * n), "wake model: its Gram matrix")
