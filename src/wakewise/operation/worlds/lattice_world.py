"""World `lattice`: a flight in a lattice Boltzmann large-eddy simulation, which shares no law with the tank.

Thruster disks force the cells that they move through. The reaction of the vehicle's drag is spread over its box, so
that a hovering vehicle leaves no momentum. Target and bed are solid, and the current enters by the sides. Vehicle,
sensors and probes are those of the tank.

Not modelled: silt, waves, a pump, ambient turbulence, and the hull as an obstacle of jets. Cells of 2.5 cm are
three to a thruster's diameter: a jet's speed times distance is then 20 % low at 0.4 m and 20 % high at 0.9 m (cells of
2 cm come nearer, at 2.4 times the work), and sheets on the bed and the thin water at the target's surface are coarser
still. The target's excess speed is what the tank's is: this water less the same water without a vehicle, which goes on
beside it where there is a current (a current that goes round a target takes longer to settle than a hover lasts, and
sheds eddies then).
"""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState, WaterTruth
from wakewise.operation.worlds.vehicle_in_water import VehicleInWater
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Target
from wakewise.simulation.lattice.forced_lattice import ForcedLattice, disk_points
from wakewise.simulation.tank import TankSettings
from wakewise.simulation.tank.sediment import SiltProperties
from wakewise.simulation.tank.water_truth import TargetProbes
from wakewise.simulation.water import AmbientSum, SteadyCurrent

CELL_M = 0.025
STRONGEST_N = 5.0
"""Thrust of the fastest jet for which the time step is chosen; stronger ones of short duration are stable."""
SPIN_UP_M, SPIN_UP_S = 1.0, 10.0
"""Distance that the current flows before the thrusters start, or the time if that is shorter."""
_DISK_POINTS, _HULL_SPACING = 32, 0.04
_UNSTEADINESS = 0.15  # rms of a disk's load over its mean, as in the cases (see `lattice.cases.Case`)
_LOAD_LIFE = 0.5  # exit diameters over exit speed
_TOLERANCE_S = 1e-9
_MARGIN_M = 0.25  # the side takes the water's motion out over 0.2 m


class _Water:
    """The water of `TargetProbes`; its ambient flow is that of the same box without a vehicle, zero without current."""

    def __init__(self, water: ForcedLattice, alone: ForcedLattice | None) -> None:
        self._water, self._alone = water, alone
        self.steady = alone is None

    def velocity(self, points_W_m: Array) -> Array:
        return self._water.velocity(points_W_m)

    def ambient_velocity(self, points_W_m: Array) -> Array:
        return np.zeros(np.shape(points_W_m)) if self._alone is None else self._alone.velocity(points_W_m)

    def excess_velocity(self, points_W_m: Array) -> Array:
        return self.velocity(points_W_m) - self.ambient_velocity(points_W_m)


