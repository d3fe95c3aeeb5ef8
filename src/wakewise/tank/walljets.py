"""All wall jets of the tank: rings on every face, and on the planes in which jets meet head-on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wakewise.arrays import Array, IntArray
from wakewise.tank.bedjets import Rings, coarsened, grown, layer_speed, packed_rings, planes_velocity, with_ring_images
from wakewise.tank.bedjets_sums import COLUMNS, sum_planes
from wakewise.tank.faces import Face, Room
from wakewise.tank.meeting import Sheet

Plane = Face | Sheet

_SINGLE = np.zeros(0, np.float32)
_MOST = 400  # rings
_REST = 3.0  # wall jets rest at this many times the parcels' rest speed: on the bed 3 mm/s,
_SHEET_REST = 10.0  # and the jets of a meeting, of which there may be many, at this many


class WallJets:
    """Rings by the plane that they run along."""

    def __init__(self, room: Room) -> None:
        self._room = room
        self._reach_m = 2 * max((abs(face.at_m) for face in room.faces if face.axis != 2), default=np.inf)
        self._rings: dict[Plane, Rings] = {}
        self._seen: tuple[Array, IntArray, Array] | None = None  # planes, rings and images, packed for the kernel

    @property
    def count(self) -> int:
        """How many rings there are."""
        return sum(rings.count for rings in self._rings.values())

    def on_bed(self) -> Rings:
        """Rings on the bed."""
        for plane, rings in self._rings.items():
            if isinstance(plane, Face) and plane.name == "bed":
                return rings
        return Rings.none()

    def start(self, plane: Plane, rings: Rings) -> None:
        """Let new rings start, given in the plane's own frame."""
        self._rings[plane] = self._rings.get(plane, Rings.none()).joined(rings)
        self._seen = None

    def grow(self, dt_s: float, rest_speed_m_s: float, ambient: Callable[[Array], Array]) -> None:
        """Let rings run out for dt_s, carried along the plane by the ambient water at their centres.

        Those that have come to rest, have left the tank with the current by half their radius, or reach beyond twice
        the tank are gone.
        """
        if not self._rings:
            return
        centres = [
            plane.world(np.column_stack([rings.centre_m, np.full(rings.count, plane.depth_m)]))
            for plane, rings in self._rings.items()
        ]
        carried = ambient(np.concatenate(centres))
        kept: dict[Plane, Rings] = {}
        at = 0
        for (plane, rings), places in zip(self._rings.items(), centres, strict=True):
            current, at = plane.turned(carried[at : at + rings.count]), at + rings.count
            thickness = plane.thickness_m if isinstance(plane, Sheet) else 0.0
            wider, layer = grown(rings, current, dt_s, thickness)
            rest = rest_speed_m_s * (_SHEET_REST if isinstance(plane, Sheet) else _REST)
            keep = (layer >= rest) & (wider.radius_m < self._reach_m)
            for face in self._room.faces:
                keep &= face.gap_m(places) > -0.5 * rings.radius_m
            if not keep.all():
                wider = wider.take(keep)
            if wider.count:
                kept[plane] = wider
        self._rings = kept
        self._seen = None

    def thin(self) -> None:
        """Make neighbouring rings of a jet one; of too many, let the slowest go."""
        self._rings = {plane: coarsened(rings) for plane, rings in self._rings.items()}
        if self.count > _MOST:
            speeds = {plane: layer_speed(rings) for plane, rings in self._rings.items()}
            least = np.sort(np.concatenate(list(speeds.values())))[-_MOST]
            self._rings = {plane: rings.take(speeds[plane] >= least) for plane, rings in self._rings.items()}
        self._seen = None

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity of all of them with their images, shape (n, 3), at points, shape (n, 3)."""
        return planes_velocity(points_W_m, *self._rows())

    def pairs(self, points: int) -> int:
        """How many pairs of a point and an impulse take as long as the sum at so many points."""
        return 2 * points * len(self._rows()[2])

    def add(self, points_W_m: Array, out: Array) -> None:
        """Add the velocity at points to `out`, both shape (n, 3), on this thread."""
        sum_planes(points_W_m, *self._rows(), _SINGLE, out)

    def _rows(self) -> tuple[Array, IntArray, Array]:
        if self._seen is None:
            self._seen = self._packed()
        return self._seen

    def _packed(self) -> tuple[Array, IntArray, Array]:
        planes, rows = [np.zeros((0, 14))], [np.zeros((0, COLUMNS))]
        for plane, rings in self._rings.items():
            if not rings.count:
                continue
            if isinstance(plane, Face):
                rows.append(with_ring_images(packed_rings(rings, 0.0, self._per_height(plane)), plane, self._room))
                origin, turn, both = np.zeros(3), plane.turned(np.eye(3)).T, 0.0
            else:
                rows.append(packed_rings(rings, plane.thickness_m))
                origin, turn, both = plane.origin_m, plane.R, 1.0
            planes.append(np.concatenate([origin, turn.ravel(), [plane.depth_m, both]])[None])
        starts = np.cumsum([len(row) for row in rows])
        return np.concatenate(planes), starts, np.concatenate(rows)

    def _per_height(self, face: Face) -> float:
        opposite = [other for other in self._room.faces if other.axis == face.axis and other.side != face.side]
        return 1.0 / abs(opposite[0].at_m - face.at_m) if opposite else 0.0
