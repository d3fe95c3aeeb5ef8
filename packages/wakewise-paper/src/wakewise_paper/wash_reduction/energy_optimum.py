"""The most that sharing thrusts out could gain in a flight, by the tank's own water: no controller's belief is in it.

A flight of `dp` is taken as it was, its true way and the wrench that its thrusters made, and its water is made anew
with other thrusts of the same wrench (`wakewise_paper.wash_reduction.prescribed_motion`): each of some 80 sharings
(`candidate_allocations.py`), the bow rule's, and what the belief of `wake-aware` would have flown, with its bound on
power and without. Then one who knows all of these waters chooses a sharing for each `STRETCH_S` of the flight within a
bound on energy (`choosing.py`).

Two numbers hold the answer between them. *bound*: the stretches' own waters put together, each as if its sharing had
been flown before, too, and chosen by the very gusts it is judged by: more than can be had. *attained*: the choice, led
in water with other gusts, after single stretches were tried anew: what knowing all does gain. What neither sees: other
motions (leaning a body, trim, a mission's own choices), and sharings that change within a stretch other than with the
wrench; these could pass it.

Ways to share a flight's wrench out among its thrusters, from the least thrusts out to where thrusters rest.

Of all thrusts that make a wrench, T_0(t) + lambda z are those that differ along one line z of the null space. On such a
line each thruster rests at one place, r_i = -T_0i / z_i, and wash is made of roots of thrusts: it has its minima where
a thruster rests, or nearly. So a sharing is said by these places, which move with the wrench: at the least thrusts, at
the first, second ... rest, half of the way to the inner ones, and beyond the last. Two lines (level, vertical) give
all pairs.

One sharing for each stretch of a flight: the least wash that a bound on energy allows.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.allocation import Layout, PowerLaw, min_norm_allocation
from wakewise.control.bed_points import with_bed_points
from wakewise.control.forward_jet_exclusion import bow_layout
from wakewise.control.null_space_allocation import (
    RESTART_S,
    SEARCH_S,
    AllocationContext,
    allocation_context,
    power_law,
    vehicle_layout,
)
from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState, TruthProvider
from wakewise.experiments.campaigns.definition import FLIGHT_SOURCES, PlannedTrial
from wakewise.experiments.campaigns.study import study_trial
from wakewise.experiments.campaigns.task import Task, WorkProgress
from wakewise.operation import Parts, fly
from wakewise.operation.loop import Step
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.missions import SETTLING
from wakewise.simulation.tank.tank import TankWorld, tank_ambient, tank_points
from wakewise.wake import bed_of
from wakewise_paper.wash_reduction.flight import SOURCES, parts_of
from wakewise_paper.wash_reduction.prescribed_motion import PrescribedMotionTank, PrescribedPath

HALF, BEYOND = 0.5, 1.4
"""Shares of the way from the least thrusts to an inner and to an outermost rest that are looked at besides."""
ALIKE_N = 0.03
"""Places on a line nearer to each other than this, in the mean over a flight, are one."""
_NOT_IN_IT = 1e-3


def candidate_allocations(layout: Layout, least_N: Array) -> Array:
    """Thrusts of all sharings, shape (j, k, n), the first of them the least thrusts themselves, shape (k, n).

    Raises
    ------
    InputError
        If the null space is not made of lines that share no thruster.
    """
    if not len(layout.lines):
        raise InputError("bound: the vehicle's spare thrusts are not lines that share no thruster, so it has no grid")
    along = [line_places(layout, line, least_N) for line in layout.lines]
    return np.array([least_N + sum(moves) for moves in product(*along)])


def line_places(layout: Layout, line: Array, least_N: Array) -> list[Array]:
    """Moves along one line, shape (k, n) each, that lead from the least thrusts to its places; the first is none."""
    rests = np.sort(_rests(line, least_N), axis=1)
    low, high = _room(layout, line, least_N)
    places = [np.zeros(len(least_N))]
    last = rests.shape[1] - 1
    looked_at = [(number, 1.0) for number in range(last + 1)] + [(number, HALF) for number in range(1, last)]
    for number, share in (*looked_at, (0, BEYOND), (last, BEYOND)):
        place = np.clip(share * rests[:, number], low, high)
        if all(np.abs(place - other).mean() >= ALIKE_N for other in places):
            places.append(place)
    return [place[:, None] * line for place in places]


def _rests(line: Array, least_N: Array) -> Array:
    """Where on a line each of its thrusters rests, shape (k, those that it has)."""
    own = np.abs(line) > _NOT_IN_IT
    return np.asarray(-least_N[:, own] / line[own])


def _room(layout: Layout, line: Array, least_N: Array) -> tuple[Array, Array]:
    """How far the limits let each step go along a line, down and up, shape (k,) each."""
    own = np.abs(line) > _NOT_IN_IT
    ends = np.stack([(limit[own] - least_N[:, own]) / line[own] for limit in (layout.lower_N, layout.upper_N)])
    low, high = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    return np.minimum(low, 0.0), np.maximum(high, 0.0)


def split(layout: Layout, thrusts_N: Array) -> tuple[Array, Array]:
    """Least thrusts of the same wrenches, and what is spare in these thrusts; shape (k, n) each."""
    spare = thrusts_N @ layout.null @ layout.null.T
    return thrusts_N - spare, spare


_LEVELS = 2000
"""Steps in which the energy over the least is counted; each choice is rounded up, so that the bound is kept."""


def choose_under_budget(wash: Array, energy: Array, most: float) -> IntArray:
    """Which choice to take in each stretch, shape (b,), so that the sum of wash is least and that of energy in bounds.

    Exact but for the rounding of energy, by dynamic programming over stretches (the knapsack with one choice of each).

    Parameters
    ----------
    wash, energy : ndarray, shape (b, j)
        What each choice adds in each stretch.
    most : float
        Bound on the sum of energy, infinite for none; where nothing is within it, the choices of least energy.
    """
    least = energy.min(axis=1)
    free = most - float(least.sum())
    if not np.isfinite(most):
        return np.asarray(wash.argmin(axis=1))
    if free <= 0.0:
        return np.asarray(energy.argmin(axis=1))
    cost = np.ceil((energy - least[:, None]) / free * _LEVELS - 1e-9)
    taken: list[tuple[IntArray, Array]] = []
    best = np.zeros(_LEVELS + 1)  # least wash by how much of the room may be used
    for own, steps in zip(wash, cost, strict=True):
        after, pick = np.full(_LEVELS + 1, np.inf), np.zeros(_LEVELS + 1, dtype=np.int64)
        for j in np.flatnonzero(steps <= _LEVELS):
            shift = int(steps[j])
            total = best[: _LEVELS + 1 - shift] + own[j]
            better = total < after[shift:]
            after[shift:][better] = total[better]
            pick[shift:][better] = j
        best = after
        taken.append((pick, steps))
    picks, left = np.zeros(len(taken), dtype=np.int64), _LEVELS
    for b in reversed(range(len(taken))):
        pick, steps = taken[b]
        picks[b] = pick[left]
        left -= round(float(steps[picks[b]]))
    return picks


def sum_of(values: Array, picks: IntArray) -> float:
    """Sum over stretches of what was picked, of values of shape (b, j)."""
    return float(values[np.arange(len(picks)), picks].sum())


ENERGIES: dict[str, float] = {"1.05": 1.05, "1.15": 1.15, "1.3": 1.3, "1.5": 1.5, "1.7": 1.7, "any": np.inf}
"""Bounds on energy over that of the least thrusts, by what they are called."""
STRETCH_S = 5.0
"""About as long as a jet needs to the target."""
LOOK_STEPS = 5
"""Steps of the water, 0.05 s each, between two looks at the target."""
LAGS_S = (0.0, 2.5, 5.0)
"""How long after a stretch its water is looked for: a choice is made by each, the best is kept."""
SMOOTH_S = 1.0
"""Wrenches are means over so long: what is shared out is what motion needs, not its noise."""
TRIED = 4
"""Sharings that each stretch is tried anew with, the least wash first."""
SEARCHED = ("1.3", "any")
"""Bounds on energy for which stretches are tried anew; the others' choices stay as they were made."""
FRESH_GUSTS = (1, 2)
"""Seeds of the gusts in which a choice is judged, for the mean of them; it is made by those of seed 0."""

