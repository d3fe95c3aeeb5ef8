"""All wall jets of the tank: rings on every face, and on the planes in which jets meet head-on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wakewise.arrays import Array, IntArray
from wakewise.compiled import njit
from wakewise.water.bedjets import Rings, coarsened, grown, layer_speed, packed_rings, planes_velocity, with_ring_images
from wakewise.water.bedjets_sums import COLUMNS, sum_planes
from wakewise.water.faces import Face, Room
from wakewise.water.meeting import Sheet

Plane = Face | Sheet

_SINGLE = np.zeros(0, np.float32)
_MOST = 400  # rings
_REST = 3.0  # wall jets rest at this many times the parcels' rest speed: on the bed 3 mm/s,
_SHEET_REST = 10.0  # and the jets of a meeting, of which there may be many, at this many


@dataclass(frozen=True, eq=False)
class WallRows:
    """Rings and their images at one instant, packed for the kernel; arguments of `bedjets.planes_velocity`."""

    planes: Array
    starts: IntArray
    packed: Array

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity of all of them, shape (n, 3), at points, shape (n, 3)."""
        return planes_velocity(points_W_m, self.planes, self.starts, self.packed)

    def pairs(self, points: int) -> int:
        """How many pairs of a point and an impulse take as long as the sum at so many points."""
        return 2 * points * len(self.packed)

    def add(self, points_W_m: Array, out: Array) -> None:
        """Add the velocity at points to `out`, both shape (n, 3), on this thread."""
        sum_planes(points_W_m, self.planes, self.starts, self.packed, _SINGLE, out)


class WallJets:
    """Rings by the plane that they run along."""

    def __init__(self, room: Room) -> None:
        self._room = room
        self._reach_m = 2 * max((abs(face.at_m) for face in room.faces if face.axis != 2), default=np.inf)
        faces = [(face.axis, face.side, face.depth_m) for face in room.faces]
        self._faces = np.array(faces, dtype=np.float64).reshape(-1, 3)
        self._per_height = {face: _per_height(face, room) for face in room.faces}
        self._rings: dict[Plane, Rings] = {}
        self._seen: WallRows | None = None

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
        frames = [plane.frame for plane in self._rings]
        places = [_to_world(rings.centre_m, frame) for rings, frame in zip(self._rings.values(), frames, strict=True)]
        carried = ambient(np.concatenate(places))
        kept: dict[Plane, Rings] = {}
        at = 0
        for (plane, rings), frame, place in zip(self._rings.items(), frames, places, strict=True):
            current, at = _to_plane(carried[at : at + rings.count], frame), at + rings.count
            thickness, stretch = (plane.thickness_m, plane.stretch) if isinstance(plane, Sheet) else (0.0, 1.0)
            wider, layer = grown(rings, current, dt_s, thickness, stretch)
            rest = rest_speed_m_s * (_SHEET_REST if isinstance(plane, Sheet) else _REST)
            keep = (layer >= rest) & (wider.radius_m < self._reach_m) & _inside(place, rings.radius_m, self._faces)
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

    def rows(self) -> WallRows:
        """All of them with their images, as they are now."""
        if self._seen is None:
            self._seen = self._packed()
        return self._seen

    def _packed(self) -> WallRows:
        planes, rows = [np.zeros((0, 14))], [np.zeros((0, COLUMNS))]
        for plane, rings in self._rings.items():
            if not rings.count:
                continue
            if isinstance(plane, Face):
                rows.append(with_ring_images(packed_rings(rings, 0.0, self._per_height[plane]), plane, self._room))
            else:
                rows.append(packed_rings(rings, plane.thickness_m, stretch=plane.stretch))
            planes.append(plane.frame[None])
        starts = np.cumsum([len(row) for row in rows])
        return WallRows(np.concatenate(planes), starts, np.concatenate(rows))


def _per_height(face: Face, room: Room) -> float:
    """One over the distance from a face to the opposite one; 0 without one."""
    opposite = [other for other in room.faces if other.axis == face.axis and other.side != face.side]
    return 1.0 / abs(opposite[0].at_m - face.at_m) if opposite else 0.0


@njit
def _to_world(centre: Array, frame: Array) -> Array:
    """Places in a plane's frame, shape (n, 2), in the world, shape (n, 3)."""
    out = np.empty((centre.shape[0], 3))
    for j in range(centre.shape[0]):
        for k in range(3):
            along = frame[3 + k] * centre[j, 0] + frame[6 + k] * centre[j, 1] + frame[9 + k] * frame[12]
            out[j, k] = frame[k] + along
    return out


@njit
def _to_plane(vectors: Array, frame: Array) -> Array:
    """Vectors of the world, shape (n, 3), in a plane's frame."""
    out = np.empty((vectors.shape[0], 3))
    for j in range(vectors.shape[0]):
        for i in range(3):
            a = 3 + 3 * i
            out[j, i] = frame[a] * vectors[j, 0] + frame[a + 1] * vectors[j, 1] + frame[a + 2] * vectors[j, 2]
    return out


@njit
def _inside(places: Array, radius: Array, faces: Array) -> np.ndarray:
    """Which rings' centres are no farther behind any face (axis, side, depth) than half their radius."""
    keep = np.ones(radius.shape[0], np.bool_)
    for j in range(radius.shape[0]):
        for f in range(faces.shape[0]):
            if faces[f, 2] - faces[f, 1] * places[j, int(faces[f, 0])] <= -0.5 * radius[j]:
                keep[j] = False
    return keep
