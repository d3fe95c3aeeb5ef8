"""Triangle meshes of targets, and reading them from a file."""

from __future__ import annotations

import contextlib
import io
import logging
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze, frozen_indices
from wakewise.core.checks import path_of
from wakewise.core.errors import InputError
from wakewise.core.files import write_bytes
from wakewise.core.size_limits import broken_ply

READABLE_SUFFIXES = (".ply", ".stl", ".obj", ".off", ".glb")
PLAUSIBLE_SIZE_M = (0.02, 2.0)
"""Largest dimension of a target. A file outside this range is taken to be in other units than metres."""
LARGEST_COORDINATE = 1e9
"""Beyond this, in any unit, single precision has lost the shape of a target."""


class FacelessFileError(InputError):
    """A file of points without faces, which is no mesh but may be a cloud."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in metres; whose frame it is in is for the owner to say.

    Raises InputError if there is no face, a face names a vertex that does not exist, or a coordinate is not finite.
    """

    vertices_m: Array  # shape (n, 3)
    faces: IntArray  # shape (m, 3): vertex numbers, counter-clockwise seen from outside

    def __post_init__(self) -> None:
        freeze(self, vertices_m=(None, 3))
        faces = frozen_indices(self.faces, (None, 3), "faces")
        if len(faces) == 0:
            raise InputError("faces: none, allowed (m, 3) with m >= 1")
        if faces.min() < 0 or faces.max() >= len(self.vertices_m):
            raise InputError(
                f"faces: vertex numbers {faces.min()} to {faces.max()}, allowed 0 to {len(self.vertices_m) - 1}"
            )
        object.__setattr__(self, "faces", faces)

    @cached_property
    def triangles_m(self) -> Array:
        """Corners of every face, shape (m, 3, 3)."""
        return self.vertices_m[self.faces]

    @cached_property
    def area_vectors_m2(self) -> Array:
        """Outward normal times area of every face, shape (m, 3)."""
        a, b, c = np.moveaxis(self.triangles_m, 1, 0)
        return np.asarray(0.5 * np.cross(b - a, c - a), dtype=np.float64)

    @cached_property
    def face_areas_m2(self) -> Array:
        """Area of every face, shape (m,)."""
        return np.asarray(np.linalg.norm(self.area_vectors_m2, axis=1), dtype=np.float64)

    @cached_property
    def extent_m(self) -> Array:
        """Length, width and height of the axis-aligned box, shape (3,)."""
        return np.asarray(np.ptp(self.vertices_m, axis=0), dtype=np.float64)

    @cached_property
    def is_closed(self) -> bool:
        """Whether every edge is shared by exactly two faces that run along it in opposite directions."""
        start, end = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        n = len(self.vertices_m)
        forward = np.sort(start * n + end)
        return bool(np.all(np.diff(forward) > 0)) and np.array_equal(forward, np.sort(end * n + start))

    @cached_property
    def volume_m3(self) -> float:
        """Signed volume about the origin; exact when closed, or when open only along the plane z = 0."""
        a, b, c = np.moveaxis(self.triangles_m, 1, 0)
        return float(np.sum(a * np.cross(b, c)) / 6.0)


def load_mesh(path: Path | str, size_m: float | None = None) -> Mesh:
    """Read a target from a mesh file (PLY, STL, OBJ, OFF or GLB).

    `size_m`: largest dimension wanted, in metres. Without it the file is taken to be in metres. In a local frame with z
    up: centred in x and y, base at z = 0, faces oriented outward. An open scan stays open. Raises InputError if the
    file is missing, empty, unreadable, holds no faces, a vertex that is not finite or nothing of any extent; if
    `size_m` is not a size that a target has, or if none is given and the file's own is not one.
    """
    path = Path(path)
    smallest, largest = PLAUSIBLE_SIZE_M
    if size_m is not None and not smallest <= size_m <= largest:
        raise InputError(f"target size {size_m:g} m: allowed {smallest:g} to {largest:g} m")
    read = read_mesh(path)
    vertices, faces = _welded(read.vertices_m, read.faces)
    if len(faces) == 0 or Mesh(vertices, faces).face_areas_m2.sum() == 0.0:
        raise InputError(f"{path}: every face has zero area, a target needs triangles that span a surface")
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    extent = float(np.max(high - low))
    if size_m is None and not smallest <= extent <= largest:
        raise InputError(
            f"{path}: largest extent {extent:.4g} is outside {smallest:g} to {largest:g} m, "
            "so its unit is probably not the metre; pass --target-size METRES"
        )
    base = np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])
    vertices = (vertices - base) * (1.0 if size_m is None else size_m / extent)
    mesh = Mesh(vertices, faces)
    # A scan open at the bottom still has a signed volume about its base plane, whose sign gives the outside.
    return Mesh(vertices, faces[:, ::-1]) if mesh.volume_m3 < 0 else mesh


