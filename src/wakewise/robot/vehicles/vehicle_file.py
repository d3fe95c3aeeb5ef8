"""The vehicle file: its groups of numbers, each with a unit in the name of the field and a source."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator, Field, Tag

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_euler
from wakewise.core.settings import Faults, Settings
from wakewise.robot.vehicles.draft import ThrusterDraft, VehicleDraft
from wakewise.robot.vehicles.hydrodynamics import DragCase
from wakewise.robot.vehicles.vehicle import CurveChoice, LeastThrust, Provenance, TiltJoint

R_BODY_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Axes of a camera (OpenCV) that looks along the body's x axis with its image upright, expressed in B."""

Three = Annotated[list[float], Field(min_length=3, max_length=3)]
ThreeByThree = Annotated[list[Three], Field(min_length=3, max_length=3)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
NotNegativeThree = Annotated[list[NotNegative], Field(min_length=3, max_length=3)]
PositiveThree = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Text = Annotated[str, Field(min_length=1)]


def _form(value: Any) -> str:
    """Which of the two forms of a block was meant; messages about it name the form."""
    return "rows" if isinstance(value, list) and any(isinstance(item, list) for item in value) else "diagonal"


DiagonalOrFull = Annotated[
    Annotated[NotNegativeThree, Tag("diagonal")] | Annotated[ThreeByThree, Tag("rows")], Discriminator(_form)
]
Row = Annotated[list[float], Field(min_length=1)]
ThreeRows = Annotated[list[Row], Field(min_length=3, max_length=3)]


class ParameterGroup(Settings):
    """Any group of numbers: where they come from, and whether they are an estimate."""

    source: Text = Field(description="where the numbers come from")
    estimate: bool = Field(default=False, description="true if these numbers were neither published nor measured")


class BodyGroup(ParameterGroup):
    """Size and mass of the vehicle."""

    size_m: PositiveThree | None = Field(
        default=None, description="length, width, height of the box around it, centred on the origin"
    )
    mass_kg: Positive | None = Field(default=None, description="mass in air, flooded parts filled")


class Inertia(ParameterGroup):
    """Moments and products of inertia about the centre of gravity."""

    moments_kg_m2: PositiveThree = Field(description="Ixx, Iyy, Izz")
    products_kg_m2: Three = Field(default=[0.0, 0.0, 0.0], description="elements xy, xz, yz of the matrix")


class Buoyancy(ParameterGroup):
    """Displaced volume and the two centres."""

    displaced_volume_m3: Positive | None = Field(
        default=None, description="volume of water that it displaces; mass / 1000 kg/m3 floats in fresh water"
    )
    centre_of_gravity_m: Three | None = Field(default=None, description="from the body origin, FRD")
    centre_of_buoyancy_m: Three | None = Field(
        default=None, description="from the body origin, FRD; above the centre of gravity, so its z is the smaller one"
    )


class AddedMass(ParameterGroup):
    """Added mass in blocks, each three numbers of a diagonal or three rows of three."""

    translation_kg: DiagonalOrFull = Field(description="surge, sway, heave")
    rotation_kg_m2: DiagonalOrFull = Field(description="roll, pitch, yaw")
    coupling_kg_m: ThreeByThree | None = Field(
        default=None,
        description="rows surge, sway, heave by columns roll, pitch, yaw; the mirror block is its transpose",
    )

    def matrix(self) -> Array:
        """Whole matrix, shape (6, 6)."""
        upper = None if self.coupling_kg_m is None else np.array(self.coupling_kg_m)
        lower = None if upper is None else upper.T
        return blocks(square(self.translation_kg), upper, lower, square(self.rotation_kg_m2))


class Damping(ParameterGroup):
    """Damping as positive magnitudes; zeros for a kind that the vehicle is taken not to have."""

    linear_N_s_m: DiagonalOrFull | None = Field(default=None, description="force by surge, sway, heave")
    linear_N_m_s: DiagonalOrFull | None = Field(default=None, description="moment by roll, pitch, yaw")
    linear_force_by_turning_N_s: ThreeByThree | None = Field(default=None, description="force by roll, pitch, yaw")
    linear_moment_by_moving_N_s: ThreeByThree | None = Field(default=None, description="moment by surge, sway, heave")
    quadratic_N_s2_m2: NotNegativeThree | None = Field(default=None, description="surge, sway, heave")
    quadratic_N_m_s2: NotNegativeThree | None = Field(default=None, description="roll, pitch, yaw")

    def linear(self) -> Array | None:
        """Linear damping, shape (6, 6), or None where the file states neither half of it."""
        pair = both("linear_N_s_m", self.linear_N_s_m, "linear_N_m_s", self.linear_N_m_s)
        if pair is None:
            return None
        upper, lower = (
            None if block is None else np.array(block)
            for block in (self.linear_force_by_turning_N_s, self.linear_moment_by_moving_N_s)
        )
        return blocks(square(pair[0]), upper, lower, square(pair[1]))

    def quadratic(self) -> Array | None:
        """Quadratic damping, shape (6, 6), or None where the file states neither half of it."""
        pair = both("quadratic_N_s2_m2", self.quadratic_N_s2_m2, "quadratic_N_m_s2", self.quadratic_N_m_s2)
        return None if pair is None else np.diag([*np.ravel(pair[0]), *np.ravel(pair[1])])


class DragCaseGroup(Damping):
    """Damping as another source has it; what is left out is none."""

    def case(self, name: str) -> DragCase:
        """The case as a record."""
        none = np.zeros((6, 6))
        try:
            linear, quadratic = self.linear(), self.quadratic()
            return DragCase(
                name=name,
                source=self.source,
                estimate=self.estimate,
                linear_damping=none if linear is None else linear,
                quadratic_damping=none if quadratic is None else quadratic,
            )
        except InputError as error:
            raise InputError(f"drag_cases.{name}: {error}") from error


class ThrusterLimits(ParameterGroup):
    """What the thrusters of the vehicle can do, unless a mount says otherwise."""

    max_forward_N: Positive = Field(description="largest thrust along the axis of the mount")
    max_reverse_N: NotNegative = Field(description="largest thrust against it, as a positive magnitude")


class ThrusterDisk(ParameterGroup):
    """The propeller's disk, unless a mount says otherwise."""

    diameter_m: Positive = Field(description="of the area that the propeller sweeps")


class ThrusterLag(ParameterGroup):
    """How fast thrust follows its command, unless a mount says otherwise."""

    time_constant_s: NotNegative = Field(description="first-order lag from commanded to delivered thrust; 0: at once")


class ThrusterCurve(ParameterGroup):
    """Which table turns pulse width into thrust."""

    table: Text = Field(description="name of a table that comes with the package")
    supply_V: Positive = Field(description="supply voltage at which to read it")


class ThrusterLeast(ParameterGroup):
    """Thrusts below which the thrusters give none, where no table of theirs says so."""

    forward_N: NotNegative = Field(description="least thrust along the axis of the mount")
    reverse_N: NotNegative = Field(description="least thrust against it, as a positive magnitude")


class Mount(Settings):
    """One thruster's place, and its own figures where they differ from the group's."""

    name: Text = Field(description="what reports call it; each name once")
    position_m: Three = Field(description="disk centre from the body origin, FRD")
    axis: Three = Field(description="direction of the force on the vehicle for positive thrust (no unit)")
    max_forward_N: Positive | None = Field(default=None, description="in place of thruster_limits.max_forward_N")
    max_reverse_N: NotNegative | None = Field(default=None, description="in place of thruster_limits.max_reverse_N")
    disk_diameter_m: Positive | None = Field(default=None, description="in place of thruster_disk.diameter_m")
    time_constant_s: NotNegative | None = Field(default=None, description="in place of thruster_lag.time_constant_s")


class LayoutGroup(ParameterGroup):
    """Where the thrusters are."""

    mounts: Annotated[list[Mount], Field(min_length=1)] = Field(description="one for each thruster, in their order")


class ShippedMatrix(ParameterGroup):
    """An allocation matrix that the source states, turned to FRD, to be held against the geometry."""

    force_N_per_N: ThreeRows = Field(description="rows surge, sway, heave; a column per thruster")
    moment_N_m_per_N: ThreeRows = Field(description="rows roll, pitch, yaw; a column per thruster")

    def matrix(self) -> Array:
        """Whole matrix, shape (6, n)."""
        rows = [*self.force_N_per_N, *self.moment_N_m_per_N]
        if len({len(row) for row in rows}) != 1:
            raise InputError(f"shipped_matrix: rows of {sorted({len(row) for row in rows})} numbers, all must be alike")
        return np.array(rows)


class CameraMount(ParameterGroup):
    """Where the camera sits and looks."""

    position_m: Three = Field(description="centre of projection from the body origin, FRD")
    roll_pitch_yaw_deg: Three = Field(description="turn of the camera; zeros look along the body's x axis, upright")


class CameraTilt(ParameterGroup):
    """The joint that tilts the camera about its own right axis; left out where the camera is fixed."""

    range_deg: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        description="lower and upper stop; positive looks up, 0 is as the mount states it"
    )
    rate_deg_s: Positive = Field(description="how fast it turns")
    pivot_m: Three | None = Field(
        default=None, description="a point of the hinge from the body origin, FRD; left out: the camera's own place"
    )

    def joint(self) -> TiltJoint:
        """The joint, in SI units."""
        low, high = (math.radians(angle) for angle in self.range_deg)
        rate, pivot = math.radians(self.rate_deg_s), vector(self.pivot_m)
        return TiltJoint(low_rad=low, high_rad=high, rate_rad_s=rate, p_BJ_m=pivot)


