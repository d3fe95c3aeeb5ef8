"""Whatever stands in a field of a vehicle's records is taken or refused by an InputError that names the field."""

import math
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thruster import Thruster
from wakewise.robot.vehicles import (
    DragCase,
    Hydrodynamics,
    ThrusterDraft,
    TiltJoint,
    Vehicle,
    VehicleDraft,
    load_draft,
    load_vehicle,
)
from wakewise.robot.vehicles.vehicle import CurveChoice, LeastThrust, Provenance

NONSENSE = (
    "11",
    [1.0],
    (),
    {},
    object(),
    math.nan,
    math.inf,
    -1.0,
    1e400,
    True,
    2 + 1j,
    np.zeros((2, 2)),
    np.array("x"),
    b"",
    None,
)
ROV = load_vehicle("paper-tilting")
DRAFT = load_draft("paper-tilting")
RECORDS: list[Any] = [
    ROV,
    DRAFT,
    ROV.thrusters[0],
    DRAFT.thrusters[0],
    ROV.hydrodynamics,
    ROV.tilt,
    ROV.drag_cases[0],
    ROV.curve,
    LeastThrust(forward_N=1.0, reverse_N=1.0),
    ROV.provenance[0],
]


def kinds() -> list[tuple[Any, str]]:
    return [(record, field.name) for record in RECORDS for field in fields(record)]


@pytest.mark.parametrize(
    ("record", "field"), kinds(), ids=lambda value: value if isinstance(value, str) else type(value).__name__
)
def test_any_value_in_any_field_is_taken_or_refused_by_its_name(record: Any, field: str) -> None:
    for value in NONSENSE:
        try:
            replace(record, **{field: value})
        except InputError as fault:
            named = str(fault).replace("_", " ")
            short = field.replace("_", " ").removesuffix(" rad s").removesuffix(" rad")
            words = {short.split(" ")[0], short.split(" ")[-1]} | ({"range"} if short in ("low", "high") else set())
            assert any(word in named for word in words), f"{field}: {fault}"
            assert "\n" not in str(fault)


@pytest.mark.parametrize(
    ("record", "field", "value"),
    [
        (ROV, "mass_kg", "11"),
        (ROV, "mass_kg", True),
        (ROV, "displaced_volume_m3", [0.01]),
        (ROV, "size_m", "box"),
        (ROV, "size_m", [[1.0], [2.0, 3.0]]),
        (ROV, "hydrodynamics", None),
        (ROV, "hydrodynamics", "none"),
        (ROV, "thrusters", list(ROV.thrusters)),
        (ROV, "thrusters", ("T1",)),
        (ROV, "X_BC", [0.0] * 6),
        (ROV, "tilt", 0.3),
        (ROV, "curve", "t200"),
        (ROV, "least_thrust", 0.4),
        (ROV, "drag_cases", "box"),
        (ROV, "provenance", ["me"]),
        (ROV, "name", 3),
        (ROV, "camera_fov_rad", 4.0),
        (ROV.thrusters[0], "max_forward_N", [51.0]),
        (ROV.thrusters[0], "max_reverse_N", "40"),
        (ROV.thrusters[0], "disk_area_m2", 0.0),
        (ROV.thrusters[0], "time_constant_s", -0.1),
        (ROV.thrusters[0], "axis_B", "up"),
        (ROV.thrusters[0], "name", None),
        (DRAFT.thrusters[0], "max_forward_N", [51.0]),
        (DRAFT, "mass_kg", "11"),
        (DRAFT, "thrusters", ROV.thrusters),
        (ROV.curve, "supply_V", "16"),
        (LeastThrust(forward_N=1.0, reverse_N=1.0), "forward_N", -1.0),
        (ROV.tilt, "rate_rad_s", "fast"),
        (ROV.tilt, "low_rad", None),
        (ROV.provenance[0], "estimate", "yes"),
        (ROV.hydrodynamics, "added_mass", "six"),
    ],
)
def test_what_no_vehicle_has_is_refused(record: Any, field: str, value: object) -> None:
    with pytest.raises(InputError):
        replace(record, **{field: value})


def test_all_records_of_a_vehicle_are_among_those_tried() -> None:
    tried = {type(record) for record in RECORDS}
    assert tried == {
        *(Vehicle, VehicleDraft, Thruster, ThrusterDraft, Hydrodynamics, TiltJoint, DragCase),
        *(CurveChoice, LeastThrust, Provenance),
    }
