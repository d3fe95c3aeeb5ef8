"""What a reader finds in a file, still in the file's own body axes, and its turn into a draft in FRD."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.importers.xml import PlacedError, SourceLocation
from wakewise.robot.vehicles.check import actuation
from wakewise.robot.vehicles.draft import ThrusterDraft, VehicleDraft
from wakewise.robot.vehicles.vehicle import Provenance

Frame = Literal["FLU", "FRD"]

R_LINK_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of a camera (OpenCV) in a Gazebo sensor frame, which looks along its x axis with y left and z up."""

QUESTION = "QUESTIONED: "
"""Begins a note on what was read in one way and may well be meant in another."""

_FLIP = np.diag([1.0, -1.0, -1.0])
_FLIP_BOTH = np.kron(np.eye(2), _FLIP)
_AXES = {"x": 0, "y": 1, "z": 2}


@dataclass(eq=False)
class ParsedThruster:
    """A thruster in the file's body axes.

    `axis` is the force for positive thrust by the rule of the file's format; `R_BT` holds the axes of the thruster's
    own frame, for a user who says that thrust goes along one of them.
    """

    name: str
    p_m: Array
    axis: Array
    place: SourceLocation
    R_BT: Array | None = None
    max_forward_N: float | None = None
    max_reverse_N: float | None = None
    disk_area_m2: float | None = None
    time_constant_s: float | None = None


@dataclass(eq=False)
class ParsedVehicle:
    """Everything a reader found; None where the file says nothing. Axes are the file's own.

    `frame_doubt` is the note for a user who does not say the frame either, where it is a guess;
    `guessed` says how the thrusters were told if no rule of the format tells them; `raw_matrix` holds a matrix as it
    stands in the file if nothing states what its rows are.
    """

    name: str
    kind: str
    file: Path
    frame: Frame
    frame_why: str
    frame_doubt: str = ""
    thrust_rule: str = ""
    guessed: str = ""
    size_m: Array | None = None
    mass_kg: float | None = None
    inertia_kg_m2: Array | None = None
    p_G_m: Array | None = None
    displaced_volume_m3: float | None = None
    p_buoyancy_m: Array | None = None
    added_mass: Array | None = None
    linear_damping: Array | None = None
    quadratic_damping: Array | None = None
    thrusters: list[ParsedThruster] = field(default_factory=list)
    matrix: Array | None = None
    matrix_name: str = ""
    matrix_line: int | None = None
    column_names: list[str] = field(default_factory=list)
    raw_matrix: Array | None = None
    claims: list[tuple[int, str, SourceLocation, bool]] = field(default_factory=list)
    X_BC: Pose | None = None
    camera_fov_rad: float | None = None
    notes: list[str] = field(default_factory=list)
    derived: dict[str, str] = field(default_factory=dict)
    estimates: set[str] = field(default_factory=set)

    @property
    def origin(self) -> str:
        """Kind and name of the file, as sources of groups begin."""
        return f"{self.kind} {self.file.name}"


def unit_axis(axis: Array, where: str) -> Array:
    """An axis at unit length; refuses one of length 0."""
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise PlacedError(f"{where}: axis {axis.tolist()} has length {length:g}, it must not be zero")
    return axis / length


def to_frd(matrix: Array) -> Array:
    """Turn a vector, shape (3,), or a tensor, (3, 3) or (6, 6), between FLU and FRD (its own inverse)."""
    if matrix.ndim == 1:
        return _FLIP @ matrix + 0.0
    # Adding zero turns -0 into 0, which reads better in files.
    if matrix.shape == (3, 3):
        return _FLIP @ matrix @ _FLIP + 0.0
    return _FLIP_BOTH @ matrix @ _FLIP_BOTH + 0.0


def wrench_rows_to_frd(matrix: Array) -> Array:
    """Turn the rows of an allocation matrix, shape (6, n), between FLU and FRD."""
    return _FLIP_BOTH @ matrix + 0.0


def make_draft(found: ParsedVehicle, convention: str, thrust: str) -> VehicleDraft:
    """Turn what was found into a draft in FRD.

    `convention`: "auto", "FLU" or "FRD". `thrust`: "auto" or "axis" (the rule of the format), "reversed" (its
    opposite), or "+x" ... "-z", an axis of each thruster's own frame. Raises InputError if a value is out of range.
    """
    frame = found.frame if convention == "auto" else convention
    said = "told" if convention != "auto" else found.frame_why
    notes = [f"frame: {_FRAME_WORDS[frame]} ({said})"]
    if found.thrusters:
        notes.append(f"thrust direction: {_thrust_words(found, thrust)}")
    elif found.matrix is not None and thrust == "reversed":
        notes.append("thrust direction: the opposite of the file's matrix (told)")
    turn = frame == "FLU"

    def turned(value: Array | None) -> Array | None:
        return to_frd(value) if turn and value is not None else value

    matrix = found.matrix
    if matrix is not None:
        matrix = wrench_rows_to_frd(matrix) if turn else matrix
        matrix = -matrix if thrust == "reversed" else matrix
    X_BC = found.X_BC
    if turn and X_BC is not None:
        X_BC = Pose.from_matrix(_FLIP @ X_BC.R, _FLIP @ X_BC.p_m)
    notes += found.notes
    if found.frame_doubt and convention == "auto":
        notes.append(found.frame_doubt)
    if found.p_G_m is not None and found.p_buoyancy_m is not None:
        notes += _stability(found, frame)
    notes += _unfilled(found)
    thrusters = tuple(_thruster(t, thrust, turn=turn) for t in found.thrusters)
    try:
        draft = VehicleDraft(
            name=found.name,
            title=f"{found.name} (imported from {found.file.name})",
            source=f"{found.kind} file {found.file.name}",
            does_not_claim="Everything that the file does not state; nothing here was checked against measurements.",
            size_m=found.size_m,
            mass_kg=found.mass_kg,
            inertia_kg_m2=turned(found.inertia_kg_m2),
            displaced_volume_m3=found.displaced_volume_m3,
            p_BG_m=turned(found.p_G_m),
            p_BB_m=turned(found.p_buoyancy_m),
            added_mass=turned(found.added_mass),
            linear_damping=turned(found.linear_damping),
            quadratic_damping=turned(found.quadratic_damping),
            thrusters=thrusters,
            shipped_matrix=matrix,
            X_BC=X_BC,
            camera_fov_rad=found.camera_fov_rad,
            provenance=tuple(
                Provenance(group=group, source=source, estimate=group in found.estimates)
                for group, source in found.derived.items()
            ),
            notes=tuple(notes),
        )
        if thrusters or matrix is not None:
            draft = replace(draft, notes=(*draft.notes, actuation(draft)))
    except PlacedError:
        raise
    except InputError as fault:
        raise PlacedError(f"{found.file}: {fault}") from fault
    return draft


