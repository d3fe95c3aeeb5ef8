"""What the hull must not touch: walls, surface and floor as planes, target and obstacles as spheres."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region

TANK_FACES = ("the south wall", "the west wall", "the water surface", "the north wall", "the east wall", "the floor")
"""Names of the planes of `Surroundings.tank`, in their order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Surroundings:
    """What the hull must not touch.

    - `planes`, shape (n, 4): unit normal into the free water and offset: free where normal . p > offset.
    - `spheres`, shape (n, 4): centre in W and radius, of the target and other obstacles.
    - `names`: of planes and spheres, in this order; those that have none are called by number.
    """

    planes: Array = field(default_factory=lambda: np.zeros((0, 4)))
    spheres: Array = field(default_factory=lambda: np.zeros((0, 4)))
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, planes=(None, 4), spheres=(None, 4))
        if self.spheres.size and np.any(self.spheres[:, 3] < 0.0):
            raise InputError(f"obstacle: radius {self.spheres[:, 3].min():g} m, must not be negative")
        if self.planes.size and np.any(np.abs(np.linalg.norm(self.planes[:, :3], axis=1) - 1.0) > 1e-6):
            raise InputError("plane: its normal is not of unit length")

    @classmethod
    def tank(
        cls, low_W_m: Array, high_W_m: Array, spheres: Array | None = None, names: tuple[str, ...] = ()
    ) -> Surroundings:
        """Walls, surface and floor of a box from `low_W_m` to `high_W_m`, shape (3,) each; `names` of the spheres."""
        eye = np.eye(3)
        planes = np.vstack([np.column_stack([eye, low_W_m]), np.column_stack([-eye, -np.asarray(high_W_m)])])
        return cls(planes=planes, spheres=np.zeros((0, 4)) if spheres is None else spheres, names=(*TANK_FACES, *names))

    def name(self, number: int) -> str:
        """What a plane or sphere is called, planes first."""
        if number < len(self.names):
            return self.names[number]
        planes = len(self.planes)
        return f"plane {number + 1}" if number < planes else f"sphere {number - planes + 1}"


def around_target(region: Region) -> Surroundings:
    """The sphere round the region's surface points, which is all that a region tells of its surroundings."""
    surface = region.points_W_m[region.distance_m <= 0.0]
    if len(surface) == 0:
        return Surroundings()
    middle = 0.5 * (surface.min(axis=0) + surface.max(axis=0))
    radius = float(np.linalg.norm(surface - middle, axis=1).max())
    return Surroundings(spheres=np.array([[*middle, radius]]))


def covering_spheres(points_W_m: Array, most_radius_m: float = 0.15, most: int = 12) -> Array:
    """Spheres, shape (k, 4), that cover points, shape (n, 3): as few as keep below a radius, and no more than `most`.

    Centres are picked one after the other where the points are farthest from all before (T. F. Gonzalez, Theoretical
    Computer Science 38 (1985) 293, doi 10.1016/0304-3975(85)90224-5), which needs at most twice the least radius.
    """
    points = np.asarray(points_W_m)
    if len(points) == 0:
        return np.zeros((0, 4))
    owner = np.zeros(len(points), dtype=np.int64)
    nearest = np.full(len(points), np.inf)
    seed = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    for count in range(1, most + 1):
        distance = np.linalg.norm(points - points[seed], axis=1)
        owner[distance < nearest] = count - 1
        nearest = np.minimum(nearest, distance)
        spheres = np.array([_around(points[owner == k]) for k in range(count) if np.any(owner == k)])
        if spheres[:, 3].max() <= most_radius_m:
            break
        seed = int(np.argmax(nearest))
    return spheres


def _around(points: Array) -> Array:
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return np.append(middle, np.linalg.norm(points - middle, axis=1).max())


def check_start(
    vehicle: Vehicle,
    region: Region,
    state: Array,
    surroundings: Surroundings,
    clearance_m: float = 0.0,
    what: str = "start",
) -> None:
    """Refuse a start from which no plan can be good, before the loop begins.

    `state` is position, quaternion, twist, shape (13,); `what` it is called in the message.

    Raises
    ------
    InputError
        An empty region or weights that are negative or NaN, points of the target inside the hull, a hull that touches
        something or is nearer to it than `clearance_m`, or a state that is not finite.
    """
    from wakewise.planning.kernels import plane_gap, rotation, sphere_gap

    x = np.array(state, dtype=np.float64)
    if x.shape != (13,) or not np.isfinite(x).all():
        raise InputError(f"{what}: must be 13 finite numbers (position, quaternion, twist)")
    if len(region.points_W_m) == 0:
        raise InputError("region: no points, the target is empty")
    if np.any(region.weights < 0.0) or not np.sum(region.weights) > 0.0:
        raise InputError("region: weights must not be negative, and at least one must be more than 0")
    R = np.empty((3, 3))
    rotation(x, R)
    half = 0.5 * np.array(vehicle.size_m)
    inside = np.all(np.abs((region.points_W_m - x[:3]) @ R) < half, axis=1) & (region.distance_m == 0.0)
    if np.any(inside):
        raise InputError(f"{what}: {int(inside.sum())} points of the target lie inside the vehicle, it must be outside")
    slope = np.empty(6)
    planes = len(surroundings.planes)
    for number, row in enumerate((*surroundings.planes, *surroundings.spheres)):
        gap = plane_gap if number < planes else sphere_gap
        clear = gap(x[:3], R, half, np.array(row), slope)
        if clear < clearance_m:
            raise InputError(
                f"{what}: the hull comes within {clear:.3f} m of {surroundings.name(number)}, "
                f"allowed is {clearance_m:g} m or more"
            )
