"""The study of operators: the paper's claim in the tank's worlds and the sweep of w_track; `wakewise bench operator`.

For each world and w_track, `wake-aware` against direct allocation (`dp`) on the same seeds, by a script and by the
human model; `mpc` at the same w_track and `no-forward-jets` beside them. What is flown and how it is judged was written
down before the first flight (docs/research-log/0047). A campaign makes and keeps the flights: a run that was stopped
goes on. Tables are over pairs of one seed and pilot, ours and direct; logarithms and intervals are those of the study
of wash.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.control.velocity_reference import PAPER_W_TRACK
from wakewise.core.errors import InputError
from wakewise.experiments.campaigns import ProcessExecutor
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.statistics import LEAST_M_S, log_reduction_pct, mean_figures, pairs_of, ratio
from wakewise.experiments.campaigns.study import Row, StudyResult, missing, run_study, store_folder
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import load_scenario
from wakewise.operation.teleop.operator_state import RANGES
from wakewise.operation.worlds.library import load_world, world_names
from wakewise_paper.operator_study import paper
from wakewise_paper.operator_study.flight import DEVIATIONS, FIGURES, PILOTS, course_of, operator_trial
from wakewise_paper.operator_study.worlds import CONTROL, TROUBLE, water_of
from wakewise_paper.wash_reduction.headline import SPEED, TROUBLE_M_S

LEAST_D = 0.25e-6
"""D below counts as this in logarithms, (m/s)^2: the square of the least speed that counts."""
DEVIATION, D = "velocity_deviation_pct", "disturbance"
TOLD = tuple(key for key in FIGURES if key not in (*DEVIATIONS, D, "cpu_s"))
COSTS = (
    ("energy_kJ", "energy_ratio"),
    ("position_rmse_mm", "position_ratio"),
    ("velocity_error_rms_mm_s", "velocity_error_ratio"),
    ("silt_lifted_g", "silt_lifted_ratio"),
    ("ray_optical_depth", "silt_rays_ratio"),
    ("sway_rms_mm", "sway_ratio"),
    ("sway_wash_mm", "sway_wash_ratio"),
)
"""Sums of ours over sums of direct's, gains and losses alike."""

OperatorKey = tuple[str, str, str, int]
"""World, pilot, name of the flight and seed."""
Known = tuple[str, str, int]
"""World, pilot and seed of a flight."""
Flights = Mapping[Known, Row]


def table(
    ours: Flights, direct: Flights, trims: Mapping[Known, str], lost: frozenset[Known] = frozenset()
) -> dict[str, Any]:
    """Figures of some flights of a method against direct allocation in the same waters.

    Parameters
    ----------
    ours, direct : mapping
    trims : mapping
        Stratum of each flight.
    lost : frozenset
        Flights of ours that failed.
    """
    paired = {key: direct[key] for key in ours if key in direct}
    answer: dict[str, Any] = {"flights": len(ours), "failed": len(lost)}
    own = mean_figures(ours.values(), (*DEVIATIONS, *TOLD), worst=("solve_ms_p99",))
    own.pop("flights")
    answer[DEVIATION] = own[DEVIATION]
    answer["velocity_deviation_interval_pct"] = own[f"{DEVIATION}_interval"]
    answer["velocity_deviation_worst_pct"] = _most(ours, DEVIATION)
    answer["velocity_deviation_over_15_flights"] = sum(
        float(row.get(DEVIATION) or 0.0) >= 15.0 for row in ours.values()
    )
    answer["velocity_deviation_floor_pct"] = mean_figures(paired.values(), (DEVIATION,))[DEVIATION]
    for key in DEVIATIONS[1:]:
        answer[key] = own[key]
    answer |= _less("disturbance_reduction", _d_pairs(paired, ours, trims), len(lost & set(direct)))
    trouble = {key: row for key, row in direct.items() if float(row.get(SPEED) or 0.0) > TROUBLE_M_S}
    answer["trouble_flights"] = sum(key in ours or key in lost for key in trouble)
    answer |= _less("target_speed_reduction", pairs_of(trouble, ours, SPEED, trims), len(lost & set(trouble)))
    everywhere = _less("target_speed_reduction_all", pairs_of(direct, ours, SPEED, trims), len(lost & set(direct)))
    answer |= everywhere
    answer["direct_target_speed_mean_m_s"] = mean_figures(paired.values(), (SPEED,))[SPEED]
    for key in TOLD:
        answer[key] = own[key]
    for figure, name in COSTS:
        answer[name], answer[f"{name}_interval"] = ratio(pairs_of(direct, ours, figure, trims))
    answer["why"] = _why(answer)
    return answer


