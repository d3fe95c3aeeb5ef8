"""A person flies a line of a survey by hand, beside `wakewise link transect` in the same simulated sea.

Written down before the figures were known:

- asked: wash at the bed under the line at least 60 % below that of a person at 20 % of the pilot gain, or
  the reason;
- pairs: seeds 0 to `PAIRS` - 1, relief by turns, one line of `LINE_M` each, with the draws of `survey.flight_figures`
  (bed, current, heading) and a trim of -3.3 to 3.3 N beyond the vehicle's own, as the world `close` draws it;
- wash: thrusts that the thrusters give, by the wake model that the package predicts with (jet, and wall jets along the
  bed), in water at rest, as the wash meter has it. Points: the bed from 0.3 m behind to 0.8 m ahead of the vehicle's
  middle along the line, 0.3 m to each side. Root mean square over points and over the time on the line. `carried`: the
  same with jets that the water carries past the moving vehicle; `level`, `vertical`: of those thrusters alone, at rest;
- the person is that of `control.operator_model`, drawn by the seed, at a gain of 20 %, in ALT_HOLD, with
  MANUAL_CONTROL. Seen, late as the model has it: speed and way along the line against 10 cm/s, at most `LEASH_M` of way
  owed (by the Doppler log), the place across it (a tape in the picture), altitude (by the rangefinder: its delay and
  noise, five times a second), heading;
- in favour of the person: numbers on a display have no error of the eye, outliers and drop-outs of the rangefinder are
  ignored, and a practised hand knows which push gives which force, dead zone of the thrusters included. Slower climbs
  and turns than the dead zones of these sticks allow (half and a quarter of the stick at 20 %) are made by nudges.

`allocated` was added later: the same line by `wakewise link transect --allocate`, beside both.

`REASONS` was added after the first flights, which showed no reduction: on `REASON_PAIRS` seeds the survey's wash
without weight in water, without the pitching moment of the level thrusters, and over a level bed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from wakewise.control.manual import vehicle_sticks
from wakewise.control.operator_model import (
    THUMB_S,
    CameraMotion,
    OperatorModel,
    OperatorModelState,
    StickDeflection,
    begin,
    sample_operator,
    steer,
)
from wakewise.control.operator_population import OperatorPopulation
from wakewise.control.pid import make_pid
from wakewise.control.settings import ControlSettings
from wakewise.control.velocity_reference import LEASH_M
from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.geometry import Pose, euler_from_quat, matrix_from_quat, quat_from_euler
from wakewise.core.interfaces import BodyState
from wakewise.experiments.campaigns.statistics import log_reduction_pct, mean_interval
from wakewise.operation.teleop.human_pilot import ANSWER_S
from wakewise.robot.vehicles import Vehicle
from wakewise.wake import WakeSettings, wake_model
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.disturbance import advected_velocity, unit_velocity

if TYPE_CHECKING:
    from wakewise_ardusub.physics.datagrams import PhysicsState
    from wakewise_ardusub.sitl.sea_sensors import Relief

PAIRS, LINE_M, LEAST_PCT = 10, 20.0, 60.0
REASON_PAIRS = 5
"""Seeds on which `REASONS` are flown, the first ones."""
GAIN = 0.2
"""Pilot gain: in 56 % of the rows of public dive logs (`wakewise.control.operator_population`)."""
TRIM_N = 3.3
"""As the world `close`: 13.5 kg of vehicle between fresh and sea water, trimmed in either."""
SPEED_M_S, ALTITUDE_M, DEPTH_M = 0.1, 0.8, 3.6
SETTLE_S = 30.0
"""Time of the person at the start of the line, for the altitude and the current; the survey has 8 to 40 s."""
LOOP_HZ, LOOPS_A_ROW, LOOPS_A_RANGE = 50.0, 5, 10
FOOTPRINT_M = np.array([[x, y] for x in np.arange(-0.3, 0.85, 0.1) for y in np.arange(-0.3, 0.35, 0.1)])
"""Points on the bed, ahead and to the right of the vehicle's middle along the line."""
KINDS = ("wash", "carried", "level", "vertical")
FIGURES = (
    *(f"{kind}_mm_s" for kind in KINDS),
    *("speed_mean_cm_s", "speed_rms_cm_s", "altitude_p95_cm", "cross_track_p95_cm"),
)


