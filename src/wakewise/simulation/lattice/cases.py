"""Cases of the lattice Boltzmann reference: declarative records of jets in a box, in units of the jet.

Lengths are in exit diameters D, speeds in U0 = sqrt(T / (rho A)), the exit speed of a ducted jet of area A, so one run
holds for all thrusts and diameters. The Reynolds number U0 D / nu is 36,000 for 1 N on 60 mm; turbulent jets above
10,000 hardly depend on it (Dimotakis 2000, doi:10.1017/S0022112099007946), and the runs use 10,000. Thrusts below 0.1 N
are not covered.

The thruster is an open actuator disk of twice the exit area, without its duct. By momentum theory its slipstream
contracts to half the disk's area and reaches sqrt(2 T / (rho 2 A)) = U0. The body force acts on a disk of diameter
sqrt(2) D, and from one diameter downstream the flow is that of the ducted exit; nearer, it is wider and slower.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass, replace

from wakewise.core.errors import InputError

_Corner = tuple[float, float, float]

SOLVER = "d3q19-regularised-2"
"""Version of solver and disk; part of every hash, so raise it when a change of the code changes the flow."""

AXES = ("x", "y", "z")
"""What the axis of a disk may be called."""

T200_TORQUE = 0.15
"""Torque over thrust and diameter, Q / (T D), of a small ducted propeller.

Blue Robotics' table of the T200 (September 2019, 12 and 16 V, 76 mm) gives electrical power / (2 pi n) = 0.19 to 0.26
T D forwards, 0.20 to 0.22 at 4 to 8 N; of this a brushless motor with its controller turns some 70 % into shaft torque
(assumed). Ducted screws of the Ka series lie lower, near 0.09, so take the swirl here as that of a strong case.
"""


@dataclass(frozen=True, kw_only=True)
class DiskJet:
    """One actuator disk."""

    # Centre of the disk, the origin being the disk of the case's first jet.
    position_D: tuple[float, float, float] = (0.0, 0.0, 0.0)
    along: int = 1  # +1 or -1: the jet blows along plus or minus its axis
    strength: float = 1.0  # momentum flux over that of a jet with exit speed U0: thrust over the unit thrust
    torque: float = 0.0  # Q / (T D), turning the water about the axis; 0 for a jet without swirl
    axis: str = "x"  # X, y or z
    # start, stop: when it pushes, in D / U0.
    start: float = 0.0
    stop: float = float("inf")
    turn_deg: float = 0.0  # how far its axis, x, is turned about z, towards y

    @property
    def direction(self) -> tuple[float, float, float]:
        """Unit vector along which it blows."""
        turn = math.radians(self.turn_deg)
        way = [math.cos(turn), math.sin(turn), 0.0]
        shift = AXES.index(self.axis)
        x, y, z = (self.along * way[(k - shift) % 3] for k in range(3))
        return x, y, z


@dataclass(frozen=True, kw_only=True)
class LatticeCase:
    """Jets in a box of still water with open faces, perhaps a floor that the first jet strikes, and solid boxes."""

    name: str
    jets: tuple[DiskJet, ...]
    # low_D, high_D: corners of the box; every side must be a whole number of cells.
    low_D: tuple[float, float, float]
    high_D: tuple[float, float, float]
    floor: bool = False  # whether the face at high x is a solid floor (half-way bounce-back); the others are open
    # Thickness of the sponge before the open face at high x, in which viscosity grows; before the other open faces,
    # where water comes in slowly, it is one diameter.
    sponge_D: float = 1.5
    cells_per_D: int = 10
    # develop, average: time before and during averaging, in D / U0.
    develop: float = 40.0
    average: float = 80.0
    reynolds: float = 1.0e4  # U0 D / nu
    smagorinsky: float = 0.12  # smagorinsky's constant with the cell as filter width
    lattice_speed: float = 0.15  # U0 in cells per step; small against the lattice's speed of sound, 0.577
    # Rms of the disk's load over its mean, in patches of about D / 4 that live D / (2 U0): blades do not push evenly,
    # and a disk that did would send a laminar core.
    unsteadiness: float = 0.15
    seed: int = 0
    # Solid boxes in the water, low and high corner of each: cells whose middles they hold (half-way bounce-back).
    boxes_D: tuple[tuple[_Corner, _Corner], ...] = ()

    def __post_init__(self) -> None:
        if self.cells_per_D < 4:
            raise InputError(f"lattice case {self.name!r}: {self.cells_per_D} cells per diameter, allowed 4 or more")
        if not self.jets:
            raise InputError(f"lattice case {self.name!r}: no jets, allowed one or more")
        for jet in self.jets:
            if jet.along not in (-1, 1):
                raise InputError(f"lattice case {self.name!r}: jet along {jet.along}, allowed +1 or -1")
            if jet.axis not in AXES:
                raise InputError(f"lattice case {self.name!r}: axis {jet.axis!r} of a jet, allowed {', '.join(AXES)}")
            if jet.turn_deg and jet.axis != "x":
                raise InputError(f"lattice case {self.name!r}: a turned jet along {jet.axis}, allowed x")
        if self.jets[0].axis != "x":
            raise InputError(f"lattice case {self.name!r}: axis {self.jets[0].axis!r} of the first jet, allowed x")
        for low, high in zip(self.low_D, self.high_D, strict=True):
            cells = (high - low) * self.cells_per_D
            if cells < 12 or abs(cells - round(cells)) > 1e-6:
                raise InputError(
                    f"lattice case {self.name!r}: a side of {cells:g} cells, allowed whole numbers from 12"
                )
        for corners in self.boxes_D:
            for a, b, low, high in zip(*corners, self.low_D, self.high_D, strict=True):
                if not low + 1.0 <= a < b <= high - 1.0:
                    raise InputError(
                        f"lattice case {self.name!r}: a solid box from {a:g} to {b:g} D, "
                        f"allowed from {low + 1:g} to {high - 1:g}"
                    )

    @property
    def cells(self) -> tuple[int, int, int]:
        """Cells along x, y and z."""
        n = [round((b - a) * self.cells_per_D) for a, b in zip(self.low_D, self.high_D, strict=True)]
        return n[0], n[1], n[2]

    def resolved(self, cells_per_D: int) -> LatticeCase:
        """The same case on another grid."""
        return replace(self, cells_per_D=cells_per_D)


def case_hash(case: LatticeCase) -> str:
    """Digest of everything that decides the flow: the case and the version of the solver."""
    stated = asdict(case)
    for jet in stated["jets"]:
        # Defaults are left out, so that hashes of older cases stay valid.
        if jet["axis"] == "x":
            del jet["axis"]
        if not jet["turn_deg"]:
            del jet["turn_deg"]
    if not case.boxes_D:
        del stated["boxes_D"]
    text = json.dumps({"solver": SOLVER, **stated}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


SHIPPED_CASES = {
    case.name: case
    for case in (
        LatticeCase(name="free", jets=(DiskJet(),), low_D=(-3.0, -5.5, -5.5), high_D=(11.0, 5.5, 5.5)),
        LatticeCase(
            name="swirl", jets=(DiskJet(torque=T200_TORQUE),), low_D=(-3.0, -5.5, -5.5), high_D=(11.0, 5.5, 5.5)
        ),
        LatticeCase(
            name="floor",
            jets=(DiskJet(),),
            low_D=(-3.0, -6.0, -6.0),
            high_D=(5.0, 6.0, 6.0),
            floor=True,
            cells_per_D=7,
            develop=60.0,
        ),
    )
}
"""Cases whose mean fields are in `data/`: a free jet, one with swirl, one that strikes a floor."""
