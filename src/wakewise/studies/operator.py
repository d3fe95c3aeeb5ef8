"""An operator flies by hand past a coral: how closely the vehicle obeys, and what that costs the water.

For each w_track of the paper's scale, `wake-aware` against `unaware` at the same weight, same commands, same seeds,
in the paper's own world (circular, see `wakewise.operation.instant_water`). The operator asks for 0.1 m/s, reached at
0.1 m/s2. Deviation is the rms of true less commanded velocity over the rms of the commanded one. Its parts are told,
too: what the plan itself deviates (all that w_track can set), what the vehicle deviates from its plan, and the floor,
which is what the same vehicle, estimator and tracker reach with `dp`, that obeys at once and spares nothing.

Two courses. `front`, the one of the figures on top: sideways, up, back and down in front of the target, camera on it,
where spare thrusters alone can keep every jet off it. `over`: to and fro above the target in a vehicle that sinks by
the largest unknown trim; its lift blows at the target whatever the spare thrusters do, and only disobedience is left.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.arrays import Array
from wakewise.control import ControlSettings, LeverSettings, PlanningController, make_controller
from wakewise.control.intent import Intent, goal_of, moved_on, obeying, slewed
from wakewise.interfaces import BodyState, Command, Controller, Goal, Witness
from wakewise.missions import open_route
from wakewise.operation import Scenario, fly
from wakewise.operation.instant_water import InstantWorld, paper_jets
from wakewise.operation.loop import Step
from wakewise.studies.gentle.paper import OFF, PAPER_WAKE, paper_place
from wakewise.tank import TankSettings
from wakewise.trials.timing import BenchOptions
from wakewise.vehicles import load_vehicle, perturbed
from wakewise.wake import WakeSettings, WakeView, disturbance, wake_model

W_TRACKS = (1.0, 2.0, 5.0, 10.0, 20.0)
SEEDS = (1, 2, 3)
SPEED_M_S, HOLD_S = 0.10, 5.0


@dataclass(frozen=True, kw_only=True)
class Course:
    """What the operator asks for: directions in W one after the other, from a place beside the target's centre.

    `watches`: the camera is kept on the target; otherwise the vehicle is level and heads north. `sinks`: heavier than
    believed by the largest trim; otherwise the trim is drawn.
    """

    from_target_m: tuple[float, float, float]
    legs_W: tuple[tuple[float, float, float], ...]
    leg_s: float
    watches: bool = True
    sinks: bool = False


COURSES = {
    "front": Course(
        from_target_m=(-0.65, -0.2, -0.30),
        legs_W=((0.0, 1.0, 0.0), (0.0, 0.0, -0.5), (0.0, -1.0, 0.0), (0.0, 0.0, 0.5)),
        leg_s=4.0,
    ),
    "over": Course(
        from_target_m=(0.0, -0.3, -0.42),
        legs_W=((0.0, 1.0, 0.0), (0.0, -1.0, 0.0)),
        leg_s=6.0,
        watches=False,
        sinks=True,
    ),
}
"""Climbing and sinking at half speed. 0.42 m above the target's centre leaves 0.2 m between hull and coral."""


@dataclass
class ScriptedOperator:
    """A `Pilot` that asks for one velocity after the other; holds its place for the first seconds."""

    course: Course
    watch_W_m: Array | None
    start: Goal
    dt_s: float
    velocity_W: Array = field(default_factory=lambda: np.zeros(3))
    place_W: Array = field(init=False)

    def __post_init__(self) -> None:
        self.place_W = self.start.X_WB.p_m

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Hold, then the leg's velocity, reached at 0.1 m/s2."""
        if time_s < HOLD_S:
            return self.start
        leg = min(int((time_s - HOLD_S) / self.course.leg_s), len(self.course.legs_W) - 1)
        self.velocity_W = slewed(self.velocity_W, SPEED_M_S * np.array(self.course.legs_W[leg]), self.dt_s)
        self.place_W = moved_on(self.place_W, self.velocity_W, estimate, self.dt_s)
        return goal_of(Intent(velocity_W_m_s=self.velocity_W, watch_W_m=self.watch_W_m), self.place_W)


