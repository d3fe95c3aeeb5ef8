"""What a file says about a vehicle: like `Vehicle`, but None wherever the file says nothing, so nothing is invented.

What a vehicle needs for a flight: its fields in words, and by the names that a vehicle file has for them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, frozen
from wakewise.core.checks import instance_of
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.settings import Faults
from wakewise.robot.thrusters.thruster import Thruster, mount, require_limit
from wakewise.robot.vehicles.hydrodynamics import (
    DragCase,
    Hydrodynamics,
    require_added_mass,
    require_linear_damping,
    require_quadratic_damping,
)
from wakewise.robot.vehicles.vehicle import (
    CurveChoice,
    LeastThrust,
    Provenance,
    TiltJoint,
    Vehicle,
    readable_null_space,
    require_different_names,
    require_fov,
    require_inertia,
    require_kinds,
    require_positive,
    require_size,
    thrust_steps,
    tuple_of,
)

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


ROUNDING = 1e-3
"""Largest asymmetry of an added mass, relative to its largest element, that passes as rounding in the file."""

MAX_THRUSTERS = 64
"""More than any vehicle has; beyond it a file is a mistake, and the checks of single failures take for ever."""

_CHECKS: dict[str, Callable[[Array], None]] = {
    "size_m": require_size,
    "inertia_kg_m2": require_inertia,
    "added_mass": require_added_mass,
    "linear_damping": require_linear_damping,
    "quadratic_damping": require_quadratic_damping,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrusterDraft:
    """What a file says about one thruster.

    `p_BT_m`, shape (3,): centre of the disk from the body origin, FRD. `axis_B`, shape (3,): direction of the force on
    the vehicle for positive thrust, FRD; normalised here. `max_forward_N`, `max_reverse_N`, `disk_area_m2`,
    `time_constant_s`: as in `Thruster`; None where the file says nothing. Raises InputError where `Thruster` would
    refuse the value.
    """

    name: str
    p_BT_m: Array
    axis_B: Array
    max_forward_N: float | None = None
    max_reverse_N: float | None = None
    disk_area_m2: float | None = None
    time_constant_s: float | None = None

    def __post_init__(self) -> None:
        mount(self)
        for field in THRUSTER_WORDS:
            value = getattr(self, field)
            if value is not None:
                require_limit(f"thruster {self.name}", field, value)

    @property
    def wrench_per_newton_B(self) -> Array:
        """Force and moment about the body origin that one newton of thrust makes, shape (6,)."""
        return np.concatenate([self.axis_B, np.cross(self.p_BT_m, self.axis_B)])


@dataclass(frozen=True, kw_only=True, eq=False)
class VehicleDraft:
    """What a file says about a vehicle, in the units and the body frame (FRD) of `Vehicle`.

    `size_m` has shape (3,). `inertia_kg_m2`, shape (3, 3): about the centre of gravity. `p_BG_m`, `p_BB_m`, shape (3,):
    centre of gravity and centre of buoyancy. `added_mass`, `linear_damping`, `quadratic_damping`, shape (6, 6):
    positive magnitudes in Fossen's order, as in `Hydrodynamics`. `thrusters`: may be empty where the file holds only a
    matrix. `shipped_matrix`, shape (6, n): allocation matrix as the file states it, turned to FRD. `curve`: table of
    thrust against pulse width, if the file names one. `least_thrust`: least thrusts, if the file states them. `tilt`:
    the camera's joint, if the file states one. `notes`: what was detected, inferred or found odd while reading. Raises
    InputError: where `Vehicle`, `Thruster` or `Hydrodynamics` would refuse a value that is there.

    An added mass whose halves differ by no more than rounding (a thousandth of its largest element) is replaced by the
    mean of the two, and a note says so.
    """

    name: str
    title: str
    source: str
    does_not_claim: str
    size_m: Array | None = None
    mass_kg: float | None = None
    inertia_kg_m2: Array | None = None
    displaced_volume_m3: float | None = None
    p_BG_m: Array | None = None
    p_BB_m: Array | None = None
    added_mass: Array | None = None
    linear_damping: Array | None = None
    quadratic_damping: Array | None = None
    thrusters: tuple[ThrusterDraft, ...] = ()
    shipped_matrix: Array | None = None
    curve: CurveChoice | None = None
    least_thrust: LeastThrust | None = None
    drag_cases: tuple[DragCase, ...] = ()
    X_BC: Pose | None = None
    tilt: TiltJoint | None = None
    camera_fov_rad: float | None = None
    provenance: tuple[Provenance, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_kinds(self)
        tuple_of(self.thrusters, ThrusterDraft, "thrusters")
        if self.X_BC is not None:
            instance_of(self.X_BC, Pose, "X_BC")
        faults = Faults()
        for field, shape in (
            ("size_m", (3,)),
            ("inertia_kg_m2", (3, 3)),
            ("p_BG_m", (3,)),
            ("p_BB_m", (3,)),
            ("added_mass", (6, 6)),
            ("linear_damping", (6, 6)),
            ("quadratic_damping", (6, 6)),
            ("shipped_matrix", (6, None)),
        ):
            with faults.gathered():
                self._freeze(field, shape)
        for field in ("mass_kg", "displaced_volume_m3"):
            with faults.gathered():
                if getattr(self, field) is not None:
                    require_positive(field, getattr(self, field))
        with faults.gathered():
            if self.camera_fov_rad is not None:
                require_fov(self.camera_fov_rad)
        with faults.gathered():
            thrust_steps(self.curve, self.least_thrust)
        with faults.gathered():
            require_different_names([t.name for t in self.thrusters])
        with faults.gathered():
            self._check_count()
        faults.tell()

    def _freeze(self, field: str, shape: tuple[int | None, ...]) -> None:
        """Check an array, if there is one, as `Vehicle` and `Hydrodynamics` do."""
        if getattr(self, field) is None:
            return
        object.__setattr__(self, field, frozen(getattr(self, field), shape, field))
        if field == "added_mass":
            self._round_added_mass()
        if field in _CHECKS:
            _CHECKS[field](getattr(self, field))

    def _check_count(self) -> None:
        n = len(self.thrusters)
        if n > MAX_THRUSTERS:
            raise InputError(f"{n} thrusters, at most {MAX_THRUSTERS} are read")
        shape = np.shape(self.shipped_matrix) if isinstance(self.shipped_matrix, np.ndarray) else ()
        if len(shape) == 2 and n and shape[1] != n:
            raise InputError(f"shipped_matrix: shape {shape}, allowed (6, {n}), one per thruster")

    @classmethod
    def of(cls, vehicle: Vehicle) -> VehicleDraft:
        """A whole vehicle as a draft with nothing missing."""
        values = _shared_values(vehicle, cls) | _shared_values(vehicle.hydrodynamics, cls)
        values["thrusters"] = tuple(ThrusterDraft(**_shared_values(t, ThrusterDraft)) for t in vehicle.thrusters)
        return cls(**values)

    def _round_added_mass(self) -> None:
        """Take the mean of two halves that differ by no more than rounding, and say so."""
        if self.added_mass is None:
            return
        skew = float(np.abs(self.added_mass - self.added_mass.T).max())
        if 0.0 < skew <= ROUNDING * float(np.abs(self.added_mass).max()):
            mean = frozen(0.5 * (self.added_mass + self.added_mass.T), (6, 6), "added_mass")
            object.__setattr__(self, "added_mass", mean)
            note = f"added mass: entries differ from their mirror image by up to {skew:.3g}, the mean is taken"
            object.__setattr__(self, "notes", (*self.notes, note))

    @cached_property
    def missing(self) -> tuple[str, ...]:
        """What the file would have to hold for the vehicle to fly, in words; empty if it is all there."""
        found = [word for field, (word, _) in VEHICLE_WORDS.items() if getattr(self, field) is None]
        if not self.thrusters:
            return (*found, "thruster places and axes", *(f"thruster {word}" for word in THRUSTER_WORDS.values()))
        for field, word in THRUSTER_WORDS.items():
            lacking = [str(i) for i, t in enumerate(self.thrusters, start=1) if getattr(t, field) is None]
            if len(lacking) == len(self.thrusters):
                found.append(f"thruster {word}")
            elif lacking:
                found.append(f"thruster {word} (of thruster {', '.join(lacking)})")
        return tuple(found)

    @property
    def missing_fields(self) -> tuple[str, ...]:
        """The same as dotted names of fields of a vehicle file."""
        found = [name for field, (_, names) in VEHICLE_WORDS.items() if getattr(self, field) is None for name in names]
        if not self.thrusters:
            return (*found, "thruster_layout.mounts", *THRUSTER_FIELDS.values())
        lacking = (field for field in THRUSTER_FIELDS if any(getattr(t, field) is None for t in self.thrusters))
        return (*found, *(THRUSTER_FIELDS[field] for field in lacking))

    def require_whole(self, called: str | None = None) -> None:
        """Refuse to fly what is incomplete.

        `called`: what the user calls the vehicle: a path; its name if not given. Raises InputError naming all that is
        missing, and how it is filled in.
        """
        if self.missing:
            raise InputError(
                f"vehicle {called or self.name}: cannot fly, its file does not hold {', '.join(self.missing)}; "
                f"fill in {', '.join(self.missing_fields)} (docs/vehicle-file.md), or let "
                f"`wakewise vehicle import {called or self.name} --like NAME --out FILE` estimate them"
            )

    @cached_property
    def allocation_matrix(self) -> Array:
        """Wrench about the body origin per newton, shape (6, n): from the geometry, else the one the file ships.

        Raises InputError if the file holds neither.
        """
        if self.thrusters:
            return frozen(np.stack([t.wrench_per_newton_B for t in self.thrusters], axis=1), (6, None), "matrix")
        if self.shipped_matrix is None:
            doubts = [note.partition(": ")[2] for note in self.notes if note.startswith("QUESTIONED: ")]
            why = f" ({'; '.join(doubts[:3])})" if doubts else ""
            raise InputError(f"vehicle {self.name}: neither thrusters nor an allocation matrix{why}")
        return self.shipped_matrix

    @cached_property
    def null_space(self) -> Array:
        """Thrusts that make no wrench, as orthonormal columns, shape (n, k)."""
        return frozen(readable_null_space(self.allocation_matrix), (None, None), "null_space")

    @property
    def thruster_names(self) -> tuple[str, ...]:
        """One name per column of the allocation matrix; numbers from 1 where the file names none."""
        if self.thrusters:
            return tuple(t.name for t in self.thrusters)
        return tuple(str(number) for number in range(1, self.allocation_matrix.shape[1] + 1))

    @property
    def thrust_limits_N(self) -> tuple[Array, Array] | None:
        """Lowest and highest thrusts, each of shape (n,); None where a thruster has no stated limits."""
        if not self.thrusters:
            return None
        low, high = [], []
        for thruster in self.thrusters:
            if thruster.max_forward_N is None or thruster.max_reverse_N is None:
                return None
            low.append(-thruster.max_reverse_N)
            high.append(thruster.max_forward_N)
        return np.array(low), np.array(high)

    def vehicle(self) -> Vehicle:
        """Turn a complete draft into a vehicle that can fly.

        Raises InputError if something is missing; the message lists it.
        """
        self.require_whole()
        values = _shared_values(self, Vehicle)
        values["hydrodynamics"] = Hydrodynamics(**_shared_values(self, Hydrodynamics))
        values["thrusters"] = tuple(Thruster(**_shared_values(t, Thruster)) for t in self.thrusters)
        return Vehicle(**values)


def _shared_values(record: Any, kind: type[Any]) -> dict[str, Any]:
    """Values of a record under the fields that another kind of record has too."""
    return {field.name: getattr(record, field.name) for field in fields(kind) if hasattr(record, field.name)}