def sliced(flights: Flights, *, world: str | None = None, pilot: str | None = None) -> dict[Known, Row]:
    """Those of a world and a pilot; of all where it is None."""
    return {
        key: row
        for key, row in flights.items()
        if (world is None or key[0] == world) and (pilot is None or key[1] == pilot)
    }


def _less(name: str, pairs: list[Any], lost: int) -> dict[str, Any]:
    value, interval, worst = log_reduction_pct(pairs, lost)
    return {f"{name}_pct": value, f"{name}_interval_pct": interval, f"{name}_worst_pct": worst}


def _d_pairs(direct: Flights, ours: Flights, trims: Mapping[Known, str]) -> list[Any]:
    """Pairs of D in units in which its least value is that of the speeds."""
    unit = LEAST_D / LEAST_M_S
    return [(theirs / unit, own / unit, where) for theirs, own, where in pairs_of(direct, ours, D, trims)]


def _most(rows: Flights, key: str) -> float | None:
    known = [float(value) for row in rows.values() if (value := row.get(key)) is not None and np.isfinite(value)]
    return max(known) if known else None


def _why(answer: Mapping[str, Any]) -> dict[str, str]:
    """Reasons of what could not be computed."""
    reasons: dict[str, str] = {}
    for key, value in answer.items():
        if value is not None:
            continue
        if "interval" in key:
            reasons[key] = "one flight or none"
        elif key.startswith("target_speed_reduction") and not answer["trouble_flights"] and "_all" not in key:
            reasons[key] = "direct leaves 10 mm/s or less in all of these flights"
        elif key.startswith("sway"):
            reasons[key] = "the target is rigid, or no photograph was taken"
        else:
            reasons[key] = "no flight gave it, or nothing of it with direct allocation"
    return reasons


W_TRACKS = (1.0, 2.0, 5.0, 10.0, 20.0)
DIRECT, OURS, UNAWARE, RULE = "dp", "wake-aware", "mpc", "no-forward-jets"
PLANS = (OURS, UNAWARE)
"""Methods that have a w_track; the other two are flown once for all."""
DEFAULT_WORLDS = (*TROUBLE, CONTROL)
SEEDS, GRID_SEEDS = 3, 1
"""At the paper's w_track, and at the others where only the script flies: unless more are asked for."""


def selected_worlds(requested: tuple[str, ...] | None) -> tuple[str, ...]:
    """Worlds to fly in.

    Raises
    ------
    InputError
        If one is not known.
    """
    for name in requested or ():
        if name not in world_names():
            raise InputError(f"worlds: '{name}' is not known, allowed: {', '.join(world_names())}")
    return DEFAULT_WORLDS if requested is None else tuple(dict.fromkeys(requested))


def selected_w_tracks(requested: tuple[float, ...] | None) -> tuple[float, ...]:
    """Weights to fly, in order.

    Raises
    ------
    InputError
        If one is beyond the range of the settings.
    """
    least, most = RANGES["w_track"]
    for value in requested or ():
        if not least <= value <= most:
            raise InputError(f"w_tracks: {value:g}, must be from {least:g} to {most:g}")
    return W_TRACKS if requested is None else tuple(sorted(set(requested)))


