"""Truth about one jet that pushes as a history says: rows of places, histories and velocities, dimensionless.

Everything is in the units of `wakewise.wake.learned`: lengths in D, velocities in sqrt(M*) / (R + D), so that the
tank's newtons and the lattice's own units are the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.interfaces import Progress, no_progress
from wakewise.simulation.lattice import DiskJet, LatticeCase, load_mean_field
from wakewise.simulation.water import Water
from wakewise.simulation.water.round_jet_closure import JetSpreading
from wakewise.wake.learned import EDGES, MEMORY_S, JetPoints, history_bins, remembered
from wakewise_paper.lattice_reference.reference_cases import CASES
from wakewise_paper.lattice_reference.run import LatticeRun

DIAMETER_M = 0.06
WIDTHS, LIVES = (0.094, 0.177), (1.0, 1.7)
"""What every world draws a jet's width and a wake's life from (`operation/worlds/library_data/_every.yaml`)."""
TURBULENCE = 0.25
THRUSTS_N = (0.05, 6.0)
"""Of drawn histories: from what a hover's correction takes to most of what the paper's vehicle gives."""
NEAR_D, FAR_D = 1.5, 20.0
"""Where samples lie: 9 cm to 1.2 m from the disk."""
STEP_S = 0.02
_DEVELOPED = 3.0
"""A jet is called even once the farthest sample has been reached for three times its t*."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TruthSamples:
    """Samples of one truth, n of them.

    Parameters
    ----------
    source : str
        Such as "parcels" or "lattice".
    points : JetPoints
    history : ndarray, shape (n, bins)
        Thrust in each bin of delay over the greatest that is remembered.
    now : ndarray, shape (n,)
        Thrust at the time over the greatest: all that a model without memory is told.
    f : ndarray, shape (n, 2)
        Velocity along and across the jet over sqrt(M*) / (R + D).
    steady : bool
        Whether the jet has pushed evenly for long.
    half_width_growth : float
        Of the water that it was; NaN where nobody set it.
    """

    source: str
    points: JetPoints
    history: Array
    now: Array
    f: Array
    steady: bool
    half_width_growth: float = math.nan

    def __len__(self) -> int:
        return len(self.f)


@dataclass(frozen=True, kw_only=True)
class SampledWater:
    """A water of the tank: width of its jets and life of its wakes."""

    half_width_growth: float
    wake_life: float

    @classmethod
    def of(cls, rng: np.random.Generator) -> SampledWater:
        """As a world draws it."""
        return cls(half_width_growth=float(rng.uniform(*WIDTHS)), wake_life=float(rng.uniform(*LIVES)))


def drawn_history(rng: np.random.Generator, duration_s: float) -> tuple[Array, Array]:
    """Thrusts that hold for half a second to ten, a third of them none; times, shape (k,), and thrusts, shape (k,)."""
    times, thrusts = [0.0], [_level(rng)]
    while times[-1] < duration_s:
        times.append(times[-1] + float(np.exp(rng.uniform(math.log(0.5), math.log(10.0)))))
        thrusts.append(0.0 if rng.random() < 1.0 / 3.0 and thrusts[-1] > 0.0 else _level(rng))
    return np.array(times[:-1]), np.array(thrusts[:-1])


def _level(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(THRUSTS_N))))


def drawn_points(rng: np.random.Generator, count: int) -> JetPoints:
    """Half of them in and about the jet, a quarter within 45 degrees of its axis, a quarter anywhere."""
    away = np.exp(rng.uniform(math.log(NEAR_D), math.log(FAR_D), count))
    kind = rng.random(count)
    cosine = np.where(kind < 0.75, rng.uniform(math.cos(math.pi / 4), 1.0, count), rng.uniform(-1.0, 1.0, count))
    angle = np.where(kind < 0.5, np.abs(rng.normal(0.0, 0.17, count)), np.arccos(cosine))
    return JetPoints(x_D=away * np.cos(angle), r_D=away * np.abs(np.sin(angle)))


def judged_points(rng: np.random.Generator, count: int) -> JetPoints:
    """Where a target may be: 0.2 to 1 m from a disk of 6 cm, evenly over the solid angle within 30 degrees."""
    away = rng.uniform(0.2 / DIAMETER_M, 1.0 / DIAMETER_M, count)
    angle = np.arccos(rng.uniform(math.cos(math.pi / 6), 1.0, count))
    return JetPoints(x_D=away * np.cos(angle), r_D=away * np.sin(angle))


def parcel_rows(
    drawn: SampledWater,
    rng: np.random.Generator,
    *,
    duration_s: float = 45.0,
    instants: int = 30,
    count: int = 60,
    judged: bool = False,
    likes: int = 1,
) -> TruthSamples:
    """Samples of the tank's water under a drawn history of one thruster, at drawn instants.

    `likes` waters that differ in their gusts alone are averaged.
    """
    times, thrusts = drawn_history(rng, duration_s)
    asked = np.sort(rng.uniform(2.0, duration_s, instants))
    draw = judged_points if judged else drawn_points
    places = [draw(rng, count) for _ in asked]
    velocity = _mean_run(drawn, times, thrusts, asked, places, rng.spawn(likes))
    parts = [_rows(times, thrusts, t, p, v) for t, p, v in zip(asked, places, velocity, strict=True)]
    return _joined([part for part in parts if part is not None], "parcels", False, drawn.half_width_growth)