class CameraLens(ParameterGroup):
    """What the camera sees."""

    horizontal_fov_deg: Annotated[float, Field(gt=1.0, lt=170.0)] = Field(description="field of view in water")


class VehicleFile(Settings):
    """A vehicle file, whole; a group that the source does not state is left out."""

    title: Text = Field(description="name for people")
    source: Text = Field(description="where the numbers come from, as a whole")
    does_not_claim: Text = Field(description="what must not be concluded from these numbers")
    notes: list[Text] = Field(default=[], description="what is odd about the source's numbers")
    body: BodyGroup | None = None
    inertia: Inertia | None = None
    buoyancy: Buoyancy | None = None
    added_mass: AddedMass | None = None
    damping: Damping | None = None
    drag_cases: dict[str, DragCaseGroup] = Field(default={}, description="other sets of damping, by name")
    thruster_limits: ThrusterLimits | None = None
    thruster_disk: ThrusterDisk | None = None
    thruster_lag: ThrusterLag | None = None
    thruster_curve: ThrusterCurve | None = None
    thruster_least: ThrusterLeast | None = None
    thruster_layout: LayoutGroup | None = None
    shipped_matrix: ShippedMatrix | None = None
    camera_mount: CameraMount | None = None
    camera_tilt: CameraTilt | None = None
    camera_lens: CameraLens | None = None

    def draft(self, name: str) -> VehicleDraft:
        """Turn the file's numbers into a record, None where the file says nothing."""
        groups = [(field, getattr(self, field)) for field in type(self).model_fields]
        body, buoyancy, curve, least = self.body, self.buoyancy, self.thruster_curve, self.thruster_least
        faults = Faults()
        linear = quadratic = shipped = tilt = None
        cases: list[DragCase] = []
        thrusters: list[ThrusterDraft] = []
        with faults.gathered():
            linear = None if self.damping is None else self.damping.linear()
        with faults.gathered():
            quadratic = None if self.damping is None else self.damping.quadratic()
        with faults.gathered():
            shipped = None if self.shipped_matrix is None else self.shipped_matrix.matrix()
        with faults.gathered():
            tilt = None if self.camera_tilt is None else self.camera_tilt.joint()
        for case_name, group in self.drag_cases.items():
            with faults.gathered():
                cases.append(group.case(case_name))
        for mount in [] if self.thruster_layout is None else self.thruster_layout.mounts:
            with faults.gathered():
                thrusters.append(self._thruster(mount))
        draft = None
        with faults.gathered():
            draft = VehicleDraft(
                name=name,
                title=self.title,
                source=self.source,
                does_not_claim=self.does_not_claim,
                size_m=vector(None if body is None else body.size_m),
                mass_kg=None if body is None else body.mass_kg,
                inertia_kg_m2=None if self.inertia is None else _inertia(self.inertia),
                displaced_volume_m3=None if buoyancy is None else buoyancy.displaced_volume_m3,
                p_BG_m=vector(None if buoyancy is None else buoyancy.centre_of_gravity_m),
                p_BB_m=vector(None if buoyancy is None else buoyancy.centre_of_buoyancy_m),
                added_mass=None if self.added_mass is None else self.added_mass.matrix(),
                linear_damping=linear,
                quadratic_damping=quadratic,
                drag_cases=tuple(cases),
                thrusters=tuple(thrusters),
                shipped_matrix=None if faults.found else shipped,
                curve=None if curve is None else CurveChoice(table=curve.table, supply_V=curve.supply_V),
                least_thrust=None
                if least is None
                else LeastThrust(forward_N=least.forward_N, reverse_N=least.reverse_N),
                X_BC=None if self.camera_mount is None else _pose(self.camera_mount),
                tilt=tilt,
                camera_fov_rad=None if self.camera_lens is None else math.radians(self.camera_lens.horizontal_fov_deg),
                provenance=tuple(
                    Provenance(group=field, source=group.source, estimate=group.estimate)
                    for field, group in groups
                    if isinstance(group, ParameterGroup)
                ),
                notes=tuple(self.notes),
            )
        faults.tell()
        assert draft is not None
        return draft

    def _thruster(self, mount: Mount) -> ThrusterDraft:
        limits, disk, lag = self.thruster_limits, self.thruster_disk, self.thruster_lag
        diameter_m = _own_or(mount.disk_diameter_m, disk, "diameter_m")
        return ThrusterDraft(
            name=mount.name,
            p_BT_m=np.array(mount.position_m),
            axis_B=np.array(mount.axis),
            max_forward_N=_own_or(mount.max_forward_N, limits, "max_forward_N"),
            max_reverse_N=_own_or(mount.max_reverse_N, limits, "max_reverse_N"),
            disk_area_m2=None if diameter_m is None else 0.25 * math.pi * diameter_m**2,
            time_constant_s=_own_or(mount.time_constant_s, lag, "time_constant_s"),
        )


