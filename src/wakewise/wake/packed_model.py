"""The wake model and the region as a table for the planner's kernels, with an edge that gradients can follow."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array, frozen
from wakewise.core.errors import InputError
from wakewise.core.interfaces import WakeModel
from wakewise.wake.cones import PaperJet, PowerJet
from wakewise.wake.jets import AxialJet
from wakewise.wake.kernels import PRINTED_CONE, ROUND_JET, own_constants
from wakewise.wake.wall_jet import ImpingingJet

PLAIN_CONE = 10
"""Kind of the cone with the paper's powers, of any gain and edge: it needs neither logarithm nor branch."""


class PackedWakeModel(NamedTuple):
    """A wake model over a region as the kernels take it.

    points : (3, P) in W; weights : (P,), their sum is 1; roots : (P,), roots of the weights; middle, radius : sphere
    round the points; positions, axes : (n, 3) in B; areas : (n,); own : (n, 6), numbers : (7,), see
    `wakewise.wake.kernels`; floor : (2,), used if `walls`.
    """

    points: Array
    rows: Array
    weights: Array
    roots: Array
    middle: Array
    radius: float
    positions: Array
    axes: Array
    areas: Array
    own: Array
    kind: int
    numbers: Array
    walls: bool
    floor: Array
    coherent: bool
    smooth_N: float


def wake_table(
    wake: WakeModel,
    points_W_m: Array,
    weights: Array,
    positions_B_m: Array,
    axes_B: Array,
    areas_m2: Array,
    *,
    superposition: str,
    smooth_N: float,
) -> PackedWakeModel:
    """Table of a wake model over weighted points; arguments as for `wakewise.wake.gram_with_derivatives`.

    Raises
    ------
    InputError
        If the model is not one of `wakewise.wake`, or there are no points with weight.
    """
    floor = wake if isinstance(wake, ImpingingJet) else None
    jet = floor.jet if floor is not None else wake
    if not isinstance(jet, AxialJet):
        raise InputError(f"wake model {wake.name}: has no derivatives, allowed: the models of wakewise.wake")
    law = jet.law
    numbers = np.array(law.parameters)
    plain = law.kind == PRINTED_CONE or (law.kind != ROUND_JET and tuple(numbers[1:4]) == (2.0, 4.0, 0.0))
    points = np.array(points_W_m, dtype=np.float64)
    total = float(np.sum(weights)) if len(weights) else 0.0
    if not (np.isfinite(total) and total > 0.0 and np.all(np.asarray(weights) >= 0.0)):
        raise InputError("region: needs points with weights that are not negative, and at least one more than 0")
    share = np.array(weights, dtype=np.float64) / total
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    areas = frozen(
        areas_m2, (None,), "areas"
    )  # read-only as a vehicle's are, so that kernels are compiled for one kind
    return PackedWakeModel(
        points=np.ascontiguousarray(points.T),
        rows=points,
        weights=share,
        roots=np.sqrt(share),
        middle=middle,
        radius=float(np.linalg.norm(points - middle, axis=1).max()),
        positions=np.array(positions_B_m),
        axes=np.array(axes_B),
        areas=areas,
        own=own_constants(law.kind, numbers, areas),
        kind=PLAIN_CONE if plain and floor is None else int(law.kind),
        numbers=numbers,
        walls=floor is not None,
        floor=np.array(floor.numbers) if floor is not None else np.zeros(2),
        coherent=superposition == "coherent",
        smooth_N=float(smooth_N),
    )


def is_compiled(wake: WakeModel) -> bool:
    """Whether the kernels know a model; they do those of this room, with or without a floor."""
    return isinstance(wake.jet if isinstance(wake, ImpingingJet) else wake, AxialJet)


def with_smooth_edge(wake: WakeModel, edge_width_rad: float) -> WakeModel:
    """The same model with an edge of that width if it is a cone with a sharp edge, which no gradient can follow."""
    if isinstance(wake, ImpingingJet):
        jet = with_smooth_edge(wake.jet, edge_width_rad)
        return replace(wake, jet=jet) if isinstance(jet, AxialJet) else wake
    if isinstance(wake, PaperJet):
        return PowerJet(label=wake.name, water_density_kg_m3=wake.water_density_kg_m3, edge_width_rad=edge_width_rad)
    if isinstance(wake, PowerJet) and wake.edge_width_rad == 0.0:
        return replace(wake, edge_width_rad=edge_width_rad)
    return wake