@dataclass(frozen=True, kw_only=True)
class SurveySea:
    """One sea: bed, current over time, heading of the line and the vehicle in its trim."""

    relief: Relief
    current: Callable[[float], Array]
    heading_rad: float
    vehicle: Vehicle
    trim_N: float

    @classmethod
    def drawn(cls, vehicle: Vehicle, seed: int) -> SurveySea:
        """That of a seed."""
        from wakewise_ardusub.sitl.sea_sensors import SHAPES, Relief, drawn_current
        from wakewise_benchmarks.survey import RELIEFS
        from wakewise_benchmarks.survey_orbits import FASTEST_CURRENT_M_S

        index = seed % len(RELIEFS)
        rng = np.random.default_rng([seed, index])
        bed = Relief.drawn(next(shape for shape in SHAPES if shape == RELIEFS[index]), rng)
        current = drawn_current(rng, float(rng.uniform(0.0, FASTEST_CURRENT_M_S)))
        heading = float(rng.uniform(-0.5, 0.5))
        trim_N = float(rng.uniform(-TRIM_N, TRIM_N))
        volume = vehicle.displaced_volume_m3 + trim_N / (TRIM_WATER_KG_M3 * GRAVITY_M_S2)
        trimmed = replace(vehicle, displaced_volume_m3=volume)
        return cls(relief=bed, current=current, heading_rad=heading, vehicle=trimmed, trim_N=trim_N)


@dataclass
class BedWash:
    """Mean square speed of the wash on the bed along one line, and how the line was flown; a row each 0.1 s."""

    sea: SurveySea
    way: Array
    """Direction of the line, shape (2,)."""
    start_W_m: Array
    """Where it begins, shape (2,)."""
    squares: list[list[float]] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)

    def take(self, motion: PhysicsState, thrusts_N: Array, time_s: float) -> None:
        """One instant by the truth; thrusts, shape (m,)."""
        place, v_W = motion.p_WB_m, motion.v_W_m_s
        right = np.array([-self.way[1], self.way[0]])
        bed_m = self.sea.relief.bed_m(float(place[0]), float(place[1]))
        flat = place[:2] + FOOTPRINT_M[:, :1] * self.way + FOOTPRINT_M[:, 1:] * right
        points = np.column_stack([flat, np.full(len(flat), bed_m)])
        self.squares.append(self._squares(motion, thrusts_N, points, self.sea.current(time_s) - v_W))
        off = place[:2] - self.start_W_m
        self.rows.append([float(v_W[:2] @ self.way), bed_m - float(place[2]), float(off @ right)])

    def _squares(self, motion: PhysicsState, thrusts_N: Array, points: Array, past_W_m_s: Array) -> list[float]:
        vehicle, R = self.sea.vehicle, matrix_from_quat(motion.q_WB)
        runs = np.abs(thrusts_N) > 0.0
        if not runs.any():
            return [0.0] * len(KINDS)
        thrusts = thrusts_N[runs]
        axes_B = vehicle.thruster_axes_B[runs]
        origins = motion.p_WB_m + vehicle.thruster_positions_B_m[runs] @ R.T
        jets = (origins, -np.sign(thrusts)[:, None] * (axes_B @ R.T), vehicle.disk_areas_m2[runs])
        model = wake_model(WakeSettings(), float(points[0, 2]))
        rest = unit_velocity(model, points, *jets)
        flow = CrossFlow(current_W_m_s=past_W_m_s, current_std_m_s=0.0, thrusts_N=thrusts)
        carried = advected_velocity(model, points, *jets, np.abs(thrusts), flow)
        roots, upright = np.sqrt(np.abs(thrusts)), np.abs(axes_B[:, 2]) > math.sqrt(0.5)
        ways = ((rest, roots), (carried, roots), (rest, roots * ~upright), (rest, roots * upright))
        return [float(np.mean(np.sum(np.einsum("i,inx->nx", s, v) ** 2, axis=1))) for v, s in ways]

    def figures(self) -> dict[str, float]:
        """Wash in mm/s, speed, altitude and place across the line."""
        rows = np.array(self.rows)
        speed, altitude, across = rows.T
        wash = 1e3 * np.sqrt(np.mean(self.squares, axis=0))
        return {
            **{f"{kind}_mm_s": float(value) for kind, value in zip(KINDS, wash, strict=True)},
            "speed_mean_cm_s": 100.0 * float(speed.mean()),
            "speed_rms_cm_s": 100.0 * float(np.sqrt(np.mean((speed - SPEED_M_S) ** 2))),
            "altitude_p95_cm": 100.0 * float(np.percentile(np.abs(altitude - ALTITUDE_M), 95)),
            "cross_track_p95_cm": 100.0 * float(np.percentile(np.abs(across), 95)),
            "seconds": len(rows) / 10.0,
        }


