"""Vehicle files: one YAML file per cited parameter set, checked on reading."""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path
from typing import Annotated

import numpy as np
import yaml
from pydantic import Field, ValidationError

from wakewise.errors import InputError
from wakewise.geometry import Pose, matrix_from_quat, quat_from_euler
from wakewise.settings import Settings
from wakewise.vehicles.hydrodynamics import Hydrodynamics
from wakewise.vehicles.thruster import Thruster
from wakewise.vehicles.vehicle import Provenance, Vehicle

R_BODY_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Axes of a camera (OpenCV) that looks along the body's x axis with its image upright, expressed in B."""

Three = Annotated[list[float], Field(min_length=3, max_length=3)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
NotNegativeThree = Annotated[list[NotNegative], Field(min_length=3, max_length=3)]
PositiveThree = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Text = Annotated[str, Field(min_length=1)]


class Group(Settings):
    """Any group of numbers: where they come from, and whether they are an estimate."""

    source: Text = Field(description="where the numbers come from")
    estimate: bool = Field(default=False, description="true if nobody published or measured these numbers")


class Body(Group):
    """Size and mass of the vehicle."""

    size_m: PositiveThree = Field(description="length, width, height of the box around it, centred on the origin")
    mass_kg: Positive = Field(description="mass in air, flooded parts filled")


class Inertia(Group):
    """Moments and products of inertia about the centre of gravity."""

    moments_kg_m2: PositiveThree = Field(description="Ixx, Iyy, Izz")
    products_kg_m2: Three = Field(default=[0.0, 0.0, 0.0], description="elements xy, xz, yz of the matrix")


class Buoyancy(Group):
    """Displaced volume and the two centres."""

    displaced_volume_m3: Positive
    centre_of_gravity_m: Three
    centre_of_buoyancy_m: Three


class AddedMass(Group):
    """Diagonal of the added mass: surge, sway, heave, roll, pitch, yaw."""

    translation_kg: NotNegativeThree
    rotation_kg_m2: NotNegativeThree


class Damping(Group):
    """Diagonals of the damping, as positive magnitudes."""

    linear_N_s_m: NotNegativeThree
    linear_N_m_s: NotNegativeThree
    quadratic_N_s2_m2: NotNegativeThree
    quadratic_N_m_s2: NotNegativeThree


class ThrusterLimits(Group):
    """What all thrusters of the vehicle can do."""

    max_forward_N: Positive
    max_reverse_N: NotNegative = Field(description="positive magnitude")


class ThrusterDisk(Group):
    """The propeller's disk."""

    diameter_m: Positive


class ThrusterLag(Group):
    """How fast thrust follows its command."""

    time_constant_s: NotNegative


class Mount(Settings):
    """One thruster's place."""

    name: Text
    position_m: Three = Field(description="disk centre from the body origin, FRD")
    axis: Three = Field(description="direction of the force on the vehicle for positive thrust (no unit)")


class Layout(Group):
    """Where the thrusters are."""

    mounts: Annotated[list[Mount], Field(min_length=1)]


class CameraMount(Group):
    """Where the camera sits and looks."""

    position_m: Three = Field(description="centre of projection from the body origin, FRD")
    roll_pitch_yaw_deg: Three = Field(description="turn of the camera; zeros look along the body's x axis, upright")


class CameraLens(Group):
    """What the camera sees."""

    horizontal_fov_deg: Annotated[float, Field(gt=1.0, lt=170.0)] = Field(description="field of view in water")


class VehicleFile(Settings):
    """A vehicle file, whole."""

    title: Text
    source: Text
    does_not_claim: Text
    body: Body
    inertia: Inertia
    buoyancy: Buoyancy
    added_mass: AddedMass
    damping: Damping
    thruster_limits: ThrusterLimits
    thruster_disk: ThrusterDisk
    thruster_lag: ThrusterLag
    thruster_layout: Layout
    camera_mount: CameraMount
    camera_lens: CameraLens

    def vehicle(self, name: str) -> Vehicle:
        """Turn the file's numbers into the record that the rest of the program uses."""
        xx, yy, zz = self.inertia.moments_kg_m2
        xy, xz, yz = self.inertia.products_kg_m2
        damping, added, limits = self.damping, self.added_mass, self.thruster_limits
        turn = matrix_from_quat(quat_from_euler(*np.deg2rad(self.camera_mount.roll_pitch_yaw_deg)))
        groups = [(field, getattr(self, field)) for field in type(self).model_fields]
        return Vehicle(
            name=name,
            title=self.title,
            source=self.source,
            does_not_claim=self.does_not_claim,
            size_m=np.array(self.body.size_m),
            mass_kg=self.body.mass_kg,
            inertia_kg_m2=np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
            displaced_volume_m3=self.buoyancy.displaced_volume_m3,
            p_BG_m=np.array(self.buoyancy.centre_of_gravity_m),
            p_BB_m=np.array(self.buoyancy.centre_of_buoyancy_m),
            hydrodynamics=Hydrodynamics.diagonal(
                added_mass=np.array([*added.translation_kg, *added.rotation_kg_m2]),
                linear_damping=np.array([*damping.linear_N_s_m, *damping.linear_N_m_s]),
                quadratic_damping=np.array([*damping.quadratic_N_s2_m2, *damping.quadratic_N_m_s2]),
            ),
            thrusters=tuple(
                Thruster(
                    name=mount.name,
                    p_BT_m=np.array(mount.position_m),
                    axis_B=np.array(mount.axis),
                    max_forward_N=limits.max_forward_N,
                    max_reverse_N=limits.max_reverse_N,
                    disk_area_m2=0.25 * math.pi * self.thruster_disk.diameter_m**2,
                    time_constant_s=self.thruster_lag.time_constant_s,
                )
                for mount in self.thruster_layout.mounts
            ),
            X_BC=Pose.from_matrix(turn @ R_BODY_CAMERA, self.camera_mount.position_m),
            camera_fov_rad=math.radians(self.camera_lens.horizontal_fov_deg),
            provenance=tuple(
                Provenance(group=field, source=group.source, estimate=group.estimate)
                for field, group in groups
                if isinstance(group, Group)
            ),
        )


def vehicle_names() -> list[str]:
    """Names of the vehicles that come with the package, sorted."""
    folder = resources.files("wakewise.vehicles") / "library_data"
    return sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_vehicle(name_or_path: str) -> Vehicle:
    """Read a vehicle of the library by name, or any vehicle file by path (anything with a slash or .yaml/.yml).

    Raises
    ------
    InputError
        If there is no such vehicle or file, or the file does not hold a usable vehicle; the message names the field.
    """
    if name_or_path in vehicle_names():
        text = (resources.files("wakewise.vehicles") / "library_data" / f"{name_or_path}.yaml").read_text("utf-8")
        return _parse(text, f"{name_or_path}.yaml", name_or_path)
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml") and path.name == name_or_path:
        names = ", ".join(vehicle_names())
        raise InputError(f"vehicle {name_or_path!r}: not in the library, allowed {names} or the path of a .yaml file")
    if not path.is_file():
        raise InputError(f"vehicle file {name_or_path}: no such file")
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"vehicle file {name_or_path}: not readable as UTF-8 text ({error})") from error
    return _parse(text, name_or_path, path.stem)