def planned_trials(
    worlds: tuple[str, ...], w_tracks: tuple[float, ...], seeds: int, grid_seeds: int
) -> dict[OperatorKey, PlannedTrial]:
    """Flights to make, seed by seed, what the claim needs first; direct flights are shared by all w_tracks."""
    trials: dict[OperatorKey, PlannedTrial] = {}

    def add(world: str, pilot: str, method: str, seed: int, w_track: float = PAPER_W_TRACK) -> None:
        name = flight_name(method, w_track)
        trials[world, pilot, name, seed] = operator_trial(world, pilot, method, seed, w_track, name=name)

    for seed in range(1, seeds + 1):
        for world in worlds:
            for pilot in PILOTS:
                add(world, pilot, DIRECT, seed)
                if PAPER_W_TRACK in w_tracks:
                    add(world, pilot, OURS, seed)
        for world in worlds:
            for pilot in PILOTS:
                add(world, pilot, RULE, seed)
                if PAPER_W_TRACK in w_tracks:
                    add(world, pilot, UNAWARE, seed)
        for w_track in (w for w in w_tracks if w != PAPER_W_TRACK and seed <= grid_seeds):
            for world in worlds:
                for method in PLANS:
                    add(world, PILOTS[0], method, seed, w_track)
    return trials


def flight_name(method: str, w_track: float) -> str:
    """What a flight is called: its method, with the w_track of one that has it."""
    return f"{method} {w_track:g}" if method in PLANS else method


def flight_s(name: str) -> float:
    """About how much CPU time a flight takes, in seconds, for saying how long a run is."""
    return 8.0 if name.startswith(PLANS) else 6.0


ELSEWHERE = {
    "latency_ms_p99": "from stick to thrust: measured in the cockpit's loop, not in a flight without one",
    "coverage_agreement_pct": "the coverage guide is not flown by this bench",
    "coverage_ms_per_photo": "the coverage guide is not timed by this bench",
}

_engine = ProcessExecutor


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly what is requested and not known yet; a table per world and w_track, the claim, the paper's world.

    Raises
    ------
    InputError
        If a world is not known or a w_track not possible.
    """
    began = time.monotonic()
    worlds, w_tracks = selected_worlds(options.worlds), selected_w_tracks(options.w_tracks)
    trials = planned_trials(worlds, w_tracks, options.seeds, min(options.seeds, GRID_SEEDS))
    own = paper.paper_trials(w_tracks, min(options.seeds, paper.SEEDS))
    folder = options.store or store_folder("operator")
    left_s = sum(flight_s(key[2]) for key in missing(trials, folder, options))
    words = f"{len(trials)} flights, some {left_s / 60.0 / options.workers:.0f} min of {options.workers} free cores"
    options.progress(0, max(len(trials), 1), words)
    every: dict[Any, PlannedTrial] = {**trials, **own}
    made = run_study("operator", every, folder, options, _engine)
    flown = made.part(trials)
    told = OperatorBenchResults(flown)
    default = load_scenario("quick", None, {}).world
    tables = {name: world_figures(name, w_tracks, told) for name in worlds}
    answer: dict[str, Any] = {
        "claim": claim(worlds, told),
        "worlds": tables,
        "default_world": default,
        "w_track": tables[default]["w_track"] if default in tables else None,
        "paper": paper.paper_figures(made.part(own).rows, w_tracks),
    }
    answer |= dict.fromkeys(ELSEWHERE)
    answer |= {
        "solve_ms_p99": _worst(flown.rows, "solve_ms_p99"),
        "seeds": options.seeds,
        **made.counts,
        "flight_cpu_s": _mean(flown.rows, "cpu_s"),
        "wall_s": time.monotonic() - began,
    }
    answer["why"] = ELSEWHERE | ({} if default in tables else {"w_track": f"{default} was left out"})
    return answer


class OperatorBenchResults:
    """Rows of the study by method, w_track and flight."""

    def __init__(self, flown: StudyResult[OperatorKey]) -> None:
        self._rows: dict[str, dict[Known, Row]] = {}
        self._lost: dict[str, set[Known]] = {}
        self.trims: dict[Known, str] = {}
        self.courses: dict[Known, str] = {}
        for world, pilot, name, seed in (*flown.rows, *flown.failures):
            known = (world, pilot, seed)
            self.trims[known] = water_of(world, seed).trim
            self.courses[known] = course_of(world, pilot, seed)
            key = (world, pilot, name, seed)
            if key in flown.rows:
                self._rows.setdefault(name, {})[known] = flown.rows[key]
            else:
                self._lost.setdefault(name, set()).add(known)

    def of(self, method: str, w_track: float = PAPER_W_TRACK) -> dict[Known, Row]:
        """Flights of a method."""
        return self._rows.get(flight_name(method, w_track), {})

    def lost(self, method: str, w_track: float = PAPER_W_TRACK) -> frozenset[Known]:
        """Flights of a method that failed."""
        return frozenset(self._lost.get(flight_name(method, w_track), ()))

    def table(self, method: str, w_track: float, world: str | None = None, pilot: str | None = None) -> dict[str, Any]:
        """Figures of a method against direct allocation, of all worlds and pilots or of one."""
        ours, direct = (sliced(self.of(m, w_track), world=world, pilot=pilot) for m in (method, DIRECT))
        lost: dict[Known, Row] = {k: {} for k in self.lost(method, w_track)}
        return table(ours, direct, self.trims, frozenset(sliced(lost, world=world, pilot=pilot)))

    def grid_table(self, method: str, w_track: float, world: str) -> dict[str, Any]:
        """The same over the flights that every w_track has: the script's first seeds."""

        def here(flights: Flights) -> dict[Known, Row]:
            return {k: row for k, row in sliced(flights, world=world, pilot=PILOTS[0]).items() if k[2] <= GRID_SEEDS}

        empty: dict[Known, Row] = {key: {} for key in self.lost(method, w_track)}
        return table(here(self.of(method, w_track)), here(self.of(DIRECT)), self.trims, frozenset(here(empty)))

    def course_table(self, method: str, w_track: float, course: str) -> dict[str, Any]:
        """The same over the flights of a course."""

        def here(flights: Flights) -> dict[Known, Row]:
            return {key: row for key, row in flights.items() if self.courses[key] == course and key[1] == PILOTS[0]}

        empty: dict[Known, Row] = {key: {} for key in self.lost(method, w_track)}
        lost = here(empty)
        return table(here(self.of(method, w_track)), here(self.of(DIRECT)), self.trims, frozenset(lost))