class LinePilot:
    """A person at the sticks of an autopilot in ALT_HOLD; `sticks` gives MANUAL_CONTROL's numbers.

    Parameters
    ----------
    sea : SurveySea
    values : dict
        The autopilot's parameters, which say what sticks do.
    seed : int
    range_delay_s, range_noise_m : float
        Of the rangefinder's altitude on the display.
    """

    def __init__(
        self, sea: SurveySea, values: dict[str, float], seed: int, range_delay_s: float, range_noise_m: float
    ) -> None:
        from wakewise_ardusub.sitl.modes import CENTRED, YAW_RATE_RAD_S

        vehicle = sea.vehicle
        self._pushes = [stick_forces(vehicle, values, axis) for axis in ("forward", "lateral")]
        own = vehicle_sticks(vehicle, make_pid(vehicle, ControlSettings()))
        full_N = [min(float(forces[-1]), float(-forces[0])) for forces, _ in self._pushes]
        sticks = StickDeflection(
            inertia=own.inertia,
            drag=own.drag,
            # The model has full stick over full thrust; what 20 % of the pulses give is less than 20 % of the thrust.
            full=np.array([*(f / GAIN for f in full_N), 1e-2 * values["PILOT_SPEED_UP"], YAW_RATE_RAD_S]),
            lag_s=np.array([*own.lag_s[:2], ANSWER_S + range_delay_s, ANSWER_S]),
        )
        drawn = sample_operator(seed, sticks, OperatorPopulation(gain=(GAIN, GAIN)))
        # Across the line the eye errs as about the middle of the picture; the other three are numbers on a display.
        self.person: OperatorModel = replace(drawn, drift=np.array([0.0, drawn.drift[3], 0.0, 0.0]))
        self._state: OperatorModelState = begin(self.person)
        self._rng = np.random.default_rng([seed, 3])
        self._noise_m = range_noise_m
        self._altitudes: deque[float] = deque(maxlen=max(round(range_delay_s * LOOP_HZ), 1))
        self._shown_m, self._loops, self._ahead_m = math.nan, 0, 0.0
        self._dead = np.array([1e-3 * values["THR_DZ"], CENTRED]) / GAIN
        self._owed, self._nudge_s, self._way = np.zeros(2), np.zeros(2), np.zeros(2)

    def sticks(
        self, speed_m_s: float, place_m: Array, v_line_m_s: Array, off_rad: float, turn: float, altitude_m: float
    ) -> tuple[int, int, int, int]:
        """x, y, z and r after one loop, the line flown at a speed.

        Seen: place along and across the line, shape (2,), velocity along, across and down, shape (3,), angle off the
        line and its rate, and the altitude.
        """
        ahead_m = self._ahead_m + speed_m_s / LOOP_HZ
        self._ahead_m = min(max(ahead_m, float(place_m[0]) - LEASH_M), float(place_m[0]) + LEASH_M)
        self._altitudes.append(altitude_m)
        if self._loops % LOOPS_A_RANGE == 0:
            self._shown_m = self._altitudes[0] + self._noise_m * float(self._rng.normal())
        self._loops += 1
        view = CameraMotion(
            p_W_m=np.array([*place_m, -self._shown_m]),
            heading_rad=off_rad,
            v_W_m_s=v_line_m_s,
            turn_rad_s=turn,
            hull_W_m_s=v_line_m_s,
        )
        pace = np.array([speed_m_s, 0.0, 0.0])
        goal_view = CameraMotion(
            p_W_m=np.array([self._ahead_m, 0.0, -ALTITUDE_M]),
            heading_rad=0.0,
            v_W_m_s=pace,
            turn_rad_s=0.0,
            hull_W_m_s=pace,
        )
        self._state, asked = steer(self.person, self._state, 1.0 / LOOP_HZ, view, goal_view)
        x, y = (_stick_for(float(asked[k]), *self._pushes[k]) for k in (0, 1))
        down, turned = self._nudged(asked[2:] / (GAIN * self.person.sticks.full[2:]))
        return round(1e3 * x), round(1e3 * y), round(500.0 - 500.0 * down), round(1e3 * turned)

    def _nudged(self, shares: Array) -> tuple[float, float]:
        """Sticks of depth and turn, shape (2,): what lies in their dead zone is made by nudges out of it, as often."""
        inside = np.abs(shares) <= self._dead
        self._owed = np.where(inside, self._owed + shares / LOOP_HZ, 0.0)
        self._nudge_s = np.where(inside, self._nudge_s - 1.0 / LOOP_HZ, 0.0)
        due = inside & (self._nudge_s <= 0.0) & (np.abs(self._owed) >= self._dead * THUMB_S)
        self._way = np.where(due, np.sign(self._owed), self._way)
        self._nudge_s = np.where(due, THUMB_S, self._nudge_s)
        self._owed = self._owed - np.where(due, np.sign(self._owed) * self._dead * THUMB_S, 0.0)
        sticks = np.where(inside, np.where(self._nudge_s > 0.0, self._way * (self._dead + 0.01), 0.0), shares)
        return float(sticks[0]), float(sticks[1])