Led = Callable[[IntArray], tuple[float, float]]
"""`picks -> mean speed in m/s, energy`."""


def bound_trial(scenario: str, seed: int) -> PlannedTrial:
    """One flight of `dp` whose ways to share thrusts are judged."""
    name = f"{scenario}/bound/{seed}"
    settings = {"scenario": scenario, "seed": seed}
    task = Task(name=name, work=f"{__name__}:fly_bound", settings=settings, sources=(*FLIGHT_SOURCES, *SOURCES))
    return study_trial(scenario, "bound", seed, task)


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedFlight:
    """A flight of `dp` as its water needs it, at the water's own steps.

    `least_N`, shape (k, n), are the least true thrusts of its wrench without noise; `wrench_B`, shape (k, 6), what the
    controller asked for; `estimates` what the estimator said, each `SEARCH_S`; `judged_s` when settling had ended.
    """

    parts: Parts
    vehicle: Vehicle
    layout: Layout
    led: PrescribedMotionTank
    least_N: Array
    wrench_B: Array
    estimates: list[BodyState]
    judged_s: float
    wash_m_s: float
    power_W: float


def fly_bound(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> dict[str, float | None]:
    """What sharings give in one flight: `scenario`, `seed`, and `duration_s` where only its first part is flown.

    Keys, speeds being means at the target in m/s, energies over that of the least thrusts: `dp_m_s` as flown;
    `least_m_s` the same led without the noise of its wrench; for each of `ENERGIES`
    `bound_1.3_m_s`, `bound_1.3_energy`, `attained_1.3_m_s`, `attained_1.3_energy`; `rule_m_s`, `rule_energy`, None
    where the rule does not fit; `belief_*` and `belief_any_*` what `wake-aware` believes best on the way of `dp`, with
    its bound on power and without; `candidate_allocations`, how many there were; `dp_power_W`, `least_power_W`,
    `cpu_s`.
    """
    del folder, progress
    began = time.process_time()
    flown = fly_dp(settings["scenario"], settings["seed"], settings.get("duration_s"))
    grid, named = candidates(flown)
    judge = AllocationJudge.of(flown, grid)
    found: dict[str, float | None] = {
        "dp_m_s": flown.wash_m_s,
        "dp_power_W": flown.power_W,
        "least_m_s": judge.judged(judge.throughout(0))[0],
        "least_power_W": float(judge.power_W[0].mean()),
        "sharings": float(len(grid)),
    }
    for name in ("rule", "belief", "belief_any"):
        number = named.get(name)
        told = (None, None) if number is None else judge.judged(judge.throughout(number))
        found[f"{name}_m_s"], found[f"{name}_energy"] = told
    found |= attained_reductions(judge)
    found["cpu_s"] = time.process_time() - began
    return found


def fly_dp(scenario: str, seed: int, duration_s: float | None = None) -> RecordedFlight:
    """Fly `dp` and keep what its water needs.

    Raises
    ------
    InputError
        If the scenario is not flown in the tank.
    """
    parts = parts_of(scenario, "dp", seed)
    world = parts.world
    if not isinstance(world, TankWorld):
        raise InputError(f"bound: {scenario} is not flown in the tank")
    every, estimates = round(SEARCH_S * parts.scenario.control.rate_hz), []
    seen: list[int] = []

    def heard(step: Step, _: TruthProvider | None) -> None:
        if len(seen) % every == 0:
            estimates.append(step.estimate)
        seen.append(1)

    steps = fly(parts, checked=False, water_every_s=0.25, duration_s=duration_s, watch=heard).steps
    times = steps["time_s"].to_numpy()
    state = [steps.select(f"true_{name}" for name in names).to_numpy() for names in _STATE]
    way = PrescribedPath(times_s=times, p_WB_m=state[0], q_WB=state[1], nu_B=state[2])
    led = PrescribedMotionTank(
        vehicle=world.vehicle,
        target=world.target,
        settings=world.settings,
        ambient=tank_ambient(world.settings, world.draw()),
        way=way,
        points_W_m=tank_points(world.target, world.draw()),
    )
    layout = vehicle_layout(world.vehicle)
    thrusts = steps.select(f"thrust_{i + 1}_N" for i in range(layout.B.shape[1])).to_numpy()
    asked = steps.select(_WRENCH).to_numpy()
    rows = round(SMOOTH_S * parts.scenario.control.rate_hz) | 1
    least, _ = split(layout, _at(led.times_s, times, smoothed(thrusts, rows)))
    judged = steps.filter(pl.col("leg") != SETTLING)
    return RecordedFlight(
        parts=parts,
        vehicle=world.vehicle,
        layout=layout,
        led=led,
        least_N=least,
        wrench_B=_at(led.times_s, times, smoothed(asked, rows)),
        estimates=estimates,
        judged_s=float(judged["time_s"][0]),
        wash_m_s=float(judged["target_speed_mean_m_s"].to_numpy().mean()),
        power_W=float(judged["power_W"].to_numpy().mean()),
    )


def candidates(flown: RecordedFlight) -> tuple[Array, dict[str, int]]:
    """Thrusts of all sharings of a flight, shape (j, k, n), the least first, and the numbers of those with a name."""
    rows, named = list(candidate_allocations(flown.layout, flown.least_N)), {}
    try:
        rule = bow_layout(flown.vehicle)
    except InputError:
        rule = None
    if rule is not None:
        named["rule"] = len(rows)
        rows.append(np.array([min_norm_allocation(rule, wrench).thrusts_N for wrench in flown.least_N @ rule.B.T]))
    parts = flown.parts
    region = with_bed_points(parts.region, parts.control.allocation, bed_of(parts.wake))
    watch = allocation_context(parts.vehicle, region, parts.wake, parts.control)
    for name, one in (("belief", watch), ("belief_any", replace(watch, allocator=replace(watch.allocator, law=None)))):
        named[name] = len(rows)
        rows.append(flown.least_N + believed(one, flown))
    return np.array(rows), named


def believed(watch: AllocationContext, flown: RecordedFlight) -> Array:
    """Spare thrusts that a belief chooses on the flight's way, as they are given, shape (k, n).

    Shares are sought as often as in flight, from the same estimates, for the wrench without its noise.
    """
    times, n = flown.led.times_s, flown.least_N.shape[1]
    thrusts, given, jumps = np.zeros(n), [], round(RESTART_S / SEARCH_S)
    asked_s: Array = np.arange(len(flown.estimates), dtype=np.float64) * SEARCH_S
    asked = _at(asked_s, times, flown.wrench_B)
    for k, (estimate, wrench) in enumerate(zip(flown.estimates, asked, strict=True)):
        shared = watch.search(wrench, estimate, thrusts)
        if shared is not None:
            thrusts = shared[0].thrusts_N
            if k % jumps == 0:
                anew = watch.restart(wrench, estimate, thrusts, shared[1])
                thrusts = thrusts if anew is None else anew[0].thrusts_N
        given.append(flown.vehicle.thrust_gains * thrusts)
    return split(flown.layout, _at(times, asked_s, np.array(given)))[1]


@dataclass(frozen=True, kw_only=True, eq=False)
class AllocationJudge:
    """What each sharing of a flight does to its water, look by look, and what it costs.

    `sharings_N` has shape (j, k, n); `speeds_m_s` and `power_W`, shape (j, l), are those of the looks that count,
    at `looks_s`, shape (l,); `stretch`, shape (l,), says which stretch each look is in, `steps_stretch`, shape (k,),
    the same of the water's steps (those of settling are in the first).
    """

    led: PrescribedMotionTank
    sharings_N: Array
    speeds_m_s: Array
    power_W: Array
    settling_speeds: int
    looks_s: Array
    steps_stretch: IntArray
    stretch: IntArray

    @classmethod
    def of(cls, flown: RecordedFlight, grid: Array) -> AllocationJudge:
        """Lead the flight with each sharing."""
        led, times = flown.led, flown.led.times_s
        looks = times[LOOK_STEPS::LOOK_STEPS]
        first = int(np.searchsorted(looks, flown.judged_s - 1e-9))
        count = max(1, round((looks[-1] - flown.judged_s) / STRETCH_S))
        ends = np.linspace(flown.judged_s, looks[-1] + 1e-9, count + 1)[1:-1]
        law: PowerLaw = power_law(flown.vehicle)
        return cls(
            led=led,
            sharings_N=grid,
            speeds_m_s=np.array([led.wash_m_s(thrusts, LOOK_STEPS, 0)[first:] for thrusts in grid]),
            power_W=law.power_W(grid)[:, LOOK_STEPS::LOOK_STEPS][:, first:],
            settling_speeds=first,
            looks_s=looks[first:],
            steps_stretch=np.searchsorted(ends, times, side="right"),
            stretch=np.searchsorted(ends, looks[first:], side="right"),
        )

    def wash_m_s(self, number: int) -> float:
        """Mean speed of one sharing throughout."""
        return float(self.speeds_m_s[number].mean())

    def energy(self, number: int) -> float:
        """Energy of one sharing throughout over that of the least thrusts."""
        return float(self.power_W[number].mean() / self.power_W[0].mean())

    def by_stretch(self, lag_s: float = 0.0) -> tuple[Array, Array]:
        """What each sharing adds to the flight's means in each stretch, wash in m/s and energy, shape (b, j) each.

        The water is looked at `lag_s` later; where the flight has ended by then, at its end.
        """
        b, looks = int(self.stretch.max()) + 1, len(self.looks_s)
        later = np.minimum(np.searchsorted(self.looks_s, self.looks_s + lag_s - 1e-9), looks - 1)
        member = (self.stretch[None, :] == np.arange(b)[:, None]).astype(np.float64) / looks
        return member @ self.speeds_m_s[:, later].T, member @ self.power_W.T / float(self.power_W[0].mean())

    def throughout(self, number: int) -> IntArray:
        """The choice of one sharing in all stretches, shape (b,)."""
        return np.full(int(self.stretch.max()) + 1, number)

    def judged(self, picks: IntArray) -> tuple[float, float]:
        """As `led_by`, the mean over gusts that had no part in any choice."""
        found = [self.led_by(picks, gusts) for gusts in FRESH_GUSTS]
        return float(np.mean([wash for wash, _ in found])), found[0][1]

    def led_by(self, picks: IntArray, gusts: int) -> tuple[float, float]:
        """Mean speed and energy of a flight with these sharings, one for each stretch."""
        thrusts = self.sharings_N[picks[self.steps_stretch], np.arange(len(self.steps_stretch))]
        wash = self.led.wash_m_s(thrusts, LOOK_STEPS, gusts)[self.settling_speeds :]
        return float(wash.mean()), sum_of(self.by_stretch()[1], picks)


def attained_reductions(judge: AllocationJudge) -> dict[str, float | None]:
    """What the bounds on energy allow: `bound_*` by putting stretches together, `attained_*` by leading the choice."""
    found: dict[str, float | None] = {}
    waters = {lag: judge.by_stretch(lag) for lag in LAGS_S}
    tried: dict[tuple[int, ...], tuple[float, float]] = {}

    def led(picks: IntArray) -> tuple[float, float]:
        key = tuple(picks.tolist())
        if key not in tried:
            tried[key] = judge.led_by(picks, 0)
        return tried[key]

    for name, most in ENERGIES.items():
        choices = {lag: choose_under_budget(wash, energy, most) for lag, (wash, energy) in waters.items()}
        lag = min(choices, key=lambda lag: sum_of(waters[lag][0], choices[lag]))
        found[f"bound_{name}_m_s"], found[f"bound_{name}_energy"] = (sum_of(v, choices[lag]) for v in waters[lag])
        starts = [*choices.values(), _throughout(judge, most)]
        best = min(starts, key=lambda picks: led(picks)[0])
        if name in SEARCHED:
            _tried_anew(judge, best, most, led)
    for name, most in ENERGIES.items():
        within = [(wash, key) for key, (wash, energy) in tried.items() if energy <= most + 1e-9]
        picks = np.array(min(within)[1], dtype=np.int64)
        found[f"attained_{name}_m_s"], found[f"attained_{name}_energy"] = judge.judged(picks)
    return found


def _throughout(judge: AllocationJudge, most: float) -> IntArray:
    """The best sharing that is flown throughout within a bound on energy."""
    own = [number for number in range(len(judge.sharings_N)) if judge.energy(number) <= most + 1e-9]
    best = min(own, key=judge.wash_m_s)
    return judge.throughout(best)


def _tried_anew(judge: AllocationJudge, picks: IntArray, most: float, led: Led) -> None:
    """Try other sharings in single stretches, from the first to the last, and go on from what is better."""
    wash, energy = judge.by_stretch(LAGS_S[1])
    for b in range(len(picks)):
        for other in np.argsort(wash[b])[:TRIED]:
            anew = picks.copy()
            anew[b] = other
            if sum_of(energy, anew) <= most + 1e-9 and led(anew)[0] < led(picks)[0]:
                picks = anew


def smoothed(values: Array, rows: int) -> Array:
    """Means over an odd number of rows about each, shape (k, m); at the ends the first and the last go on."""
    half = rows // 2
    ahead = np.cumsum(np.pad(values, ((half + 1, half), (0, 0)), mode="edge"), axis=0)
    return np.asarray((ahead[rows:] - ahead[:-rows]) / rows)


def _at(times_s: Array, known_s: Array, values: Array) -> Array:
    """Values, shape (k, m), at other times."""
    return np.stack([np.interp(times_s, known_s, column) for column in values.T], axis=1)


_STATE = (
    ("x_m", "y_m", "z_m"),
    ("qw", "qx", "qy", "qz"),
    ("u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s"),
)
_WRENCH = ("wrench_X_N", "wrench_Y_N", "wrench_Z_N", "wrench_K_Nm", "wrench_M_Nm", "wrench_N_Nm")
