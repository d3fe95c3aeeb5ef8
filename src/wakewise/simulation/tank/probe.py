"""True flow at given points for a vehicle held in place with a given thrust history; readers of these tables."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.constants import TRIM_WATER_KG_M3
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Mesh, Target
from wakewise.simulation.lattice import LatticeFlow, MeanField, load_mean_field
from wakewise.simulation.tank.contact import CollisionGeometry
from wakewise.simulation.water.blockage import Blockage
from wakewise.simulation.water.round_jet_closure import PLAIN, SWIRLING
from wakewise.simulation.water.water import Water

_NUMBERED = re.compile(r"(?:thrust|thruster|t)?[_ ]?(\d+)", re.IGNORECASE)
_OTHER_UNIT = re.compile(r".*_(mN|kN|MN|kgf?|gf?|lbf?|pct|percent|pwm|us|rpm|rps|rad_s|V|A|W)", re.IGNORECASE)
_GAIN = 1.05  # a thruster may give this much more than its vehicle file says, as those of a trial's tank do
_LONGEST_S = 36_000.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustHistory:
    """Thrusts that hold from one time to the next, shapes (k,) and (k, n); the last row ends the history.

    Raises InputError if there are fewer than two rows, times do not rise, go on for more than ten hours or a value is
    not finite.
    """

    times_s: Array
    thrusts_N: Array

    def __post_init__(self) -> None:
        freeze(self, times_s=(None,), thrusts_N=(len(self.times_s), None))
        if len(self.times_s) < 2:
            raise InputError(f"thrusts: {len(self.times_s)} rows, at least 2 are needed: a start and an end")
        falling = np.flatnonzero(np.diff(self.times_s) <= 0.0)
        if len(falling):
            k = int(falling[0]) + 1
            raise InputError(
                f"thrusts: time_s {self.times_s[k]:g} in row {k + 1} does not come after {self.times_s[k - 1]:g}"
            )
        length_s = float(self.times_s[-1] - self.times_s[0])
        if length_s > _LONGEST_S:
            raise InputError(
                f"thrusts: time_s goes on for {length_s:g} s, allowed up to {_LONGEST_S:g}; seconds are needed"
            )

    @property
    def impulse_N_s(self) -> Array:
        """Time integral of each thrust over the history, shape (n,)."""
        total: Array = np.diff(self.times_s) @ self.thrusts_N[:-1]
        return total


def read_table(path: Path, what: str) -> tuple[list[str], Array]:
    """Read a CSV file of finite numbers under one row of names.

    Raises InputError: in one line, with file and place.
    """
    try:
        rows = [row for row in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()) if row]
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, {what} is needed") from None
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{path}: cannot be read as text, {what} is needed") from None
    if not rows:
        raise InputError(f"{path}: empty, {what} is needed")
    if how := other_separator(rows[0]):
        raise InputError(f"{path}: {what} is needed{how}")
    header = [name.strip() for name in rows[0]]
    if len(set(header)) < len(header):
        raise InputError(f"{path}: a column is named twice in {', '.join(header)}")
    table = np.empty((len(rows) - 1, len(header)))
    for k, row in enumerate(rows[1:]):
        if len(row) != len(header):
            raise InputError(f"{path} row {k + 1}: {len(row)} values, the header has {len(header)}")
        for j, text in enumerate(row):
            try:
                table[k, j] = float(text)
            except ValueError:
                raise InputError(f"{path} row {k + 1}: '{text}' in {header[j]}, a number is needed") from None
            if not math.isfinite(table[k, j]):
                raise InputError(f"{path} row {k + 1}: {text} in {header[j]}, must be finite")
    return header, table


def read_thrusts(path: Path, vehicle: Vehicle) -> tuple[ThrustHistory, dict[str, str]]:
    """Read a history of thrusts in N, and say which column was taken for which thruster.

    Columns are time_s and one for each thruster, in any order: named as the vehicle names its thrusters (with or
    without ``_N``), or by number from 1 as in steps.parquet (``thrust_1_N``, ``thruster_1``, ``T1``, ``1``). If no
    name is either, the columns are taken in the vehicle's order. Thrusts may be up to 5 % beyond what the vehicle's
    file says that its thrusters give, as those of a trial's tank may be; `probe` itself has no limit.

    Raises InputError if the file, a column or a value is bad, or columns and thrusters do not match.
    """
    header, table = read_table(path, "a CSV with time_s and one thrust in N per thruster")
    if "time_s" not in header:
        raise InputError(f"{path}: no column time_s among {', '.join(header)}")
    n = len(vehicle.thrusters)
    columns = [name for name in header if name != "time_s"]
    for name in columns:
        if _thruster_of(name, vehicle) is None and (unit := _OTHER_UNIT.fullmatch(name)):
            raise InputError(f"{path}: column {name} looks like {unit.group(1)}, thrusts are needed in N")
    if len(columns) != n:
        said = {_thruster_of(name, vehicle) for name in columns}
        lacking = [f"thrust_{i + 1}_N" for i in range(n) if i not in said]
        more = f", no column {', '.join(lacking)}" if len(columns) < n and None not in said else ""
        raise InputError(f"{path}: {len(columns)} thrust columns, {vehicle.name} has {n} thrusters{more}")
    places = [_thruster_of(name, vehicle) for name in columns]
    if all(place is None for place in places):
        places = list(range(n))
    if None in places or len(set(places)) < n:
        bad = next((c for c, p in zip(columns, places, strict=True) if p is None or places.count(p) > 1), "")
        raise InputError(f"{path}: column {bad} is not one thruster's alone, use thrust_1_N to thrust_{n}_N")
    thrusts = np.empty((len(table), n))
    for name, place in zip(columns, places, strict=True):
        thrusts[:, place] = table[:, header.index(name)]
    _check_limits(path, vehicle, thrusts)
    taken = {c: vehicle.thrusters[p].name for c, p in zip(columns, places, strict=True) if p is not None}
    try:
        return ThrustHistory(times_s=table[:, header.index("time_s")], thrusts_N=thrusts), taken
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None


def read_points(path: Path) -> Array:
    """Read points of the world, columns x_m, y_m and z_m in any order, shape (n, 3).

    Raises InputError.
    """
    header, table = read_table(path, "a CSV with x_m, y_m, z_m")
    missing = [name for name in ("x_m", "y_m", "z_m") if name not in header]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)} among {', '.join(header)}")
    if not len(table):
        raise InputError(f"{path}: no points under its header")
    return table[:, [header.index(name) for name in ("x_m", "y_m", "z_m")]]


def regular_times(history: ThrustHistory, every_s: float) -> Array:
    """Times at equal steps over a history, its start included, shape (k,).

    Raises InputError if the step is not positive, longer than the history, or gives more than a million times.
    """
    length = float(history.times_s[-1] - history.times_s[0])
    if not (math.isfinite(every_s) and every_s > 0.0 and length / every_s < 1e6):
        raise InputError(f"every: {every_s:g} s, must be more than 0 and leave fewer than a million times")
    if every_s > length * (1 + 1e-9):
        raise InputError(f"every: {every_s:g} s, the thrusts go on for {length:g} s only")
    times: Array = history.times_s[0] + every_s * np.arange(math.floor(length / every_s + 1e-9) + 1)
    return np.minimum(times, history.times_s[-1])


def _thruster_of(column: str, vehicle: Vehicle) -> int | None:
    """Index of the thruster that a column is named after, or None."""
    bare = column.removesuffix("_N")
    for i, thruster in enumerate(vehicle.thrusters):
        if thruster.name in (column, bare):
            return i
    found = _NUMBERED.fullmatch(bare)
    number = int(found.group(1)) if found else 0
    return number - 1 if 1 <= number <= len(vehicle.thrusters) else None


def _check_limits(path: Path, vehicle: Vehicle, thrusts_N: Array) -> None:
    low, high = _GAIN * vehicle.thrust_lower_N, _GAIN * vehicle.thrust_upper_N
    beyond = np.argwhere((thrusts_N < low) | (thrusts_N > high))
    if len(beyond):
        k, i = (int(v) for v in beyond[0])
        raise InputError(
            f"{path} row {k + 1}: {thrusts_N[k, i]:g} N for {vehicle.thrusters[i].name} of {vehicle.name}, "
            f"allowed {low[i]:.4g} to {high[i]:.4g} N (what it gives, and 5 %)"
        )


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
    """Flow of a vehicle that is held at one pose under a thrust history, in water at rest before.

    Thrusts are what the thrusters give: there is no lag, no limit and no loss. Water is without walls and surface;
    the floor is a plane through which nothing flows and along which jets that strike it run out.

    - `times_s`, shape (k,): rising, within the history; None takes the history's own.
    - `floor_z_m`: depth of the floor; None for open water.
    - `target`: a body on the floor that turns the flow aside.
    - `flow`: ``parcels``, the water that trials fly in; or ``lattice``, means of a solved jet for each thruster, joined
      by momentum: at each time the steady flow of the thrusts of then, as if they had long been running. The lattice
      was a box round one jet: nothing is known of points that lie in no running jet's box.
    - `turbulence`: root mean square of the fluctuation on a jet's axis over its mean speed; 0 gives mean jets. Parcels
      only.
    - `swirl`: whether parcels spread as a propeller's swirling jet does. Parcels only; the lattice's jet swirls.
    - `seed`: of the turbulence.
    - Shapes: `points_W_m` (n, 3).

    Raises InputError if anything does not fit: points or hull below the floor, the hull in the target, times outside
    the history, what a flow cannot do.
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