def stick_forces(vehicle: Vehicle, values: dict[str, float], axis: str) -> tuple[Array, Array]:
    """Force (N) that a stick gives at `GAIN`, increasing, and the stick in [-1, 1]; the dead zone is left out but 0."""
    from wakewise_ardusub.physics.physics import PulseTable
    from wakewise_ardusub.sitl.modes import PilotDemands, directions_of, factors_of, motor_pulses_us
    from wakewise_ardusub.sitl.own_parameters import ParameterTable

    parameters, table = ParameterTable(values), PulseTable.of(vehicle, values)
    factors = factors_of(parameters)
    directions = directions_of(parameters, len(factors))
    row, pairs = {"forward": 0, "lateral": 1}[axis], [(0.0, 0.0)]
    for stick in np.linspace(-1.0, 1.0, 201):
        pulses = motor_pulses_us(PilotDemands(**{axis: GAIN * float(stick)}), factors, directions)
        force = float((vehicle.allocation_matrix @ table.thrusts(tuple(pulses)))[row])
        if abs(force) > 1e-9:
            pairs.append((force, float(stick)))
    forces, sticks = np.array(sorted(pairs)).T
    return forces, sticks


def _stick_for(force_N: float, forces: Array, sticks: Array) -> float:
    return 0.0 if force_N == 0.0 else float(np.interp(force_N, forces, sticks))


def by_hand(sea: SurveySea, start_W_m: Array, heading_rad: float, seed: int, length_m: float = LINE_M) -> BedWash:
    """A person flies one line of a length from a place, shape (2,), along a heading."""
    from wakewise_ardusub.link.protocol import ALT_HOLD
    from wakewise_ardusub.physics.surface import FreeWater
    from wakewise_ardusub.sitl.inprocess_session import InProcessSession
    from wakewise_ardusub.sitl.own_parameters import own_parameters
    from wakewise_ardusub.sitl.sea_sensors import SeaSensors, SensorErrors

    way = np.array([math.cos(heading_rad), math.sin(heading_rad)])
    place = np.array([*start_W_m, DEPTH_M])
    body = FreeWater(sea.vehicle, BodyState(X_WB=Pose(place, quat_from_euler(0.0, 0.0, heading_rad))), sea.current)
    errors = SensorErrors()
    values = own_parameters(len(sea.vehicle.thrusters)) | {"JS_GAIN_DEFAULT": GAIN}
    flight = InProcessSession(
        sea.vehicle,
        loop_hz=LOOP_HZ,
        values=values,
        scripts={},
        body=body,
        sensors=SeaSensors(sea.relief, errors, np.random.default_rng(seed)),
    )
    pilot = LinePilot(sea, values, seed, errors.delay_s, errors.range_noise_m)
    wash = BedWash(sea=sea, way=way, start_W_m=start_W_m)
    frame = np.array([[way[0], way[1], 0.0], [-way[1], way[0], 0.0], [0.0, 0.0, 1.0]])
    loops, begin_m, along_m = 0, math.nan, 0.0

    def turn() -> None:
        nonlocal loops, begin_m, along_m
        loops += 1
        flight.moments.clear()
        flight.said.clear()
        told, true = flight.autopilot.estimated, flight.autopilot.motion
        off = math.remainder(euler_from_quat(told.q_WB)[2] - heading_rad, 2.0 * math.pi)
        altitude_m = sea.relief.bed_m(float(true.p_WB_m[0]), float(true.p_WB_m[1])) - float(true.p_WB_m[2])
        place_m = frame[:2, :2] @ (true.p_WB_m[:2] - start_W_m)
        going = loops > SETTLE_S * LOOP_HZ
        turns = float(told.omega_B_rad_s[2])
        speed = SPEED_M_S if going else 0.0
        flight.sticks = pilot.sticks(speed, place_m, frame @ told.v_W_m_s, off, turns, altitude_m)
        if going:
            begin_m = float(place_m[0]) if math.isnan(begin_m) else begin_m
            along_m = float(place_m[0]) - begin_m
            if loops % LOOPS_A_ROW == 0:
                wash.take(true, body.thrusts_N, true.time_s)

    flight.run(0.3)
    flight.arm(True)
    flight.set_mode(ALT_HOLD)
    flight.turns.append(turn)
    end_s = flight.now_s + SETTLE_S + 2.0 * length_m / SPEED_M_S
    while along_m < length_m and flight.now_s < end_s:
        flight.run(0.5)
    return wash


