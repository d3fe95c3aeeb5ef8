"""A vehicle as plain numbers for the wash meter: thrusters, thrust curve and wake model (craft file).

A larger computer writes the JSON file (`VehicleSummary.of`, `vehicle_summary_json`) for the computer on the vehicle,
because vehicle files, thrust tables and wake models have readers that need more than NumPy.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_curve import CurveSide, ThrustCurve
from wakewise.wake.jets import AxialJet, JetLaw
from wakewise_ardusub.logs.channels import SERVOS

if TYPE_CHECKING:
    from wakewise.core.interfaces import WakeModel
    from wakewise.robot.vehicles import Vehicle

FORMAT = "wakewise craft 1"


@dataclass(frozen=True, kw_only=True, eq=False)
class KernelJet(AxialJet):
    """A wake model as the kernels know it: its name, which kernel (`wakewise.wake.jets`), and its numbers."""

    label: str
    kind: int
    numbers: Array

    def __post_init__(self) -> None:
        if self.kind not in (0, 1, 2):
            raise InputError(f"wake model {self.label}: kernel {self.kind}, allowed 0, 1 or 2")
        freeze(self, numbers=(7,))

    @property
    def name(self) -> str:
        """Name used in files and tables."""
        return self.label

    @property
    def law(self) -> JetLaw:
        """Kernel and numbers."""
        return JetLaw(self.kind, self.numbers)


@dataclass(frozen=True, kw_only=True, eq=False)
class VehicleSummary:
    """A vehicle with m thrusters; body frame FRD.

    Parameters
    ----------
    name : str
    thrusters : tuple of str
        Names, in the order of the autopilot's motors.
    allocation_matrix : ndarray, shape (6, m)
        Wrench about the body origin per newton.
    positions_B_m, axes_B : ndarray, shape (m, 3)
        Centres of the disks, and unit directions of the force for positive thrust.
    areas_m2, thrust_lower_N, thrust_upper_N : ndarray, shape (m,)
        Disk areas and limits.
    bow_m, camera_z_m : float
        Front of the vehicle's box ahead of the body origin, and the camera's height below it.
    wake : WakeModel
        A `KernelJet` where it came from a file.
    curve : ThrustCurve or None
        Pulse to thrust; without one it goes in proportion to the limits.
    supply_V : float
        What the vehicle file says of the battery, for while the autopilot says nothing.

    Raises
    ------
    InputError
        If shapes do not belong together, a number is not finite, or there are more than 16 thrusters.
    """

    name: str
    thrusters: tuple[str, ...]
    allocation_matrix: Array
    positions_B_m: Array
    axes_B: Array
    areas_m2: Array
    thrust_lower_N: Array
    thrust_upper_N: Array
    bow_m: float
    camera_z_m: float
    wake: WakeModel
    curve: ThrustCurve | None = None
    supply_V: float = 0.0

    def __post_init__(self) -> None:
        m = len(self.thrusters)
        if not 1 <= m <= SERVOS:
            raise InputError(f"vehicle {self.name}: {m} thrusters, 1 to {SERVOS} servo outputs are known")
        freeze(self, allocation_matrix=(6, m), positions_B_m=(m, 3), axes_B=(m, 3))
        freeze(self, areas_m2=(m,), thrust_lower_N=(m,), thrust_upper_N=(m,))

    @classmethod
    def of(cls, vehicle: Vehicle, wake: WakeModel) -> VehicleSummary:
        """The numbers of a vehicle and of the wake model that its jets are believed to follow."""
        from wakewise.robot.thrusters.thrust_table import library_curve

        chosen = vehicle.curve
        return cls(
            name=vehicle.name,
            thrusters=tuple(thruster.name for thruster in vehicle.thrusters),
            allocation_matrix=vehicle.allocation_matrix,
            positions_B_m=vehicle.thruster_positions_B_m,
            axes_B=vehicle.thruster_axes_B,
            areas_m2=vehicle.disk_areas_m2,
            thrust_lower_N=vehicle.thrust_lower_N,
            thrust_upper_N=vehicle.thrust_upper_N,
            bow_m=0.5 * float(vehicle.size_m[0]),
            camera_z_m=float(vehicle.X_BC.p_m[2]),
            wake=wake,
            curve=None if chosen is None else library_curve(chosen.table),
            supply_V=0.0 if chosen is None else chosen.supply_V,
        )

    @property
    def count(self) -> int:
        """How many thrusters."""
        return len(self.thrusters)


def vehicle_summary_json(craft: VehicleSummary) -> str:
    """The craft as JSON that `read_vehicle_summary` reads.

    Raises
    ------
    InputError
        If its wake model is none of free axial jets: only their numbers can be written down.
    """
    wake = craft.wake
    if not isinstance(wake, AxialJet):
        raise InputError(f"wake model {wake.name}: a small computer has free jets only, allowed: {', '.join(_SMALL)}")
    told: dict[str, Any] = {"format": FORMAT}
    for field in fields(craft):
        value = getattr(craft, field.name)
        told[field.name] = value.tolist() if isinstance(value, np.ndarray) else value
    told["wake"] = {"label": wake.name, "kind": int(wake.law.kind), "numbers": wake.law.parameters.tolist()}
    told["curve"] = None if craft.curve is None else _plain_curve(craft.curve)
    return json.dumps(told, separators=(",", ":")) + "\n"


def _plain_curve(curve: ThrustCurve) -> dict[str, Any]:
    sides = {"forward": curve.forward, "reverse": curve.reverse}
    told: dict[str, Any] = {"name": curve.name, "source": curve.source, "neutral_us": curve.neutral_us}
    told["supply_V"] = curve.supply_V.tolist()
    return told | {name: {part: getattr(side, part).tolist() for part in _SIDE} for name, side in sides.items()}


_SMALL = ("paper", "paper-calibrated", "fitted", "linear", "jet", "jet-fitted")


def read_vehicle_summary(path: Path) -> VehicleSummary:
    """Read a craft that was written by `vehicle_summary_json`.

    Raises
    ------
    InputError
        If the file cannot be read or is no such file; the message names the field.
    """
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read as a craft file, {fault}") from None
    if not isinstance(told, dict) or told.get("format") != FORMAT:
        found = told.get("format") if isinstance(told, dict) else type(told).__name__
        raise InputError(
            f"{path}: format {found!r}, a craft file has {FORMAT!r} (wakewise link wash-meter --write FILE)"
        )
    try:
        return _craft(told)
    except KeyError as fault:
        raise InputError(f"{path}: {fault.args[0]} is missing") from None
    except (InputError, TypeError, ValueError) as fault:
        raise InputError(f"{path}: {fault}") from None


def _craft(told: dict[str, Any]) -> VehicleSummary:
    wake = told["wake"]
    return VehicleSummary(
        name=str(told["name"]),
        thrusters=tuple(map(str, told["thrusters"])),
        allocation_matrix=_array(told["allocation_matrix"]),
        positions_B_m=_array(told["positions_B_m"]),
        axes_B=_array(told["axes_B"]),
        areas_m2=_array(told["areas_m2"]),
        thrust_lower_N=_array(told["thrust_lower_N"]),
        thrust_upper_N=_array(told["thrust_upper_N"]),
        bow_m=float(told["bow_m"]),
        camera_z_m=float(told["camera_z_m"]),
        wake=KernelJet(label=str(wake["label"]), kind=int(wake["kind"]), numbers=_array(wake["numbers"])),
        curve=None if told["curve"] is None else _curve(told["curve"]),
        supply_V=float(told["supply_V"]),
    )


def _curve(told: dict[str, Any]) -> ThrustCurve:
    return ThrustCurve(
        name=str(told["name"]),
        source=str(told["source"]),
        supply_V=_array(told["supply_V"]),
        neutral_us=float(told["neutral_us"]),
        forward=_side(told["forward"]),
        reverse=_side(told["reverse"]),
    )


def _side(told: dict[str, Any]) -> CurveSide:
    return CurveSide(**{name: _array(told[name]) for name in _SIDE})


def _array(value: Any) -> Array:
    return np.array(value, dtype=np.float64)


_SIDE = ("share", "silent_us", "first_us", "last_us", "thrust_N")
"""Of a curve; rotor speed and power are not asked for here."""