@dataclass
class Overheard:
    """A controller, and what its plan expects now; implements `Controller`."""

    inner: Controller[Any]
    planned_W: Array | None = None

    @property
    def name(self) -> str:
        """Name of the controller within."""
        return self.inner.name

    def init(self) -> Any:
        """State before the first step."""
        return self.inner.init()

    def step(self, state: Any, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[Any, Command]:
        """Decide, and remember the velocity in W that the plan expects by then."""
        state, command = self.inner.step(state, dt_s, estimate, goal)
        expected = self.inner.expected(state) if isinstance(self.inner, PlanningController) else None
        self.planned_W = None if expected is None else _velocity(expected[3:7], expected[7:10])
        return state, command


@dataclass(frozen=True)
class Flown:
    """Figures of one flight; deviations in percent of the rms of the commanded velocity."""

    deviation: float
    planned: float
    behind_plan: float
    disturbance: float
    speed_m_s: float
    solve_ms: tuple[float, ...]


def run(options: BenchOptions) -> dict[str, Any]:
    """Sweep w_track on both courses."""
    latency: list[float] = []
    sweeps: dict[str, dict[str, Any]] = {}
    for number, (name, course) in enumerate(COURSES.items()):
        floor = [fly_course(course, "dp", 5.0, seed).deviation for seed in SEEDS]
        sweep: dict[str, Any] = {}
        for place, w_track in enumerate(W_TRACKS):
            done = number * len(W_TRACKS) + place
            options.progress(done, len(COURSES) * len(W_TRACKS), f"{name}, w_track {w_track:g}")
            gentle = [fly_course(course, "wake-aware", w_track, seed) for seed in SEEDS]
            careless = [fly_course(course, "unaware", w_track, seed) for seed in SEEDS]
            latency += [ms for flight in gentle for ms in flight.solve_ms]
            sweep[f"{w_track:g}"] = _row(gentle, careless, float(np.mean(floor)))
        sweeps[name] = sweep
    return {
        "w_track": sweeps["front"],
        "w_track_over": sweeps["over"],
        "latency_ms_p99": float(np.percentile(latency, 99)),
        "circular": True,
        "seeds": len(SEEDS),
    }


def _row(gentle: list[Flown], careless: list[Flown], floor: float) -> dict[str, float]:
    def mean(flights: list[Flown], what: str) -> float:
        return float(np.mean([getattr(flight, what) for flight in flights]))

    return {
        "velocity_deviation_pct": mean(gentle, "deviation"),
        "velocity_deviation_floor_pct": floor,
        "velocity_deviation_planned_pct": mean(gentle, "planned"),
        "velocity_deviation_behind_plan_pct": mean(gentle, "behind_plan"),
        "velocity_deviation_unaware_pct": mean(careless, "deviation"),
        "disturbance_reduction_pct": 100.0 * (1.0 - mean(gentle, "disturbance") / mean(careless, "disturbance")),
        "target_speed_reduction_pct": 100.0 * (1.0 - mean(gentle, "speed_m_s") / mean(careless, "speed_m_s")),
        "target_speed_mean_m_s": mean(gentle, "speed_m_s"),
    }


def fly_course(course: Course, method: str, w_track: float, seed: int) -> Flown:
    """One flight by one method."""
    vehicle, tank = load_vehicle("paper"), TankSettings()
    target, region = paper_place(tank.size_m[2])
    base = ControlSettings(wake=WakeSettings(**PAPER_WAKE), levers=LeverSettings(**OFF))
    control = base.model_copy(update={"plan": obeying(base.plan, w_track)})
    plant_rng, _ = np.random.default_rng([seed, 13]).spawn(2)
    trim_N = float(plant_rng.uniform(-tank.mismatch.trim_range_N, tank.mismatch.trim_range_N))
    true = perturbed(
        vehicle,
        plant_rng,
        mass_pct=5.0,
        damping_pct=30.0,
        added_mass_pct=20.0,
        thrust_pct=5.0,
        trim_N=-tank.mismatch.trim_range_N if course.sinks else trim_N,
    )
    watch = target.centre_W_m if course.watches else None
    rest = Intent(velocity_W_m_s=np.zeros(3), watch_W_m=watch)
    here = goal_of(rest, target.centre_W_m + np.array(course.from_target_m))
    start = BodyState(X_WB=here.X_WB)
    world = InstantWorld(
        name="paper",
        jets=paper_jets(),
        vehicle=true,
        target=target,
        settings=tank,
        start=start,
        draw=lambda: np.random.default_rng([seed, 13]).spawn(2)[1],
    )
    pilot = ScriptedOperator(course, watch, here, 1.0 / control.rate_hz)
    controller = Overheard(make_controller(method, vehicle, region, wake_model(control.wake), control))
    view = WakeView.of(vehicle, region, wake_model(WakeSettings(**PAPER_WAKE)))
    asked, done, planned, D, speed, solve_ms = [], [], [], [], [], []

    def record(step: Step, witness: Witness | None) -> None:
        solve_ms.append(1e3 * step.solve_s)
        if step.time_s < HOLD_S or step.truth is None or witness is None:
            return
        state = step.truth.state
        asked.append(pilot.velocity_W)
        done.append(state.X_WB.R @ state.nu_B[:3])
        planned.append(asked[-1] if controller.planned_W is None else controller.planned_W)
        if len(asked) % 5 == 0:
            D.append(disturbance(view.gram(state.X_WB), step.truth.thrusts_N))
            speed.append(witness.water().target_speed_mean_m_s)

    parts = Scenario(method=method, seed=seed, control=control, tank=tank).parts()
    flown = parts.replace(
        vehicle=vehicle,
        target=target,
        region=region,
        route=open_route(target.centre_W_m, HOLD_S + course.leg_s * len(course.legs_W)),
        start=start,
        pilot=pilot,
        controller=controller,
        world=world,
    )
    fly(flown, checked=False, watch=record)
    wished, true_W, plan_W = np.array(asked), np.array(done), np.array(planned)

    def percent(off: Array) -> float:
        return 100.0 * float(np.sqrt(np.mean(np.sum(off**2, axis=1)) / np.mean(np.sum(wished**2, axis=1))))

    return Flown(
        deviation=percent(true_W - wished),
        planned=percent(plan_W - wished),
        behind_plan=percent(true_W - plan_W),
        disturbance=float(np.mean(D)),
        speed_m_s=float(np.mean(speed)),
        solve_ms=tuple(solve_ms),
    )


def _velocity(q: Array, v_B: Array) -> Array:
    """Velocity in W, shape (3,)."""
    t = 2.0 * np.cross(q[1:], v_B)
    return np.asarray(v_B + q[0] * t + np.cross(q[1:], t))