def by_survey(sea: SurveySea, seed: int, length_m: float = LINE_M, *, allocates: bool = False) -> BedWash:
    """`wakewise link transect` flies one line; raises WakewiseError where it is not flown to its end."""
    from wakewise.core.errors import WakewiseError
    from wakewise_ardusub.physics.surface import FreeWater
    from wakewise_ardusub.sitl.survey_harness import SurveyHarness, straight_line

    harness = SurveyHarness(
        sea.vehicle,
        relief=sea.relief,
        current=sea.current,
        lines=straight_line(length_m),
        seed=seed,
        heading_rad=sea.heading_rad,
        depth_m=DEPTH_M,
        allocates=allocates,
    )
    found: list[BedWash] = []
    body = harness.flight.body

    def turn() -> None:
        session, motion = harness.session, harness.flight.autopilot.motion
        if len(harness.rows) == sum(len(wash.rows) for wash in found) or session.plan is None or session.at is None:
            return
        if not found:
            leg = session.plan.legs[session.at.leg]
            found.append(BedWash(sea=sea, way=leg.direction, start_W_m=leg.place_at(0.0)))
        if isinstance(body, FreeWater):
            found[0].take(motion, body.thrusts_N, motion.time_s)

    harness.flight.turns.append(turn)
    harness.ready().session.consent()
    session = harness.to_the_end(300.0 + 4.0 * length_m / SPEED_M_S).session
    if not session.finished or not found:
        raise WakewiseError(f"survey in simulation: seed {seed}: {session.ended_by}")
    return found[0]


def pair_figures(vehicle: Vehicle, seed: int, length_m: float = LINE_M) -> dict[str, Any]:
    """One line of one sea by the survey, with allocated thrusts and by a person; on the first seeds by the survey
    without what causes wash.
    """
    sea = SurveySea.drawn(vehicle, seed)
    survey = by_survey(sea, seed, length_m)
    heading = math.atan2(survey.way[1], survey.way[0])
    told: dict[str, Any] = {"seed": seed, "relief": sea.relief.shape, "trim_N": sea.trim_N}
    told |= {"current_m_s": float(np.linalg.norm(sea.current(20.0))), "survey": survey.figures()}
    told["allocated"] = by_survey(sea, seed, length_m, allocates=True).figures()
    told["person"] = by_hand(sea, survey.start_W_m, heading, seed, length_m).figures()
    for name, without in REASONS.items() if seed < REASON_PAIRS else ():
        told[name] = by_survey(without(sea), seed, length_m).figures()
    return told


def hand_figures(vehicle: Vehicle, seeds: int, progress: Callable[[int, int, str], None]) -> dict[str, Any]:
    """The pairs of so many seeds, at most `PAIRS`, and their summary."""
    count, pairs = min(seeds, PAIRS), list[dict[str, Any]]()
    for seed in range(count):
        progress(seed, count, f"by hand, seed {seed}")
        pairs.append(pair_figures(vehicle, seed))
    progress(count, count, "")
    return {**hand_summary(pairs), "flights": pairs}