def square(block: list[float] | list[list[float]]) -> Array:
    """A block as a matrix, shape (3, 3), from its diagonal or its rows."""
    array = np.array(block, dtype=np.float64)
    return np.diag(array) if array.ndim == 1 else array


def blocks(corner: Array, upper: Array | None, lower: Array | None, last: Array) -> Array:
    """Four blocks of shape (3, 3) as one matrix, shape (6, 6); None is zero."""
    none = np.zeros((3, 3))
    return np.block([[corner, none if upper is None else upper], [none if lower is None else lower, last]])


def both(name_a: str, a: Any, name_b: str, b: Any) -> tuple[Any, Any] | None:
    """Both halves, or None if neither is there; one without the other is refused."""
    if a is None and b is None:
        return None
    if a is None or b is None:
        here, gone = (name_a, name_b) if b is None else (name_b, name_a)
        raise InputError(f"damping.{gone}: missing, it goes with {here}")
    return a, b


def _own_or(own: float | None, group: ParameterGroup | None, field: str) -> float | None:
    """The mount's own figure, else the group's."""
    return own if own is not None or group is None else getattr(group, field)


def vector(value: list[float] | None) -> Array | None:
    """Three numbers as an array, shape (3,)."""
    return None if value is None else np.array(value)


def _inertia(group: Inertia) -> Array:
    xx, yy, zz = group.moments_kg_m2
    xy, xz, yz = group.products_kg_m2
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _pose(mount: CameraMount) -> Pose:
    turn = matrix_from_quat(quat_from_euler(*np.deg2rad(mount.roll_pitch_yaw_deg)))
    return Pose.from_matrix(turn @ R_BODY_CAMERA, mount.position_m)
