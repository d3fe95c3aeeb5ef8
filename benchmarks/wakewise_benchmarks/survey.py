"""A slow survey on the simulated autopilot: 10 cm/s, 80 cm above a bed of relief, in a current, against what is asked.

Written down before the figures were known:

- asked (ardupilot 27767): speed within 1 cm/s rms, altitude within 5 cm at 95 % of the time, place across the
  line within 10 cm at 95 % of the time; from each loss 1 s to the firmware's hold, and 3 s where the program is dead or
  cut off, so that only the firmware's own time-out is left;
- flights: seeds 0 to `--seeds`, each over `trapezoid` and `sawtooth` (drawn height, slope, phase), in a drawn current
  of 0 to 0.15 m/s of any direction, with the errors of `SensorErrors`; `MINUTES` of line each, a lawnmower of 20 m
  lines with its turns;
- speed and altitude are true ones; speed counts in cruise, altitude and place from the first time at the altitude on.
  Place across the line is by the autopilot's own position: what its Doppler log drifts is no matter of control;
- intervals: 95 %, Student's t over flights. `met`: the interval lies within what is asked;
- orbits of `link orbit`: `survey_orbits`;
- repeat scans of a colony, for `wakewise measure` and `compare-models`: `repeat_scans`;
- terrains on which ArduSub's own bed following was tried: `surftrak_terrain`.

Wash at the bed against a person at 20 % gain: `survey_by_hand`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import typer

from wakewise.core.arrays import Array
from wakewise.core.optional_dependencies import need as need_of_core
from wakewise.experiments.campaigns.statistics import mean_interval
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.optional_dependencies import need
from wakewise_benchmarks.repeat_scans import repeat_figures, show_repeats
from wakewise_benchmarks.surftrak_terrain import TERRAINS, surftrak_figures
from wakewise_benchmarks.survey_by_hand import hand_figures, show_by_hand
from wakewise_benchmarks.survey_orbits import CIRCLES, FASTEST_CURRENT_M_S, VEHICLE, orbits

RELIEFS = ("trapezoid", "sawtooth")
MINUTES, LINE_M, APART_M = 20.0, 20.0, 0.5
SPEED_M_S = 0.1
ASKED = {"speed_rms_cm_s": 1.0, "altitude_p95_cm": 5.0, "cross_track_p95_cm": 10.0}
NAMES = (
    "speed_rms_cm_s",
    "altitude_rms_cm",
    "altitude_p95_cm",
    "cross_track_rms_cm",
    "cross_track_p95_cm",
    "cross_track_max_cm",
)
SURVEYED: tuple[str, ...] = ()
"""Losses that are injected; all if empty."""
HOLD_S, TIME_OUT_S = 1.0, 3.0
_LOOP_S = 0.1
"""What a loss may take longer than asked: a turn of the program and one of the autopilot."""


def run(options: BenchOptions) -> dict[str, Any]:
    """Figures over flights with intervals, of each relief and all, and seconds from each loss to the hold."""
    need("wakewise bench survey", "links", only=("pymavlink", "lupa"))
    need_of_core("wakewise bench survey", "photos")
    flights: list[dict[str, Any]] = []
    count = options.seeds * len(RELIEFS)
    for seed in range(options.seeds):
        for relief in RELIEFS:
            options.progress(len(flights), count + 1, f"{relief}, seed {seed}")
            flights.append(flight_figures(relief, seed, MINUTES))
    options.progress(count, count + 1, "losses")
    losses = loss_figures()
    options.progress(count + 1, count + 1, "")
    by_hand = hand_figures(load_vehicle(VEHICLE), options.seeds, options.progress)
    told: dict[str, Any] = {"asked": ASKED | {"hold_s": HOLD_S, "time_out_s": TIME_OUT_S}, "vehicle": VEHICLE}
    for name in (*RELIEFS, "all"):
        told[name] = summary([flight for flight in flights if name in ("all", flight["relief"])])
    told |= orbits(options.seeds, summary, options.progress)
    told["surftrak"] = {name: surftrak_figures(name) for name in TERRAINS}
    told |= {"losses": losses, "flights": flights, "wash_pct": by_hand["wash_pct"], "by_hand": by_hand}
    told |= {name: told["all"][name]["mean"] for name in ("speed_rms_cm_s", "altitude_rms_cm", "cross_track_rms_cm")}
    told["wash_reduction_vs_manual20_pct"] = by_hand["wash_pct"]["mean"]
    told["allocated_wash_reduction_vs_manual20_pct"] = by_hand["allocated_against_person_wash_pct"]["mean"]
    told["hold_after_loss_s_max"] = max(row["seconds"] for row in losses.values())
    return told | repeat_figures(options.progress)


def flight_figures(relief: str, seed: int, minutes: float) -> dict[str, Any]:
    """One flight: lines of `LINE_M` for so long, or until it ends by itself."""
    from wakewise_ardusub.sitl.sea_sensors import SHAPES, Relief, drawn_current
    from wakewise_ardusub.sitl.survey_harness import SurveyHarness
    from wakewise_ardusub.survey.survey_plan import SurveyPace, parallel_lines
    from wakewise_ardusub.survey.transect_session import TransectOptions

    began = time.thread_time()
    rng = np.random.default_rng([seed, RELIEFS.index(relief)])
    bed = Relief.drawn(next(shape for shape in SHAPES if shape == relief), rng)
    speed = float(rng.uniform(0.0, FASTEST_CURRENT_M_S))
    current = drawn_current(rng, speed)
    length_m = 60.0 * minutes * SPEED_M_S
    count = max(math.ceil(length_m / LINE_M), 1)

    def lines(place: Array, heading: float, _current: Array, _anchor: object) -> list[Array]:
        return parallel_lines(place, heading, max(APART_M * (count - 1), 0.1), min(LINE_M, length_m), APART_M, 1)

    pace = SurveyPace(speed_m_s=SPEED_M_S)
    harness = SurveyHarness(
        load_vehicle(VEHICLE),
        relief=bed,
        current=current,
        lines=lines,
        options=TransectOptions(pace=pace, every_m=1.0),
        seed=seed,
        heading_rad=float(rng.uniform(-0.5, 0.5)),
    )
    harness.ready().session.consent()
    session = harness.to_the_end(4.0 * 60.0 * minutes + 300.0).session
    felt, true = session.current_W_m_s, current(20.0)[:2]
    return {
        "relief": relief,
        "seed": seed,
        "slope": bed.slope,
        "height_m": bed.height_m,
        "current_m_s": speed,
        "current_error_m_s": None if felt is None else float(np.hypot(*(felt - true))),
        "finished": session.finished,
        "ended_by": session.ended_by,
        "photographs": session.photographs,
        "flown_m": 0.0 if session.at is None else session.at.flown_m,
        **harness.figures(),
        "cpu_s": time.thread_time() - began,
    }


def summary(
    flights: Sequence[dict[str, Any]], asked_of: Mapping[str, float] = ASKED, names: Sequence[str] = NAMES
) -> dict[str, Any]:
    """Mean and 95 % interval of each figure over flights, and whether it is within what is asked."""
    told: dict[str, Any] = {"flights": len(flights), "finished": sum(bool(flight["finished"]) for flight in flights)}
    for name in names:
        mean, ends = mean_interval([flight[name] for flight in flights])
        asked = asked_of.get(name)
        met = None if asked is None or ends is None else ends.high <= asked
        told[name] = {
            "mean": mean,
            "low": None if ends is None else ends.low,
            "high": None if ends is None else ends.high,
            "worst": max(flight[name] for flight in flights),
            "asked": asked,
            "met": met,
        }
    return told


def loss_figures() -> dict[str, Any]:
    """Seconds from each loss, injected on a line in a current, to the firmware's hold."""
    from wakewise_ardusub.sitl.survey_harness import BY_TIME_OUT, SURVEY_FAULTS, SurveyHarness, seconds_to_hold

    vehicle, found = load_vehicle(VEHICLE), dict[str, Any]()
    for name in SURVEYED or SURVEY_FAULTS:
        fault = SURVEY_FAULTS[name]
        harness = SurveyHarness(vehicle, current=lambda _: np.array([0.05, 0.08, 0.0]))
        took_s = seconds_to_hold(harness.flying(3.0), fault)
        asked = (TIME_OUT_S if name in BY_TIME_OUT else HOLD_S) + _LOOP_S
        found[name] = {"seconds": round(took_s, 3), "asked": asked, "met": took_s <= asked}
    return found


def show_survey(told: dict[str, Any]) -> None:
    """A row per figure and relief, and one per loss."""
    for relief in (*RELIEFS, "all", *CIRCLES):
        row = told[relief]
        typer.echo(f"{relief}: {row['finished']} of {row['flights']} flights finished")
        for name, each in row.items():
            if isinstance(each, dict):
                ends = "" if each["low"] is None else f" [{each['low']:.2f}, {each['high']:.2f}]"
                asked = "" if each["asked"] is None else f", asked {each['asked']:g}"
                typer.echo(f"  {name:<20}{each['mean']:6.2f}{ends}, worst {each['worst']:.2f}{asked}")
    for name, each in told["losses"].items():
        typer.echo(f"  {name:<38}{each['seconds']:6.2f} s, asked {each['asked']:.1f}")
    for name, each in told["surftrak"].items():
        typer.echo(
            f"  SURFTRAK's {name:<12} altitude {each['altitude_rms_cm']:5.1f} cm rms, the firmware's own mode "
            f"{each['firmware_rms_cm']:5.1f}"
        )
    show_by_hand(told["by_hand"])
    show_repeats(told)
