"""A vehicle in plain words and numbers, ready for JSON."""

from __future__ import annotations

import math
from typing import Any

from wakewise.vehicles.check import (
    WRENCH_AXES,
    achievable_wrench,
    allocation_rank,
    failure_rank,
    null_space_names,
)
from wakewise.vehicles.vehicle import Vehicle

WATER_DENSITY_KG_M3 = 1000.0
GRAVITY_M_S2 = 9.80665


def describe(vehicle: Vehicle) -> dict[str, Any]:
    """Say what a vehicle is and can do: thrusters, rank, null space, limits, achievable wrench, sources.

    The achievable wrench is pure: the largest along one axis with every other component zero. Trim is for fresh water
    of 1000 kg/m3 and standard gravity, positive when the vehicle floats.
    """
    wrench = achievable_wrench(vehicle)
    net_kg = WATER_DENSITY_KG_M3 * vehicle.displaced_volume_m3 - vehicle.mass_kg
    return {
        "name": vehicle.name,
        "title": vehicle.title,
        "source": vehicle.source,
        "does_not_claim": vehicle.does_not_claim,
        "size_m": vehicle.size_m.tolist(),
        "mass_kg": vehicle.mass_kg,
        "trim_N": round(net_kg * GRAVITY_M_S2, 9),
        "camera_fov_deg": math.degrees(vehicle.camera_fov_rad),
        "thrusters": [
            {
                "number": number,
                "name": t.name,
                "position_m": t.p_BT_m.tolist(),
                "axis": t.axis_B.tolist(),
                "max_forward_N": t.max_forward_N,
                "max_reverse_N": t.max_reverse_N,
                "disk_area_m2": t.disk_area_m2,
                "time_constant_s": t.time_constant_s,
                "rank_without": rank,
            }
            for number, (t, rank) in enumerate(zip(vehicle.thrusters, failure_rank(vehicle), strict=True), start=1)
        ],
        "allocation_matrix": vehicle.allocation_matrix.tolist(),
        "rank": allocation_rank(vehicle),
        "null_space": [
            {"name": name, "thrusts": column.round(12).tolist()}
            for name, column in zip(null_space_names(vehicle), vehicle.null_space.T, strict=True)
        ],
        "limits_N": {"lower": vehicle.thrust_lower_N.tolist(), "upper": vehicle.thrust_upper_N.tolist()},
        "achievable_wrench": {
            axis: {"unit": "N" if i < 3 else "N m", "lowest": float(wrench[i, 0]), "highest": float(wrench[i, 1])}
            for i, axis in enumerate(WRENCH_AXES)
        },
        "provenance": [{"group": p.group, "source": p.source, "estimate": p.estimate} for p in vehicle.provenance],
    }
