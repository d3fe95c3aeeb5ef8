"""The truth flow at any points, for a vehicle held in place and given thrusts, to be held against other flows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.constants import TRIM_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Mesh, Target
from wakewise.simulation.lattice import LatticeFlow, MeanField, load_mean_field
from wakewise.simulation.tank.contact import CollisionGeometry
from wakewise.simulation.tank.probe_tables import ThrustHistory
from wakewise.simulation.water.blockage import Blockage
from wakewise.simulation.water.round_jet_closure import PLAIN, SWIRLING
from wakewise.simulation.water.water import Water

FLOWS = ("parcels", "lattice")
_STEP_S = 0.02
_MOST_VALUES = 50_000_000
_MOST_PARCELS = 16384
_SURFACE_AWAY_M = 20.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ProbeResult:
    """Velocities of the water, shape (k, n, 3), at times, shape (k,), and points, shape (n, 3), in the world.

    `known`, shape (k, n), says where the flow says anything; where it does not, velocities are zeros without meaning.
    """

    times_s: Array
    points_W_m: Array
    velocities_m_s: Array
    known: BoolArray

    def __post_init__(self) -> None:
        k, n = len(self.times_s), len(self.points_W_m)
        freeze(self, times_s=(k,), points_W_m=(n, 3), velocities_m_s=(k, n, 3))
        known = np.array(self.known, dtype=np.bool_)
        if known.shape != (k, n):
            raise InputError(f"known: shape {known.shape}, allowed ({k}, {n})")
        known.setflags(write=False)
        object.__setattr__(self, "known", known)

    @property
    def speeds_m_s(self) -> Array:
        """Shape (k, n); zero where nothing is known."""
        speeds: Array = np.linalg.norm(self.velocities_m_s, axis=2)
        return speeds


def probe(
    vehicle: Vehicle,
    X_WB: Pose,
    history: ThrustHistory,
    points_W_m: Array,
    *,
    times_s: Array | None = None,
    floor_z_m: float | None = None,
    target: Target | None = None,
    flow: str = "parcels",
    turbulence: float = 0.0,
    swirl: bool = False,
    density_kg_m3: float = TRIM_WATER_KG_M3,
    seed: int = 0,
) -> ProbeResult:
    """Find the flow of a vehicle that is held at one pose while its thrusters push as told, in water at rest before.

    Thrusts are what the thrusters give: there is no lag, no limit and no loss. Water is without walls and surface;
    the floor is a plane through which nothing flows and along which jets that strike it run out.

    Parameters
    ----------
    vehicle : Vehicle
    X_WB : Pose
    history : ThrustHistory
    points_W_m : ndarray, shape (n, 3)
    times_s : ndarray, shape (k,), or None
        Rising, within the history; None takes the history's own.
    floor_z_m : float or None
        Depth of the floor; None for open water.
    target : Target or None
        A body on the floor that turns the flow aside.
    flow : str
        ``parcels``, the water that trials fly in; or ``lattice``, means of a solved jet for each thruster, joined by
        momentum: at each time the steady flow of the thrusts of then, as if they had long been running. The lattice was
        a box round one jet: nothing is known of points that lie in no running jet's box.
    turbulence : float
        Root mean square of the fluctuation on a jet's axis over its mean speed; 0 gives mean jets. Parcels only.
    swirl : bool
        Whether parcels spread as a propeller's swirling jet does. Parcels only; the lattice's jet swirls.
    density_kg_m3 : float
    seed : int
        Of the turbulence.

    Raises
    ------
    InputError
        If anything does not fit: points or hull below the floor, the hull in the target, times outside the history,
        what a flow cannot do.
    """
    if flow not in FLOWS:
        raise InputError(f"flow: '{flow}', allowed are {', '.join(FLOWS)}")
    if history.thrusts_N.shape[1] != len(vehicle.thrusters):
        raise InputError(f"thrusts: {history.thrusts_N.shape[1]} columns, {vehicle.name} has {len(vehicle.thrusters)}")
    times = history.times_s if times_s is None else np.asarray(times_s, dtype=np.float64)
    if len(times) == 0 or np.any(np.diff(times) <= 0.0):
        raise InputError("times: must be at least one, and rise")
    if times[0] < history.times_s[0] or times[-1] > history.times_s[-1] + 1e-9:
        raise InputError(
            f"times: {times[0]:g} to {times[-1]:g} s, the thrusts go from {history.times_s[0]:g} to "
            f"{history.times_s[-1]:g} s"
        )
    if len(times) * len(points_W_m) * 3 > _MOST_VALUES:
        raise InputError(f"{len(times)} times and {len(points_W_m)} points, allowed {_MOST_VALUES // 3} together")
    points = np.asarray(points_W_m, dtype=np.float64)
    origins = X_WB.apply(vehicle.thruster_positions_B_m)
    axes = vehicle.thruster_axes_B @ X_WB.R.T
    if floor_z_m is not None:
        if not math.isfinite(floor_z_m):
            raise InputError(f"floor: {floor_z_m:g} m, must be finite")
        _check_above(points, floor_z_m, "point")
        lowest_z_m = float(X_WB.p_m[2] + np.abs(X_WB.R[2]) @ vehicle.size_m / 2)
        if lowest_z_m > floor_z_m + 1e-9:
            raise InputError(
                f"pose: hull of {vehicle.name} reaches down to z = {lowest_z_m:.3f} m, the floor is at {floor_z_m:g} m"
            )
        _check_above(origins, floor_z_m, "thruster")
        if target is not None:
            _check_clear(vehicle, X_WB, target)
    elif target is not None:
        raise InputError("target: stands on a floor, give its depth")
    known = np.ones((len(times), len(points)), dtype=np.bool_)
    if flow == "lattice":
        if floor_z_m is not None or target is not None or turbulence > 0.0 or swirl:
            raise InputError(
                "flow lattice: holds mean swirling jets in open water only; floor, target, turbulence and swirl "
                "need parcels"
            )
        values, known = _lattice(vehicle, origins, axes, history, points, times, density_kg_m3)
    else:
        # Where there is a bed there is a surface at z = 0: it is put out of reach.
        lift = np.array(
            [0.0, 0.0, 0.0 if floor_z_m is None else _SURFACE_AWAY_M - min(points[:, 2].min(), X_WB.p_m[2])]
        )
        water = Water(
            vehicle.disk_areas_m2,
            density_kg_m3=density_kg_m3,
            bed_z_m=math.inf if floor_z_m is None else floor_z_m + float(lift[2]),
            rng=np.random.default_rng(seed),
            turbulence=turbulence,
            max_parcels=_MOST_PARCELS,
            spreading=SWIRLING if swirl else PLAIN,
            body=None if target is None else Blockage.of(_lifted(target, float(lift[2]))),
        )
        values = _parcels(water, origins + lift, axes, history, points + lift, times)
    return ProbeResult(times_s=times, points_W_m=points, velocities_m_s=values, known=known)


def _lifted(target: Target, by_m: float) -> Target:
    """The same target on a bed that lies deeper."""
    down = np.array([0.0, 0.0, by_m])
    mesh = Mesh(target.mesh.vertices_m + down, target.mesh.faces)
    return replace(target, mesh=mesh, centre_W_m=target.centre_W_m + down, bed_z_m=target.bed_z_m + by_m)


def _parcels(water: Water, origins: Array, axes: Array, history: ThrustHistory, points: Array, times: Array) -> Array:
    """Step the water from one time that matters to the next: rows of the history and times asked for."""
    values = np.empty((len(times), len(points), 3))
    stops = np.union1d(history.times_s, times)
    stops = stops[stops <= times[-1]]
    asked = {float(t): k for k, t in enumerate(times)}
    now = float(history.times_s[0])
    for stop in stops:
        steps = math.ceil((stop - now) / _STEP_S - 1e-9)
        for _ in range(steps):
            dt_s = (stop - now) / steps
            row = int(np.searchsorted(history.times_s, now + 1e-12, side="right")) - 1
            thrusts = history.thrusts_N[row]
            impulses = dt_s * np.stack([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)], axis=1)
            water.step(dt_s, origins, origins, axes, impulses)
        now = float(stop)
        if now in asked:
            values[asked[now]] = water.velocity(points)
    return values


def _lattice(
    vehicle: Vehicle,
    origins: Array,
    axes: Array,
    history: ThrustHistory,
    points: Array,
    times: Array,
    density_kg_m3: float,
) -> tuple[Array, BoolArray]:
    """Steady flow of the thrusts at each time; the last row only ends the history, so the one before it holds there.

    Where some running jets' boxes hold a point and others' do not, the others count as water at rest.
    """
    table = load_mean_field()
    values = np.empty((len(times), len(points), 3))
    known = np.empty((len(times), len(points)), dtype=np.bool_)
    rows = np.minimum(np.searchsorted(history.times_s, times, side="right") - 1, len(history.times_s) - 2)
    for row in np.unique(rows):
        thrusts = history.thrusts_N[row]
        steady = LatticeFlow(
            table=table,
            origins_W_m=origins,
            directions_W=-np.where(thrusts >= 0.0, 1.0, -1.0)[:, None] * axes,
            thrusts_N=np.abs(thrusts),
            areas_m2=vehicle.disk_areas_m2,
            density_kg_m3=density_kg_m3,
        )
        values[rows == row] = steady.velocity(points)
        known[rows == row] = _in_a_box(table, steady, points)
    return values, known


def _in_a_box(table: MeanField, flow: LatticeFlow, points: Array) -> BoolArray:
    """Whether the box of any running jet holds each point, shape (n,); with none running all water is known to rest.

    A box begins some diameters behind the disk, reaches to a radius and goes on downstream as a cone.
    """
    running = flow.thrusts_N > 0.0
    held: BoolArray = np.full(len(points), not running.any())
    for j in np.flatnonzero(running):
        diameter = math.sqrt(4 * flow.areas_m2[j] / math.pi)
        away = (points - flow.origins_W_m[j]) / diameter
        along = away @ flow.directions_W[j]
        across = np.linalg.norm(away - along[:, None] * flow.directions_W[j], axis=1)
        widened = table.r_D[-1] * np.maximum(along / table.x_D[-1], 1.0)
        held |= (along >= table.x_D[0]) & (across <= widened)
    return held


def _check_clear(vehicle: Vehicle, X_WB: Pose, target: Target) -> None:
    nowhere = (math.inf, math.inf, math.inf)
    points = np.concatenate([target.mesh.vertices_m, target.mesh.triangles_m.mean(axis=1)])
    if CollisionGeometry(vehicle.size_m, nowhere, points).touches(X_WB.p_m, X_WB.R):
        where = ", ".join(f"{v:g}" for v in X_WB.p_m)
        raise InputError(f"pose: hull of {vehicle.name} at ({where}) m is inside the target {target.name}, move it off")


def _check_above(points_W_m: Array, floor_z_m: float, what: str) -> None:
    deepest = int(np.argmax(points_W_m[:, 2]))
    if points_W_m[deepest, 2] > floor_z_m + 1e-9:
        place = ", ".join(f"{v:g}" for v in points_W_m[deepest])
        raise InputError(f"{what} {deepest + 1} at ({place}) m is below the floor at z = {floor_z_m:g} m")