def world_figures(name: str, w_tracks: tuple[float, ...], told: OperatorBenchResults) -> dict[str, Any]:
    """Tables of one world: by w_track ours, each pilot's alone and `mpc`; the bow rule once.

    `grid` is over the flights that all w_tracks have, for holding one w_track against another.
    """
    sweep: dict[str, Any] = {}
    for w_track in w_tracks:
        row = told.table(OURS, w_track, name)
        row["pilots"] = {pilot: told.table(OURS, w_track, name, pilot) for pilot in PILOTS}
        row[UNAWARE] = told.table(UNAWARE, w_track, name)
        row["grid"] = told.grid_table(OURS, w_track, name)
        sweep[f"{w_track:g}"] = row
    return {"title": load_world(name).file.title, "w_track": sweep, RULE: told.table(RULE, PAPER_W_TRACK, name)}


def claim(worlds: tuple[str, ...], told: OperatorBenchResults) -> dict[str, Any]:
    """All worlds and both pilots together at the paper's w_track, against the bars; rivals, pilots, courses beside."""
    ours = told.table(OURS, PAPER_W_TRACK)
    deviation, wash, D = (
        ours[key] for key in ("velocity_deviation_pct", "target_speed_reduction_pct", "disturbance_reduction_pct")
    )
    courses = dict.fromkeys(told.courses.values())
    return {
        "w_track": PAPER_W_TRACK,
        "worlds": list(worlds),
        **ours,
        "deviation_ok": None if deviation is None else deviation < 15.0,
        "wash_ok": None if wash is None else wash > 60.0,
        "disturbance_ok": None if D is None else D > 60.0,
        "pilots": {pilot: told.table(OURS, PAPER_W_TRACK, pilot=pilot) for pilot in PILOTS},
        "courses": {name: told.course_table(OURS, PAPER_W_TRACK, name) for name in courses},
        "rivals": {name: told.table(name, PAPER_W_TRACK) for name in (UNAWARE, RULE)},
    }


def _mean(rows: Mapping[Any, Row], key: str) -> float | None:
    known = [row[key] for row in rows.values() if row.get(key) is not None]
    return float(np.mean(np.array(known, dtype=np.float64))) if known else None


def _worst(rows: Mapping[Any, Row], key: str) -> float | None:
    known = [value for row in rows.values() if (value := row.get(key)) is not None]
    return max(known) if known else None