class LatticeWater(VehicleInWater):
    """Vehicle and sensors of the tank in the lattice's water.

    Raises InputError if the settings ask for water that this is not, or the vehicle starts outside the box.

    Parameters
    ----------
    vehicle : Vehicle
        True parameters.
    target : Target
        Standing on the bed; it is rigid here.
    rng : numpy Generator
        Its children serve sensors, probes and the disks' loads.
    half_size_m : float
        The box reaches this far to each side of the target.
    tilt_rad : float
        Where the joint of the camera, if it has one, stands at the start.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        target: Target,
        settings: TankSettings,
        start: BodyState,
        rng: np.random.Generator,
        half_size_m: float,
        cell_m: float = CELL_M,
        tilt_rad: float = 0.0,
    ) -> None:
        _check(settings)
        sensor_rng, probe_rng, self._load_rng = rng.spawn(3)
        density, current = settings.density_kg_m3, np.array(settings.current.velocity_m_s)
        ambient = AmbientSum(parts=(SteadyCurrent(velocity_W_m_s=current),) if current.any() else ())
        super().__init__(vehicle, target, settings, start, sensor_rng, ambient, tilt_rad)
        depth = settings.size_m[2]
        across = 2 * math.ceil(half_size_m / cell_m)
        cells = (across, across, round(depth / cell_m))
        low = np.array([*(target.centre_W_m[:2] - 0.5 * across * cell_m), depth - cells[2] * cell_m])
        exit_m_s = math.sqrt(STRONGEST_N / (density * float(vehicle.disk_areas_m2.min())))
        diameter = math.sqrt(4.0 * float(vehicle.disk_areas_m2.mean()) / math.pi)
        self._box = ForcedLattice(
            low,
            cells,
            cell_m,
            fastest_m_s=exit_m_s,
            jet_m=diameter,
            current_W_m_s=current,
            solid=solid_cells(target, low, cells, cell_m),
            density_kg_m3=density,
        )
        # An open disk of twice the exit's area sends out the ducted jet (see `lattice.cases`).
        self._disks_m = np.stack([disk_points(_DISK_POINTS, math.sqrt(2.0) * d) for d in _diameters(vehicle)])
        self._loads = self._load_rng.standard_normal((len(vehicle.thrusters), _DISK_POINTS, 3))
        self._hull_B_m = _hull_points(vehicle)
        self._probes = TargetProbes(target, probe_rng)
        self._laws = SiltProperties.of(
            settings.silt.grain_m, settings.silt.grain_density_kg_m3, density, settings.silt.erosion_kg_m2_s
        )
        speed = float(np.linalg.norm(current))
        nothing = np.zeros((0, 3))
        spin_up_s = min(SPIN_UP_M / speed, SPIN_UP_S) if speed > 0.0 else 0.0
        for _ in range(round(spin_up_s / self._box.step_s)):
            self._box.advance(nothing, nothing)
        self._began_s = self._box.time_s
        self._alone = self._box.copy() if speed > 0.0 else None
        self._water = _Water(self._box, self._alone)

    @property
    def box(self) -> ForcedLattice:
        """The water."""
        return self._box

    def _advance_water(self) -> None:
        nothing = np.zeros((0, 3))
        while self._box.time_s - self._began_s < self._time - 0.5 * self._box.step_s:
            self._box.advance(*self._pushes())
            if self._alone is not None:
                self._alone.advance(nothing, nothing)

    def _pushes(self) -> tuple[Array, Array]:
        """Points of the vehicle's forces on the water now, and the forces in N, both shape (k, 3)."""
        plant, vehicle = self._plant, self._plant.vehicle
        origins, axes = plant.disks()
        if not self._box.holds(origins):
            where = ", ".join(f"{v:.2f}" for v in plant.state.X_WB.p_m)
            raise InputError(f"flow lattice: the vehicle at ({where}) m has left the box of water about the target")
        thrusts = plant.thrusts_N
        exit_m_s = np.sqrt(np.abs(thrusts) / (self.settings.density_kg_m3 * vehicle.disk_areas_m2)) + 1e-6
        keep = np.exp(-self._box.step_s * exit_m_s / (_LOAD_LIFE * _diameters(vehicle)))[:, None, None]
        noise = self._load_rng.standard_normal(self._loads.shape)
        self._loads = keep * self._loads + np.sqrt(1.0 - keep**2) * noise
        uneven = _UNSTEADINESS * (self._loads - self._loads.mean(axis=1, keepdims=True))
        sides = _across(axes)
        points = origins[:, None] + np.einsum("tpk,tkx->tpx", self._disks_m, sides)
        each = (thrusts / _DISK_POINTS)[:, None, None]
        forces = -each * axes[:, None] + np.abs(each) * uneven
        X_WB = plant.state.X_WB
        hull = X_WB.apply(self._hull_B_m)
        given = np.broadcast_to(plant.drag()[1] / len(hull), hull.shape)
        return np.concatenate([points.reshape(-1, 3), hull]), np.concatenate([forces.reshape(-1, 3), given])

    def water(self) -> WaterTruth:
        """Water at the target now."""
        camera = (self._plant.state.X_WB @ self._plant.vehicle.X_BC_at(self._joint.tilt_rad)).p_m
        return self._probes.measure(self._water, self._laws, None, camera, self.settings.density_kg_m3)

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity less that of the same water without a vehicle, both shape (n, 3), now."""
        return self._water.excess_velocity(points_W_m)


def box_half_size_m(places_W_m: Array, centre_W_m: Array, vehicle: Vehicle) -> float:
    """Half size of a box about a target that holds the vehicle at all places, shape (n, 3)."""
    away = np.abs(places_W_m[:, :2] - centre_W_m[:2]).max()
    return float(away) + 0.5 * float(np.linalg.norm(vehicle.size_m)) + _MARGIN_M


def solid_cells(target: Target, low_W_m: Array, cells: tuple[int, int, int], cell_m: float) -> BoolArray:
    """Cells of a box that a target fills: those that its surface passes near the middle of, and those within."""
    from scipy.ndimage import binary_fill_holes

    from wakewise.scene.targets.distance import MeshDistance

    solid = np.zeros(cells, dtype=np.bool_)
    lowest, highest = target.mesh.vertices_m.min(axis=0), target.mesh.vertices_m.max(axis=0)
    first = np.maximum(np.floor((lowest - low_W_m) / cell_m).astype(int) - 1, 0)
    last = np.minimum(np.ceil((highest - low_W_m) / cell_m).astype(int) + 1, cells)
    axes = [low_W_m[k] + (np.arange(first[k], last[k]) + 0.5) * cell_m for k in range(3)]
    middles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    near = MeshDistance(target.mesh.vertices_m, target.mesh.faces)(middles.reshape(-1, 3)) < 0.5 * cell_m
    body = near.reshape(middles.shape[:3])
    # What stands on the bed is closed by it.
    closed = np.concatenate([body, np.ones((*body.shape[:2], 1), dtype=np.bool_)], axis=2)
    solid[first[0] : last[0], first[1] : last[1], first[2] : last[2]] = binary_fill_holes(closed)[:, :, :-1]
    return solid


def _diameters(vehicle: Vehicle) -> Array:
    found: Array = np.sqrt(4.0 * vehicle.disk_areas_m2 / math.pi)
    return found


def _hull_points(vehicle: Vehicle) -> Array:
    """Points evenly over the hull's box, shape (k, 3), in the body frame."""
    axes = []
    for size in vehicle.size_m:
        count = max(round(size / _HULL_SPACING), 1)
        axes.append(((np.arange(count) + 0.5) / count - 0.5) * size)
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _across(axes: Array) -> Array:
    """Two directions across each axis, shape (n, 2, 3), from unit vectors, shape (n, 3)."""
    other = np.where(np.abs(axes[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    one = np.cross(axes, other)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return np.stack([one, np.cross(axes, one)], axis=1)


def _check(settings: TankSettings) -> None:
    """Refuse settings that this water does not model; silt and turbulence are ignored."""
    for wrong, words in (
        (settings.waves.amplitude_m > 0.0, "tank.waves.amplitude_m: the lattice has no waves"),
        (settings.pump.speed_m_s > 0.0, "tank.pump.speed_m_s: the lattice has no pump"),
        (settings.current.file is not None, "tank.current.file: the lattice has a steady current only"),
        (settings.tether.diameter_m > 0.0, "tank.tether.diameter_m: the lattice has no cable"),
        (bool(settings.failures), "tank.failures: thrusters do not fail in the lattice"),
    ):
        if wrong:
            raise InputError(f"{words}; take flow tank, or leave it out")
