"""What an imported vehicle lacks: blanks to fill in, with plausible ranges, and estimates after another vehicle.

Vehicles of one shape and mean density scale with their length, which goes with the cube root of their mass: volumes and
translational added mass with its cube, inertia and rotational added mass with its fifth power, drag coefficients at
equal speed with its square (translation) and fifth power (rotation). Thrusters and lenses are bought, not scaled.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles.draft import THRUSTER_FIELDS, ThrusterDraft, VehicleDraft
from wakewise.robot.vehicles.library import groups_of, load_draft, vehicle_names
from wakewise.robot.vehicles.vehicle import Provenance
from wakewise.robot.vehicles.vehicle_file import VehicleFile

_POWERS = {
    "body.size_m": 1,
    "body.mass_kg": 3,
    "inertia.moments_kg_m2": 5,
    "buoyancy.displaced_volume_m3": 3,
    "added_mass.translation_kg": 3,
    "added_mass.rotation_kg_m2": 5,
    "damping.linear_N_s_m": 2,
    "damping.linear_N_m_s": 4,
    "damping.quadratic_N_s2_m2": 2,
    "damping.quadratic_N_m_s2": 5,
    "thruster_limits.max_forward_N": 0,
    "thruster_limits.max_reverse_N": 0,
    "thruster_disk.diameter_m": 0,
    "thruster_lag.time_constant_s": 0,
    "camera_lens.horizontal_fov_deg": 0,
}
"""Powers of length by which the fields of similar vehicles differ; of fields that have a plausible range."""

_LIMITS = (THRUSTER_FIELDS["max_forward_N"], THRUSTER_FIELDS["max_reverse_N"])

_FORMS = {
    "thruster_layout.mounts": "[{name: _, position_m: [_, _, _], axis: [_, _, _]}]",
    **dict.fromkeys(
        (
            *("body.mass_kg", "buoyancy.displaced_volume_m3", "camera_lens.horizontal_fov_deg"),
            *THRUSTER_FIELDS.values(),
        ),
        "_",
    ),
}
"""How the value of a field is written, where it is not three numbers."""

_UNITS = (
    *(("_N_s2_m2", "N s2/m2"), ("_N_m_s2", "N m s2"), ("_N_m_per_N", "N m/N"), ("_N_per_N", "N/N")),
    *(("_N_s_m", "N s/m"), ("_N_m_s", "N m s"), ("_N_s", "N s"), ("_kg_m2", "kg m2"), ("_kg_m", "kg m")),
    *(("_deg_s", "deg/s"), ("_deg", "deg"), ("_kg", "kg"), ("_m3", "m3"), ("_m", "m"), ("_N", "N"), ("_V", "V")),
    ("_s", "s"),
)


def unit_of(field: str) -> str:
    """Unit that the name of a field ends in; empty where it has none."""
    return next((unit for ending, unit in _UNITS if field.endswith(ending)), "")


def plausible(dotted: str, draft: VehicleDraft | None = None) -> str:
    """Range of a field of a vehicle file among the library's vehicles, in words; empty where a range says nothing.

    `dotted`: group and field, such as "body.size_m". `draft`: the vehicle it is for: where its mass is known the others
    are scaled to it.
    """
    if dotted not in _POWERS:
        return ""
    length = None if draft is None else _length(draft)
    values: list[float] = []
    for found, other in _stated(dotted):
        scale = 1.0 if length is None or other is None else (length / other) ** _POWERS[dotted]
        values += [scale * value for value in found if value != 0.0]
    low, high = _short(min(values)), _short(max(values))
    return low if low == high else f"{low} to {high}"


@cache
def _stated(dotted: str) -> tuple[tuple[tuple[float, ...], float | None], ...]:
    """The values of a field in each vehicle of the library that can fly, and its length."""
    group, _, field = dotted.partition(".")
    found = []
    for name in vehicle_names():
        draft = load_draft(name)
        value = groups_of(draft)[group].get(field)
        if value is None and group.startswith("thruster_"):
            own = {"diameter_m": "disk_diameter_m"}.get(field, field)
            value = [mount[own] for mount in groups_of(draft)["thruster_layout"]["mounts"] if own in mount] or None
        if value is not None:
            numbers = np.abs(np.asarray(value, dtype=np.float64))
            numbers = np.diag(numbers) if numbers.ndim == 2 else np.atleast_1d(numbers)
            found.append((tuple(float(v) for v in numbers), _length(draft)))
    return tuple(found)


def _length(draft: VehicleDraft) -> float | None:
    """A length that goes with the size of vehicles of one density; None where neither mass nor volume is known."""
    if draft.mass_kg is not None:
        return float((draft.mass_kg / 1000.0) ** (1.0 / 3.0))
    return None if draft.displaced_volume_m3 is None else float(draft.displaced_volume_m3 ** (1.0 / 3.0))


def _short(value: float) -> str:
    return f"{float(f'{value:.3g}'):g}"


def blank_fields(draft: VehicleDraft) -> dict[str, list[str]]:
    """Comment lines for the fields that a flight needs and the draft does not hold, by group, for `draft_yaml`.

    Each is a line of the file as it should be, with `_` in place of numbers, its unit, meaning and plausible range.
    """
    held = groups_of(draft)
    asked = list(draft.missing_fields)
    if set(_LIMITS) & set(asked):  # their group holds both
        asked = [name for name in asked if name not in _LIMITS] + list(_LIMITS)
    lines: dict[str, list[str]] = {}
    for dotted in asked:
        group = dotted.partition(".")[0]
        if group not in lines:
            there = any(value is not None for value in held[group].values())
            head = [] if there else [f"#{group}:", "#  source:  # where the numbers come from", "#  estimate: true"]
            lines[group] = ["# Missing: uncomment the lines below and put numbers for _.", *head]
        lines[group].append(_blank(dotted, draft))
    return lines


def _blank(dotted: str, draft: VehicleDraft) -> str:
    group, _, field = dotted.partition(".")
    near = plausible(dotted, draft)
    scaled = " scaled to this mass" if draft.mass_kg is not None and _POWERS.get(dotted, 0) else ""
    said = (unit_of(field), description(group, field), f"the library's vehicles{scaled}: {near}" if near else "")
    return f"#  {field}: {_FORMS.get(dotted, '[_, _, _]')}  # {'; '.join(text for text in said if text)}"


def description(group: str, field: str) -> str:
    """What a field of a vehicle file is, as docs/vehicle-file.md has it."""
    model: Any = VehicleFile.model_fields[group].annotation
    kinds = [kind for kind in (model, *getattr(model, "__args__", ())) if hasattr(kind, "model_fields")]
    return str(kinds[0].model_fields[field].description or "")


def completed(draft: VehicleDraft, like: VehicleDraft) -> VehicleDraft:
    """The draft with what it lacks for a flight after another vehicle, scaled by mass, and marked as estimates.

    What the draft holds is kept. Its centre of buoyancy comes to lie above its own centre of gravity. Where its file
    has an allocation matrix but no places of thrusters, those stay missing: another vehicle's would contradict it.

    `like`: a vehicle that can fly. Raises InputError if the other vehicle cannot fly, or the draft lacks nothing that
    it could give.
    """
    like.require_whole()
    asked = [name for name in draft.missing_fields if draft.shipped_matrix is None or "thruster" not in name]
    if draft.thrusters:
        asked = list(draft.missing_fields)
    if not asked:
        raise InputError(f"vehicle {draft.name}: lacks nothing that {like.name} could give, leave --like out")
    own, other = _length(draft), _length(like)
    s = 1.0 if own is None or other is None else own / other
    given: dict[str, Any] = {}

    def give(attribute: str, value: Any) -> None:
        if getattr(draft, attribute) is None:
            given[attribute] = value

    give("size_m", s * _array(like.size_m))
    give("mass_kg", s**3 * float(_array(like.mass_kg)))
    give("inertia_kg_m2", s**5 * _array(like.inertia_kg_m2))
    give("displaced_volume_m3", s**3 * float(_array(like.displaced_volume_m3)))
    give("p_BG_m", s * _array(like.p_BG_m))
    centre = _array(given.get("p_BG_m", draft.p_BG_m))
    give("p_BB_m", centre + s * (_array(like.p_BB_m) - _array(like.p_BG_m)))
    give("added_mass", _scaled(_array(like.added_mass), s**1.5, s**2.5))
    give("linear_damping", _scaled(_array(like.linear_damping), s, s**2))
    give("quadratic_damping", _scaled(_array(like.quadratic_damping), s, s**2.5))
    if like.X_BC is not None:
        give("X_BC", Pose(s * like.X_BC.p_m, like.X_BC.q))
    give("camera_fov_rad", like.camera_fov_rad)
    given["thrusters"] = _thrusters(draft, like, s)
    if set(_LIMITS) <= set(asked) and all(t.max_forward_N is t.max_reverse_N is None for t in draft.thrusters):
        given |= {"curve": like.curve, "least_thrust": like.least_thrust}
        asked += ["thruster_curve.table"] if like.curve is not None else []
        asked += ["thruster_least.forward_N"] if like.least_thrust is not None else []
    ratio = f", lengths x {s:.3g} by the masses" if not math.isclose(s, 1.0) else ""
    return replace(
        draft,
        **given,
        provenance=_provenance(draft, asked, f"an estimate after {like.name}{ratio}"),
        does_not_claim=f"{draft.does_not_claim.rstrip()} What is marked as an estimate is that of {like.name}{ratio}.",
    )


def _array(value: Any) -> Array:
    if value is None:
        raise InputError("vehicle: is not whole")
    return np.asarray(value, dtype=np.float64)


def _scaled(matrix: Array, moving: float, turning: float) -> Array:
    """A matrix, shape (6, 6), with its rows and columns of translation and rotation scaled; it stays definite."""
    factors = np.array([moving] * 3 + [turning] * 3)
    return np.asarray(matrix * factors[:, None] * factors[None, :])


def _thrusters(draft: VehicleDraft, like: VehicleDraft, s: float) -> tuple[ThrusterDraft, ...]:
    if not draft.thrusters:
        if draft.shipped_matrix is not None:
            return ()
        return tuple(replace(t, p_BT_m=s * t.p_BT_m) for t in like.thrusters)
    usual: dict[str, Any] = {
        field: float(np.median([_array(getattr(t, field)) for t in like.thrusters])) for field in THRUSTER_FIELDS
    }
    lacking = [{field: usual[field] for field in usual if getattr(t, field) is None} for t in draft.thrusters]
    return tuple(replace(t, **values) for t, values in zip(draft.thrusters, lacking, strict=True))


def _provenance(draft: VehicleDraft, asked: list[str], words: str) -> tuple[Provenance, ...]:
    """Sources of the groups, those that were filled as estimates; of one that is filled in part, which fields."""
    known = {origin.group: origin for origin in draft.provenance}
    held = groups_of(draft)
    for group in dict.fromkeys(name.partition(".")[0] for name in asked):
        fields = ", ".join(name.partition(".")[2] for name in asked if name.startswith(f"{group}."))
        if any(value is not None for value in held.get(group, {}).values()):
            before = known[group].source if group in known else draft.source
            known[group] = Provenance(group=group, source=f"{before}; {fields}: {words}", estimate=True)
        else:
            known[group] = Provenance(group=group, source=words, estimate=True)
    return tuple(known.values())