def even_parcel_rows(
    drawn: SampledWater,
    rng: np.random.Generator,
    *,
    instants: int = 4,
    count: int = 400,
    judged: bool = False,
    likes: int = 1,
) -> TruthSamples:
    """Samples of the tank's water about a jet that has pushed evenly for long."""
    thrust = 1.0
    root = math.sqrt(thrust / FRESH_WATER_KG_M3)
    farthest = JetPoints(x_D=np.array([FAR_D]), r_D=np.zeros(1))
    developed = _DEVELOPED * float(farthest.delays()[0]) * DIAMETER_M**2 / root
    asked = np.asarray(developed + 2.0 * np.arange(instants), dtype=np.float64)
    draw = judged_points if judged else drawn_points
    places = [draw(rng, count) for _ in asked]
    times, thrusts = np.zeros(1), np.array([thrust])
    velocity = _mean_run(drawn, times, thrusts, asked, places, rng.spawn(likes))
    points = _stacked(places)
    scale = root / (DIAMETER_M * (points.away_D + 1.0))
    f = np.concatenate(velocity) / scale[:, None]
    return _even(points, f, "parcels", drawn.half_width_growth)


def even_lattice_rows(case: str, rng: np.random.Generator, count: int, *, judged: bool = False) -> TruthSamples:
    """Samples of the lattice's mean jet, within the box that was computed and a diameter behind the disk."""
    table = load_mean_field(case)
    points = (judged_points if judged else drawn_points)(rng, 4 * count)
    inside = (points.x_D > 1.0) & (points.x_D < table.x_D[-1]) & (points.r_D < table.r_D[-1])
    chosen = np.flatnonzero(inside)[:count]
    points = JetPoints(x_D=points.x_D[chosen], r_D=points.r_D[chosen])
    axial, radial = table.at(points.x_D, points.r_D, ("axial", "radial"))
    f = np.stack([axial, radial], axis=1) * ((points.away_D + 1.0) / _LATTICE_ROOT)[:, None]
    return _even(points, f, f"lattice-{case}", math.nan)


_LATTICE_ROOT = math.sqrt(math.pi / 4.0)
"""sqrt(M) of the lattice's jet over U0 D."""
_AROUND = 12
LATTICE_HISTORIES = {
    "train": ((0.0, 14.0, 1.0), (22.0, 30.0, 0.5), (36.0, 60.0, 1.0)),
    "test": ((0.0, 8.0, 0.6), (8.0, 24.0, 1.0), (38.0, 50.0, 0.8)),
}
"""From, until (D / U0) and thrust over the unit of the lattice's two histories; the second is not trained on."""


def lattice_case(which: str, cells_per_D: int = 6) -> LatticeCase:
    """The open box of the lattice's free jet with one of the histories."""
    free = CASES["free"]
    jets = tuple(DiskJet(start=a, stop=b, strength=s) for a, b, s in LATTICE_HISTORIES[which])
    return replace(free, name=f"history-{which}", jets=jets, cells_per_D=cells_per_D, develop=60.0, average=5.0)


def lattice_rows(
    which: str, rng: np.random.Generator, *, count: int = 150, cells_per_D: int = 6, progress: Progress = no_progress
) -> TruthSamples:
    """Samples of a lattice's run under one of the histories, each a mean round the axis; a minute or two of a core."""
    case = lattice_case(which, cells_per_D)
    starts = np.array([a for a, _, _ in LATTICE_HISTORIES[which]])
    times, thrusts = _stepped(LATTICE_HISTORIES[which])
    parts = []
    for number, (now, points, velocity) in enumerate(_lattice_instants(case, rng, count, float(starts[-1]) + 26.0)):
        progress(number, int(starts[-1]) + 26, case.name)
        parts.append(_rows(times, thrusts, now, points, velocity, root_of=_LATTICE_ROOT, diameter=1.0, memory=np.inf))
    return _joined([part for part in parts if part is not None], f"lattice-{which}", False, math.nan)


def _lattice_instants(
    case: LatticeCase, rng: np.random.Generator, count: int, until: float
) -> Iterator[tuple[float, JetPoints, Array]]:
    run = LatticeRun(case)
    reach = case.high_D[0] - case.sponge_D
    wide = case.high_D[1] - 1.0
    turn = 2.0 * math.pi * np.arange(_AROUND) / _AROUND
    while run.time < until:
        run.advance(max(1, run.steps_at(1.0)))
        points = drawn_points(rng, 4 * count)
        inside = (points.x_D > 1.0) & (points.x_D < reach) & (points.r_D < wide)
        chosen = np.flatnonzero(inside)[:count]
        points = JetPoints(x_D=points.x_D[chosen], r_D=points.r_D[chosen])
        radial = np.stack([np.zeros(_AROUND), np.cos(turn), np.sin(turn)], axis=1)
        places = points.x_D[:, None, None] * np.array([1.0, 0.0, 0.0]) + points.r_D[:, None, None] * radial
        seen = run.sample_velocity(places.reshape(-1, 3)).reshape(-1, _AROUND, 3)
        along = seen[:, :, 0].mean(axis=1)
        across = np.einsum("nax,ax->na", seen, radial).mean(axis=1)
        yield run.time, points, np.stack([along, across], axis=1)