def symmetrised(matrix: Array, notes: list[str]) -> Array:
    """The symmetric half of an added mass, with a note on by how much it was not symmetric."""
    skew = float(np.abs(matrix - matrix.T).max())
    if skew == 0.0:
        return matrix
    i, j = np.unravel_index(int(np.argmax(np.abs(matrix - matrix.T))), matrix.shape)
    notes.append(
        f"added mass: not symmetric, entry ({i + 1}, {j + 1}) differs from its mirror image by {skew:.3g} "
        f"(largest entry {np.abs(matrix).max():.6g}); the mean of the two is taken"
    )
    return 0.5 * (matrix + matrix.T)


def _unfilled(found: ParsedVehicle) -> list[str]:
    """Take substitutions that nothing filled in, such as $(param robot_name), out of names; say which were there."""
    left: dict[str, None] = {}

    def plain(name: str, otherwise: str) -> str:
        left.update(dict.fromkeys(_SUBSTITUTION.findall(name)))
        return _SUBSTITUTION.sub("", name).strip("/_-: ") or otherwise

    found.name = plain(found.name, found.file.stem)
    for i, thruster in enumerate(found.thrusters):
        thruster.name = plain(thruster.name, f"thruster{i}")
    if not left:
        return []
    return [f"names: {', '.join(list(left)[:6])} has no value in the file and is left out of names"]


_SUBSTITUTION = re.compile(r"\$\([^)]*\)|\$\{[^}]*\}")
_FRAME_WORDS = {"FLU": "FLU (x forward, y left, z up), turned to FRD", "FRD": "FRD (x forward, y right, z down)"}


def _thruster(found: ParsedThruster, thrust: str, *, turn: bool) -> ThrusterDraft:
    axis = found.axis
    forward, reverse = found.max_forward_N, found.max_reverse_N
    if thrust == "reversed":
        axis = -axis
        forward, reverse = reverse, forward
    elif thrust in _SIGNED:
        if found.R_BT is None:
            raise PlacedError(
                f"{found.place}: thruster {found.name}: has no frame of its own, {thrust} cannot be taken"
            )
        axis = (1.0 if thrust[0] == "+" else -1.0) * found.R_BT[:, _AXES[thrust[1]]]
    try:
        return ThrusterDraft(
            name="".join(c if c.isprintable() else "?" for c in found.name)[:200],
            p_BT_m=to_frd(found.p_m) if turn else found.p_m,
            axis_B=to_frd(axis) if turn else axis,
            max_forward_N=forward,
            max_reverse_N=reverse,
            disk_area_m2=found.disk_area_m2,
            time_constant_s=found.time_constant_s,
        )
    except InputError as fault:
        raise PlacedError(f"{found.place}: {fault}") from fault


_SIGNED = frozenset({"+x", "-x", "+y", "-y", "+z", "-z"})
THRUST_CHOICES = ("auto", "axis", "reversed", *sorted(_SIGNED))
FRAME_CHOICES = ("auto", "FLU", "FRD")


def _thrust_words(found: ParsedVehicle, thrust: str) -> str:
    if thrust == "auto":
        return found.thrust_rule
    if thrust == "axis":
        return f"{found.thrust_rule} (told)"
    if thrust == "reversed":
        return f"the opposite of: {found.thrust_rule} (told)"
    return f"positive thrust pushes along {thrust} of each thruster's own frame (told)"


def _stability(found: ParsedVehicle, frame: str) -> list[str]:
    """A vehicle that floats level has its buoyancy above its weight; otherwise the frame or the file is doubtful."""
    up = 1.0 if frame == "FLU" else -1.0
    if found.p_buoyancy_m is None or found.p_G_m is None:
        return []
    lift_m = up * float(found.p_buoyancy_m[2] - found.p_G_m[2])
    if lift_m >= 0.0:
        return [f"centre of buoyancy {1000 * lift_m:.3g} mm above the centre of gravity in this frame, as it should be"]
    return [
        f"centre of buoyancy {-1000 * lift_m:.3g} mm BELOW the centre of gravity in this frame: "
        f"the vehicle would turn over, so the frame or the file is wrong"
    ]
