"""Vehicles by name or file: one YAML file per cited parameter set, checked on reading.

Writing of vehicle files: what a draft holds, by group and field, as YAML.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import ValidationError

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import euler_from_quat, quat_from_matrix
from wakewise.core.safe_yaml import YamlError, read_yaml, text_of
from wakewise.core.settings import describe_faults, guess
from wakewise.robot.vehicles.draft import NEEDED_FIELDS, PLACEHOLDER, ThrusterDraft, VehicleDraft
from wakewise.robot.vehicles.hydrodynamics import DragCase
from wakewise.robot.vehicles.vehicle import Vehicle
from wakewise.robot.vehicles.vehicle_file import R_BODY_CAMERA, VehicleFile


@functools.cache
def draft_names() -> tuple[str, ...]:
    """Names of all vehicles that come with the package, whole or not, sorted."""
    folder = resources.files("wakewise.robot.vehicles") / "library_data"
    return tuple(sorted(e.name.removesuffix(".yaml") for e in folder.iterdir() if e.name.endswith(".yaml")))


@functools.cache
def _flyable_names() -> tuple[str, ...]:
    return tuple(name for name in draft_names() if not load_draft(name).missing)


def vehicle_names(*, flyable_only: bool = True) -> list[str]:
    """Names of the vehicles that come with the package, sorted; by default only those whose file holds all of one."""
    return list(_flyable_names() if flyable_only else draft_names())


def load_vehicle(name_or_path: str) -> Vehicle:
    """Read a vehicle of the library by name, or any vehicle file by path (anything with a slash or .yaml/.yml).

    Raises InputError if there is no such vehicle or file, the file does not hold a usable vehicle (the message names
    the field), or it lacks something that flying needs (the message lists it).
    """
    draft = load_draft(name_or_path)
    draft.require_whole(name_or_path)
    return draft.vehicle()


def load_draft(name_or_path: str) -> VehicleDraft:
    """Read what a vehicle file says, whole or not; names and paths as for `load_vehicle`.

    Raises InputError if there is no such vehicle or file, or a value in it cannot be used; the message names the field.
    """
    if name_or_path in draft_names():
        text = (resources.files("wakewise.robot.vehicles") / "library_data" / f"{name_or_path}.yaml").read_text("utf-8")
        return parse_vehicle(text, f"{name_or_path}.yaml", name_or_path)
    path = Path(name_or_path)
    if not path.is_file():
        if is_path(name_or_path):
            raise InputError(f"vehicle file {name_or_path}: no such file")
        hint, names = guess(name_or_path, draft_names()), ", ".join(draft_names())
        raise InputError(f"vehicle {name_or_path!r}: not in the library, {hint}allowed {names} or the path of a file")
    try:
        text = text_of(path)
    except (OSError, UnicodeDecodeError, YamlError) as error:
        raise InputError(f"vehicle file {name_or_path}: not readable as UTF-8 text ({error})") from error
    return parse_vehicle(text, name_or_path, path.stem)


def is_path(name: str) -> bool:
    """Whether a name is meant as that of a file: it holds a slash, or ends as files do."""
    return Path(name).name != name or Path(name).suffix != ""


def parse_vehicle(text: str, where: str, name: str) -> VehicleDraft:
    """Read the text of a vehicle file; `where` is what messages call it.

    Raises InputError if the text is not a vehicle file or a value in it cannot be used.
    """
    if text.lstrip().startswith("<"):
        raise InputError(f"vehicle file {where}: is XML, not a vehicle file; see wakewise vehicle import")
    try:
        value = read_yaml(text)
    except YamlError as error:
        raise InputError(f"vehicle file {where}: not valid YAML ({error})") from error
    if not isinstance(value, dict):
        raise InputError(f"vehicle file {where}: holds {type(value).__name__}, must be a mapping of groups")
    value = _on_its_base(value, where)
    try:
        return VehicleFile.model_validate(value).draft(name)
    except ValidationError as error:
        told = describe_faults(
            error, VehicleFile, "file", lambda _, found: "not filled in" if found == PLACEHOLDER else None
        )
        raise InputError(f"vehicle file {where}: {told}{_lacks(value, told)}") from error
    except InputError as error:
        raise InputError(f"vehicle file {where}: {error}{_lacks(value, str(error))}") from error


def _lacks(tree: dict[str, Any], told: str) -> str:
    """What a flight needs beside what was given, of a file that cannot be read as it is."""
    layout = tree.get("thruster_layout")
    mounts = layout.get("mounts") if isinstance(layout, dict) else None
    own = {key for mount in mounts if isinstance(mount, dict) for key in mount} if isinstance(mounts, list) else set()
    lacking = []
    for dotted in NEEDED_FIELDS:
        group, _, field = dotted.partition(".")
        fields = tree.get(group)
        at_mounts = {"diameter_m": "disk_diameter_m"}.get(field, field) in own
        if (
            dotted not in told
            and not at_mounts
            and (fields is None or (isinstance(fields, dict) and fields.get(field) is None))
        ):
            lacking.append(dotted)
    return f"; for a flight it lacks {', '.join(lacking)} too" if lacking else ""


def _on_its_base(value: dict[str, Any], where: str) -> dict[str, Any]:
    """A file's groups, and those of the library's vehicle that it names as its `base` where it has none itself."""
    if "base" not in value:
        return value
    own = {group: fields for group, fields in value.items() if group != "base"}
    base = value["base"]
    if base not in draft_names():
        raise InputError(f"vehicle file {where}: base: {base!r}, allowed {', '.join(draft_names())}")
    under = read_yaml((resources.files("wakewise.robot.vehicles") / "library_data" / f"{base}.yaml").read_text("utf-8"))
    if "base" in under:
        raise InputError(f"vehicle file {where}: base: {base!r} has a base itself, name {under['base']!r}")
    return {**under, **own}


def draft_yaml(draft: VehicleDraft, blanks: Mapping[str, Sequence[str]] | None = None) -> str:
    """Write a draft as the text of a vehicle file that `load_draft` reads back as the same draft.

    What the draft lacks is left out. A group's source is the draft's own where no provenance names the group.

    `blanks`: comments to write in each group, or in place of one that is not there (see
    `wakewise.robot.vehicles.completion`).
    """
    value: dict[str, Any] = {"title": draft.title, "source": draft.source, "does_not_claim": draft.does_not_claim}
    if draft.notes:
        value["notes"] = list(draft.notes)
    comments = {} if blanks is None else blanks
    text = "# Body frame FRD: x forward, y right, z down. Every field's name ends in its unit.\n" + _text(value)
    provenance = {p.group: p for p in draft.provenance}
    for group, fields in groups_of(draft).items():
        stated = {name: field for name, field in fields.items() if field is not None}
        if stated:
            origin = provenance.get(group)
            head: dict[str, Any] = {"source": draft.source if origin is None else origin.source}
            if origin is not None and origin.estimate:
                head["estimate"] = True
            text += _text({group: head | stated})
        text += "".join(f"{line}\n" for line in comments.get(group, ()))
        if stated and group == "damping" and draft.drag_cases:
            text += _text({"drag_cases": {case.name: _drag_case(case) for case in draft.drag_cases}})
    return text


def _text(value: dict[str, Any]) -> str:
    return str(yaml.dump(value, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=116))


def groups_of(draft: VehicleDraft) -> dict[str, dict[str, Any]]:
    """Fields of a vehicle file by group, as plain values in its units; None for what the draft lacks."""
    matrix, linear, quadratic = draft.added_mass, draft.linear_damping, draft.quadratic_damping
    inertia, shipped, curve, camera = draft.inertia_kg_m2, draft.shipped_matrix, draft.curve, draft.X_BC
    least, joint = draft.least_thrust, draft.tilt
    groups: dict[str, dict[str, Any]] = {
        "body": {"size_m": _numbers(draft.size_m), "mass_kg": draft.mass_kg},
        "inertia": {},
        "buoyancy": {
            "displaced_volume_m3": draft.displaced_volume_m3,
            "centre_of_gravity_m": _numbers(draft.p_BG_m),
            "centre_of_buoyancy_m": _numbers(draft.p_BB_m),
        },
        "added_mass": {},
        "damping": {},
        "thruster_limits": {},
        "thruster_disk": {},
        "thruster_lag": {},
        "thruster_curve": {} if curve is None else {"table": curve.table, "supply_V": curve.supply_V},
        "thruster_least": {} if least is None else {"forward_N": least.forward_N, "reverse_N": least.reverse_N},
        "thruster_layout": {},
        "shipped_matrix": {},
        "camera_mount": {},
        "camera_tilt": {},
        "camera_lens": {},
    }
    if inertia is not None:
        groups["inertia"]["moments_kg_m2"] = _numbers(np.diag(inertia))
        products = inertia[[0, 0, 1], [1, 2, 2]]
        groups["inertia"]["products_kg_m2"] = _numbers(products) if products.any() else None
    if matrix is not None:
        groups["added_mass"] = {
            "translation_kg": _block(matrix[:3, :3]),
            "rotation_kg_m2": _block(matrix[3:, 3:]),
            "coupling_kg_m": _coupling(matrix[:3, 3:]),
        }
    groups["damping"] |= _damping(linear, quadratic)
    if draft.thrusters:
        shared, mounts = _shared([_mount(t) for t in draft.thrusters])
        groups |= shared
        groups["thruster_layout"]["mounts"] = mounts
    if shipped is not None:
        groups["shipped_matrix"] = {"force_N_per_N": _numbers(shipped[:3]), "moment_N_m_per_N": _numbers(shipped[3:])}
    if camera is not None:
        angles = np.rad2deg(euler_from_quat(quat_from_matrix(camera.R @ R_BODY_CAMERA.T)))
        groups["camera_mount"] = {"position_m": _numbers(camera.p_m), "roll_pitch_yaw_deg": _numbers(angles.round(12))}
    if joint is not None:
        groups["camera_tilt"] = {
            "range_deg": [round(math.degrees(angle), 12) for angle in (joint.low_rad, joint.high_rad)],
            "rate_deg_s": round(math.degrees(joint.rate_rad_s), 12),
            "pivot_m": _numbers(joint.p_BJ_m),
        }
    if draft.camera_fov_rad is not None:
        groups["camera_lens"]["horizontal_fov_deg"] = round(math.degrees(draft.camera_fov_rad), 12)
    return groups


def _damping(linear: Array | None, quadratic: Array | None) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    if linear is not None:
        fields |= {
            "linear_N_s_m": _block(linear[:3, :3]),
            "linear_N_m_s": _block(linear[3:, 3:]),
            "linear_force_by_turning_N_s": _coupling(linear[:3, 3:]),
            "linear_moment_by_moving_N_s": _coupling(linear[3:, :3]),
        }
    if quadratic is not None:
        diagonal = np.diag(quadratic)
        fields |= {
            "quadratic_N_s2_m2": _numbers(diagonal[:3]),
            "quadratic_N_m_s2": _numbers(diagonal[3:]),
        }
    return fields


def _drag_case(case: DragCase) -> dict[str, Any]:
    head: dict[str, Any] = {"source": case.source} | ({"estimate": True} if case.estimate else {})
    stated = _damping(case.linear_damping, case.quadratic_damping)
    return head | {name: field for name, field in stated.items() if field is not None}


def _shared(mounts: list[dict[str, Any]]) -> tuple[dict[str, dict[str, Any]], list[dict[str, Any]]]:
    """Take what all thrusters have alike out of the mounts, into the groups that hold it for all."""
    places = {
        "thruster_limits": {"max_forward_N": "max_forward_N", "max_reverse_N": "max_reverse_N"},
        "thruster_disk": {"disk_diameter_m": "diameter_m"},
        "thruster_lag": {"time_constant_s": "time_constant_s"},
    }
    groups = {}
    for group, fields in places.items():
        if all(field in mount and mount[field] == mounts[0][field] for mount in mounts for field in fields):
            groups[group] = {field_of_group: mounts[0][field] for field, field_of_group in fields.items()}
            mounts = [{key: value for key, value in mount.items() if key not in fields} for mount in mounts]
    return groups, mounts


def _mount(thruster: ThrusterDraft) -> dict[str, Any]:
    area = thruster.disk_area_m2
    fields = {
        "name": thruster.name,
        "position_m": _numbers(thruster.p_BT_m),
        "axis": _numbers(thruster.axis_B),
        "max_forward_N": thruster.max_forward_N,
        "max_reverse_N": thruster.max_reverse_N,
        "disk_diameter_m": None if area is None else round(math.sqrt(4.0 * area / math.pi), 15),
        "time_constant_s": thruster.time_constant_s,
    }
    return {name: value for name, value in fields.items() if value is not None}


def _numbers(array: Array | None) -> Any:
    # Adding zero turns -0.0 into 0.0.
    return None if array is None else (np.asarray(array, dtype=np.float64) + 0.0).tolist()


def _block(block: Array) -> Any:
    """A diagonal where that says it all, else rows."""
    diagonal = np.diag(block)
    return _numbers(diagonal if np.array_equal(block, np.diag(diagonal)) and np.all(diagonal >= 0.0) else block)


def _coupling(block: Array) -> Any:
    return _numbers(block) if block.any() else None


class _Dumper(yaml.SafeDumper):
    """Lists of plain values on one line, mappings one field a line."""

    def ignore_aliases(self, _data: Any) -> bool:
        return True


def _flow_list(dumper: _Dumper, value: list[Any]) -> yaml.Node:
    flat = all(not isinstance(v, dict) for v in value) and not all(isinstance(v, list | str) for v in value)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", value, flow_style=flat)


_Dumper.add_representer(list, _flow_list)