def _stepped(pushes: tuple[tuple[float, float, float], ...]) -> tuple[Array, Array]:
    """Times and thrusts of pushes from, until and how hard."""
    times, thrusts = [], []
    for k, (start, stop, strength) in enumerate(pushes):
        times.append(start)
        thrusts.append(strength)
        if k + 1 == len(pushes) or pushes[k + 1][0] > stop:
            times.append(stop)
            thrusts.append(0.0)
    return np.array(times), np.array(thrusts)


def _mean_run(
    drawn: SampledWater,
    times: Array,
    thrusts: Array,
    asked: Array,
    places: list[JetPoints],
    rngs: list[np.random.Generator],
) -> Array:
    """Mean over waters that differ in their gusts, as `_run`."""
    return np.asarray(np.mean([_run(drawn, times, thrusts, asked, places, rng) for rng in rngs], axis=0))


def _run(
    drawn: SampledWater, times: Array, thrusts: Array, asked: Array, places: list[JetPoints], rng: np.random.Generator
) -> Array:
    """Velocity along and across, shape (instants, n, 2), of the tank's water about one thruster at the origin."""
    water = Water(
        np.array([0.25 * math.pi * DIAMETER_M**2]),
        density_kg_m3=FRESH_WATER_KG_M3,
        bed_z_m=math.inf,
        rng=rng,
        turbulence=TURBULENCE,
        spreading=JetSpreading.of_width(drawn.half_width_growth),
        wake_life=drawn.wake_life,
    )
    origin, force_axis = np.zeros((1, 3)), np.array([[-1.0, 0.0, 0.0]])
    out = np.empty((len(asked), len(places[0].x_D), 2))
    now = 0.0
    for k, stop in enumerate(asked):
        steps = max(1, math.ceil((stop - now) / STEP_S - 1e-9))
        dt = (stop - now) / steps
        for step in range(steps):
            row = int(np.searchsorted(times, now + (step + 0.5) * dt, side="right")) - 1
            water.step(dt, origin, origin, force_axis, np.array([[thrusts[row] * dt, 0.0]]))
        now = float(stop)
        turn = rng.uniform(0.0, 2.0 * math.pi, len(places[k].x_D))
        outward = np.stack([np.zeros_like(turn), np.cos(turn), np.sin(turn)], axis=1)
        at = DIAMETER_M * (places[k].x_D[:, None] * np.array([1.0, 0.0, 0.0]) + places[k].r_D[:, None] * outward)
        velocity = water.velocity(at)
        out[k] = np.stack([velocity[:, 0], np.sum(velocity * outward, axis=1)], axis=1)
    return out


@dataclass(frozen=True, eq=False)
class _Part:
    points: JetPoints
    history: Array
    now: Array
    f: Array


def _rows(
    times: Array,
    thrusts: Array,
    now: float,
    points: JetPoints,
    velocity: Array,
    root_of: float = 1.0 / math.sqrt(FRESH_WATER_KG_M3),
    diameter: float = DIAMETER_M,
    memory: float = MEMORY_S,
) -> _Part | None:
    """Rows of one instant; None before anything has pushed. `root_of` is sqrt(M) of the unit of thrust."""
    greatest = remembered(times, thrusts, now, memory)
    if greatest == 0.0:
        return None
    root = root_of * math.sqrt(greatest)
    history = history_bins(times, thrusts, now, points.delays() * diameter**2 / root, greatest)
    scale = root / (diameter * (points.away_D + 1.0))
    row = int(np.searchsorted(times, now, side="left")) - 1
    return _Part(points, history, np.full(len(velocity), thrusts[row] / greatest), velocity / scale[:, None])


def _joined(parts: list[_Part], source: str, steady: bool, width: float) -> TruthSamples:
    return TruthSamples(
        source=source,
        points=_stacked([part.points for part in parts]),
        history=np.concatenate([part.history for part in parts]),
        now=np.concatenate([part.now for part in parts]),
        f=np.concatenate([part.f for part in parts]),
        steady=steady,
        half_width_growth=width,
    )


def _even(points: JetPoints, f: Array, source: str, width: float) -> TruthSamples:
    even = np.ones((len(f), len(EDGES) - 1))
    return TruthSamples(
        source=source, points=points, history=even, now=np.ones(len(f)), f=f, steady=True, half_width_growth=width
    )


def _stacked(places: list[JetPoints]) -> JetPoints:
    return JetPoints(x_D=np.concatenate([p.x_D for p in places]), r_D=np.concatenate([p.r_D for p in places]))
