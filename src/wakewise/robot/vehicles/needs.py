"""What a vehicle needs for a flight: its fields in words, and by the names that a vehicle file has for them."""

from __future__ import annotations

from typing import TypeVar

from wakewise.core.errors import InputError

T = TypeVar("T")

PLACEHOLDER = "_"
"""What a vehicle file has in place of a number that is to be filled in."""

VEHICLE_WORDS = {
    "size_m": ("size", ("body.size_m",)),
    "mass_kg": ("mass", ("body.mass_kg",)),
    "inertia_kg_m2": ("inertia", ("inertia.moments_kg_m2",)),
    "displaced_volume_m3": ("displaced volume", ("buoyancy.displaced_volume_m3",)),
    "p_BG_m": ("centre of gravity", ("buoyancy.centre_of_gravity_m",)),
    "p_BB_m": ("centre of buoyancy", ("buoyancy.centre_of_buoyancy_m",)),
    "added_mass": ("added mass", ("added_mass.translation_kg", "added_mass.rotation_kg_m2")),
    "linear_damping": ("linear damping", ("damping.linear_N_s_m", "damping.linear_N_m_s")),
    "quadratic_damping": ("quadratic damping", ("damping.quadratic_N_s2_m2", "damping.quadratic_N_m_s2")),
    "X_BC": ("camera mount", ("camera_mount.position_m", "camera_mount.roll_pitch_yaw_deg")),
    "camera_fov_rad": ("camera field of view", ("camera_lens.horizontal_fov_deg",)),
}
"""What a flight needs, in words and as fields of a vehicle file."""

THRUSTER_FIELDS = {
    "max_forward_N": "thruster_limits.max_forward_N",
    "max_reverse_N": "thruster_limits.max_reverse_N",
    "disk_area_m2": "thruster_disk.diameter_m",
    "time_constant_s": "thruster_lag.time_constant_s",
}

NEEDED_FIELDS = (
    *(field for _, fields in VEHICLE_WORDS.values() for field in fields),
    *("thruster_layout.mounts", *THRUSTER_FIELDS.values()),
)
"""Fields of a vehicle file without which nothing flies, dotted; those of thrusters may stand at each mount instead."""

THRUSTER_WORDS = {
    "max_forward_N": "forward limit",
    "max_reverse_N": "reverse limit",
    "disk_area_m2": "disk",
    "time_constant_s": "lag",
}


def required(value: T | None) -> T:
    """A value that was found to be there."""
    if value is None:
        raise InputError("vehicle: is not whole")
    return value