def weightless(sea: SurveySea) -> SurveySea:
    """The vehicle trimmed to no weight in water."""
    vehicle = replace(sea.vehicle, displaced_volume_m3=sea.vehicle.mass_kg / TRIM_WATER_KG_M3)
    return replace(sea, vehicle=vehicle)


def without_pitch(sea: SurveySea) -> SurveySea:
    """And its level thrusters at the height of its origin: they do not pitch it."""
    level = np.array([1.0, 1.0, 0.0])
    moved = [
        one if abs(one.axis_B[2]) > math.sqrt(0.5) else replace(one, p_BT_m=one.p_BT_m * level)
        for one in sea.vehicle.thrusters
    ]
    sea = weightless(sea)
    return replace(sea, vehicle=replace(sea.vehicle, thrusters=tuple(moved)))


def over_a_level_bed(sea: SurveySea) -> SurveySea:
    """And over a level bed."""
    return replace(without_pitch(sea), relief=replace(sea.relief, shape="flat", depth_m=DEPTH_M + 1.0))


REASONS: dict[str, Callable[[SurveySea], SurveySea]] = {
    "no weight": weightless,
    "no weight, no pitch": without_pitch,
    "no weight, no pitch, level bed": over_a_level_bed,
}
"""What makes vertical thrusters blow, taken away from the survey, one after the other."""


def hand_summary(pairs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Reduction of each kind of wash over pairs, with its 95 % interval; figures of both; and what the wash is due to.

    `reasons`: reduction of the survey's wash where its vehicle lacks what `REASONS` takes away.
    """
    told: dict[str, Any] = {"pairs": len(pairs), "gain": GAIN, "asked_pct": LEAST_PCT}
    for kind in KINDS:
        told[f"{kind}_pct"] = _reduction(pairs, "person", "survey", f"{kind}_mm_s")
    low = told["wash_pct"]["low"]
    told["wash_pct"]["met"] = None if low is None else low >= LEAST_PCT
    for kind in ("wash", "carried"):
        told[f"allocated_{kind}_pct"] = _reduction(pairs, "survey", "allocated", f"{kind}_mm_s")
        told[f"allocated_against_person_{kind}_pct"] = _reduction(pairs, "person", "allocated", f"{kind}_mm_s")
    looked_into = [pair for pair in pairs if pair["seed"] < REASON_PAIRS]
    told["reasons"] = {name: _reduction(looked_into, "survey", name, "wash_mm_s") for name in REASONS}
    for who in ("survey", "allocated", "person", *REASONS):
        own = [pair[who] for pair in pairs if who in pair]
        told[who] = {name: _mean([one[name] for one in own]) for name in FIGURES}
    return told


def _mean(values: list[float]) -> dict[str, float | None]:
    mean, ends = mean_interval(values)
    return {"mean": mean, "low": None if ends is None else ends.low, "high": None if ends is None else ends.high}


def _reduction(pairs: Sequence[dict[str, Any]], base: str, ours: str, figure: str) -> dict[str, float | None]:
    speeds = [(1e-3 * pair[base][figure], 1e-3 * pair[ours][figure], "") for pair in pairs]
    mean, ends, worst = log_reduction_pct(list(speeds))
    told = {"mean": mean, "low": None if ends is None else ends.low, "high": None if ends is None else ends.high}
    return {**told, "worst": worst}


def show_by_hand(told: dict[str, Any]) -> None:
    """Reductions and figures, one a row."""
    typer.echo(f"by hand at {100.0 * told['gain']:.0f} % pilot gain: {told['pairs']} pairs")
    rows = {f"{kind}, reduction": (told[f"{kind}_pct"], "%") for kind in KINDS}
    for kind in ("wash", "carried"):
        rows[f"allocated thrusts against the survey: {kind}, reduction"] = (told[f"allocated_{kind}_pct"], "%")
        against = told[f"allocated_against_person_{kind}_pct"]
        rows[f"allocated thrusts against the person: {kind}, reduction"] = (against, "%")
    rows |= {f"{who}: {name}": (told[who][name], "") for who in ("survey", "allocated", "person") for name in FIGURES}
    rows |= {f"survey, {name}: wash, reduction": (one, "%") for name, one in told["reasons"].items()}
    for name, (one, unit) in rows.items():
        ends = "" if one["low"] is None else f" [{one['low']:.1f}, {one['high']:.1f}]"
        typer.echo(f"  {name:<48}{one['mean']:7.1f}{unit}{ends}")