def _parse(text: str, where: str, name: str) -> Vehicle:
    try:
        value = yaml.load(text, Loader=_StrictLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"vehicle file {where}: not valid YAML ({reason})") from error
    if not isinstance(value, dict):
        raise InputError(f"vehicle file {where}: holds {type(value).__name__}, must be a mapping of groups")
    try:
        return VehicleFile.model_validate(value).vehicle(name)
    except ValidationError as error:
        raise InputError(f"vehicle file {where}: {_first_problem(error)}") from error
    except InputError as error:
        raise InputError(f"vehicle file {where}: {error}") from error


def _first_problem(error: ValidationError) -> str:
    problems = error.errors(include_url=False)
    first = problems[0]
    field = ".".join(str(part) for part in first["loc"])
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    if first["type"] == "extra_forbidden":
        return f"{field}: no such field{more}"
    if first["type"] == "missing":
        return f"{field}: missing, it is required{more}"
    found = " ".join(repr(first["input"]).split())
    return f"{field}: found {found[:80]}, {first['msg'][0].lower()}{first['msg'][1:]}{more}"


class _StrictLoader(yaml.SafeLoader):
    """Safe YAML that refuses a key given twice, which YAML forbids and the plain loader lets pass."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[object, object]:
        keys = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        twice = sorted({key for key in keys if keys.count(key) > 1})
        if twice:
            raise yaml.YAMLError(f"key {', '.join(twice)} given more than once in line {node.start_mark.line + 1}")
        return dict(super().construct_mapping(node, deep=deep))
