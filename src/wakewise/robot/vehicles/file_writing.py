"""Writing of vehicle files: what a draft holds, by group and field, as YAML."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import yaml

from wakewise.core.arrays import Array
from wakewise.core.geometry import euler_from_quat, quat_from_matrix
from wakewise.robot.vehicles.draft import ThrusterDraft, VehicleDraft
from wakewise.robot.vehicles.hydrodynamics import DragCase
from wakewise.robot.vehicles.vehicle_file import R_BODY_CAMERA


def draft_yaml(draft: VehicleDraft, blanks: Mapping[str, Sequence[str]] | None = None) -> str:
    """Write a draft as the text of a vehicle file that `load_draft` reads back as the same draft.

    What the draft does not know is left out. A group's source is the draft's own where no provenance names the group.

    Parameters
    ----------
    draft : VehicleDraft
    blanks : mapping of str to lines, optional
        Comments to write in each group, or in place of one that is not there (see
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
    """Fields of a vehicle file by group, as plain values in its units; None of what the draft does not know."""
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
