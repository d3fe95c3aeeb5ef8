"""Reference cases by name: the shipped ones, opposed, crossing and parallel jets, jets past and onto boxes."""

from __future__ import annotations

import math
from dataclasses import replace

from wakewise.core.errors import InputError
from wakewise.simulation.lattice.cases import SHIPPED_CASES, DiskJet, LatticeCase

_FREE_BOX: tuple[tuple[float, float, float], tuple[float, float, float]] = ((-3.0, -5.5, -5.5), (11.0, 5.5, 5.5))


def _crossing_at(angle_deg: float, back_D: float, half_D: tuple[float, float]) -> LatticeCase:
    """Jets that cross at an angle 6 D from both disks, the bisector along x, 9 D of it behind the crossing.

    `back_D` of the box lie before the crossing, and `half_D` on either side of it along y and z.
    """
    turn_deg = 0.5 * angle_deg
    x, y = (round(6.0 * f(math.radians(turn_deg)), 4) for f in (math.cos, math.sin))
    return LatticeCase(
        name=f"crossing-{angle_deg:g}",
        jets=(DiskJet(turn_deg=turn_deg), DiskJet(turn_deg=-turn_deg, position_D=(0.0, 2 * y, 0.0))),
        low_D=(x - back_D, y - half_D[0], -half_D[1]),
        high_D=(x + 9.0, y + half_D[0], half_D[1]),
        cells_per_D=8,
    )


def _past_box(name: str, gap_D: float, side_D: float) -> LatticeCase:
    """A jet along x whose axis runs so far above the top of a solid cube, z down, which begins 3 D from the disk."""
    half = 0.5 * side_D
    return LatticeCase(
        name=name,
        jets=(DiskJet(),),
        low_D=(-3.0, -5.0, -5.0),
        high_D=(13.0, 5.0, 7.0),
        cells_per_D=8,
        boxes_D=(((3.0, -half, gap_D), (3.0 + side_D, half, gap_D + side_D)),),
    )


def _cases() -> dict[str, LatticeCase]:
    plain = DiskJet()
    return {
        case.name: case
        for case in (
            LatticeCase(
                name="long",
                jets=(plain,),
                low_D=(-3.0, -5.5, -5.5),
                high_D=(17.0, 5.5, 5.5),
                cells_per_D=7,
                develop=70.0,
                average=150.0,
            ),
            LatticeCase(
                name="stop",
                jets=(replace(plain, stop=40.0),),
                average=10.0,
                cells_per_D=6,
                low_D=_FREE_BOX[0],
                high_D=_FREE_BOX[1],
            ),
            LatticeCase(
                name="twin",
                jets=(replace(plain, position_D=(0.0, -2 / 3, 0.0)), replace(plain, position_D=(0.0, 2 / 3, 0.0))),
                cells_per_D=6,
                low_D=(-3.0, -5.0, -4.0),
                high_D=(15.0, 5.0, 4.0),
            ),
            LatticeCase(
                name="head-on",
                jets=(plain, replace(plain, position_D=(10.0, 0.0, 0.0), along=-1)),
                low_D=(-3.0, -6.0, -6.0),
                high_D=(13.0, 6.0, 6.0),
                sponge_D=1.0,
                cells_per_D=6,
            ),
            LatticeCase(
                name="crossing",
                jets=(plain, replace(plain, axis="y", position_D=(6.0, -6.0, 0.0))),
                low_D=(-3.0, -9.0, -5.0),
                high_D=(15.0, 9.0, 5.0),
                cells_per_D=8,
            ),
            _crossing_at(40.0, 9.0, (6.0, 5.0)),
            _crossing_at(110.0, 8.0, (8.0, 6.0)),
            _past_box("past-box", 1.0, 4.0),
            _past_box("grazing-box", 0.5, 4.0),
            _past_box("grazing-target", 0.5, 2.5),
            _past_box("struck-target", -1.25, 2.5),
            LatticeCase(
                name="four",
                jets=(replace(plain, strength=4.0),),
                cells_per_D=6,
                low_D=_FREE_BOX[0],
                high_D=_FREE_BOX[1],
            ),
        )
    }


CASES = SHIPPED_CASES | _cases()
"""Cases by name. `twin`: 8 cm apart for D = 60 mm; `head-on`: 0.6 m apart; `crossing`: at right angles, 0.36 m
from both disks, and at 40 and 110 degrees; `past-box`, `grazing-box`, `grazing-target`: one diameter and half of one
beside a cube of 0.24 m, and half of one beside one of 0.15 m; `struck-target`: square on that one; `four`: four times
the thrust."""


def find_case(name: str) -> LatticeCase:
    """Look a case up.

    Raises InputError if there is none of that name.
    """
    if name not in CASES:
        raise InputError(f"lattice case {name!r}: no such case, allowed {', '.join(CASES)}")
    return CASES[name]