def read_mesh(path: Path | str) -> Mesh:
    """Read a mesh file just as it is: no moving, scaling, merging or turning of faces.

    Raises InputError if the file is missing, empty, unreadable, holds no faces or a vertex that is not finite.
    """
    path = path_of(path, "mesh file")
    vertices, faces = _read(path)
    if len(faces) == 0:
        raise FacelessFileError(
            f"{path}: no faces found, a target needs triangles (a point cloud must be meshed first)"
        )
    if not np.all(np.isfinite(vertices)):
        raise InputError(f"{path}: a vertex is NaN or infinite, every coordinate must be finite")
    if len(vertices) and np.abs(vertices).max() > LARGEST_COORDINATE:
        worst = np.abs(vertices).max()
        raise InputError(f"{path}: a coordinate is {worst:.3g}, allowed at most {LARGEST_COORDINATE:.0e} in any unit")
    if faces.min() < 0 or faces.max() >= len(vertices):
        named = faces.min() if faces.min() < 0 else faces.max()
        raise InputError(f"{path}: a face names vertex {named}, allowed 0 to {len(vertices) - 1}")
    return Mesh(vertices, faces)


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write a mesh as binary PLY, whole or not at all, in single precision (0.1 um at 1 m)."""
    import trimesh

    write_bytes(path, trimesh.Trimesh(mesh.vertices_m, mesh.faces, process=False).export(file_type="ply"))


def _read(path: Path) -> tuple[Array, IntArray]:
    """Vertices and faces as the file has them; nothing is printed, warned or logged on the way."""
    if not path.exists():
        raise InputError(f"{path}: no such file, give a mesh file ({_suffixes()})")
    if not path.is_file():
        raise InputError(f"{path}: not a file, give a mesh file ({_suffixes()})")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty (0 bytes), give a mesh file ({_suffixes()})")
    if path.suffix.lower() not in READABLE_SUFFIXES:
        raise InputError(f"{path}: suffix '{path.suffix}' is not a mesh format, allowed: {_suffixes()}")
    import trimesh

    try:
        broken = broken_ply(path) if path.suffix.lower() == ".ply" else None
        if broken is not None:
            raise InputError(f"{path}: was cut short, {broken}")
        with _silence():
            loaded = trimesh.load(path, file_type=path.suffix[1:].lower(), force="mesh", process=False)
            vertices = np.asarray(getattr(loaded, "vertices", np.zeros((0, 3))), dtype=np.float64)
            faces = np.asarray(getattr(loaded, "faces", np.zeros((0, 3))), dtype=np.int64)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or 'the file is damaged'})") from error
    except Exception as error:
        # The parsers check little, and raise whatever malformed bytes happen to lead to.
        reason = str(error).strip().splitlines()[0][:120] if str(error).strip() else "the file is damaged"
        if "unexpected length" in reason:  # nothing is cut short (`broken_ply`): a binary list of changing length
            reason = "its faces have different numbers of corners: save it with triangles, as ASCII PLY or as OBJ"
        raise InputError(f"{path}: not a readable {path.suffix[1:].upper()} mesh ({reason})") from error
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    return vertices, faces


def _welded(vertices: Array, faces: IntArray) -> tuple[Array, IntArray]:
    """Merge vertices at one place (STL repeats them), drop faces that are a line or a point, and unused vertices."""
    places, number = np.unique(vertices, axis=0, return_inverse=True)
    faces = number.reshape(-1)[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    used, renumbered = np.unique(faces, return_inverse=True)
    return places[used], renumbered.reshape(faces.shape).astype(np.int64)


def _suffixes() -> str:
    return ", ".join(READABLE_SUFFIXES)


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep the reader's warnings, log lines and prints to itself: our error says what is wrong."""
    log = logging.getLogger("trimesh")
    disabled = log.disabled
    log.disabled = True
    try:
        with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        log.disabled = disabled
