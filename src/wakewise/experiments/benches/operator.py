"""An operator flies by hand past a coral: how closely the vehicle obeys, and what that costs the water.

For each w_track of the paper's scale, `wake-aware` against `unaware` at the same weight, same commands, same seeds, in
the paper's own world (circular, see `paper_world`). The operator asks for 0.1 m/s sideways, up, back and down in front
of the target, camera on it. Deviation is the rms of true less commanded velocity over the rms of the commanded one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.arrays import Array
from wakewise.control import ControlSettings, WakeView, make_controller
from wakewise.control.intent import Intent, goal_of, moved_on, obeying, slewed
from wakewise.estimation import ErrorStateFilter
from wakewise.experiments.benches.gentle_trial import WAKE_OF, paper_place
from wakewise.experiments.benches.paper_world import PaperWorld
from wakewise.experiments.benches.timing import BenchOptions
from wakewise.geometry import Pose, look_at, quat_from_matrix
from wakewise.interfaces import BodyState, Goal
from wakewise.operation.loop import Step, fly
from wakewise.tank import TankSettings
from wakewise.vehicles import Vehicle, load_vehicle, perturbed
from wakewise.wake import WakeSettings, disturbance, wake_model

W_TRACKS = (1.0, 2.0, 5.0, 10.0, 20.0)
SEEDS = (1, 2, 3)
SPEED_M_S, LEG_S, HOLD_S = 0.10, 4.0, 5.0
LEGS_W = ((0.0, 1.0, 0.0), (0.0, 0.0, -0.5), (0.0, -1.0, 0.0), (0.0, 0.0, 0.5))
"""Directions of the commands, one after the other; climbing and sinking at half speed."""


@dataclass
class ScriptedOperator:
    """A `Pilot` that asks for one velocity after the other; holds its place for the first seconds."""

    watch_W_m: Array
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
        leg = min(int((time_s - HOLD_S) / LEG_S), len(LEGS_W) - 1)
        self.velocity_W = slewed(self.velocity_W, SPEED_M_S * np.array(LEGS_W[leg]), self.dt_s)
        self.place_W = moved_on(self.place_W, self.velocity_W, estimate, self.dt_s)
        return goal_of(Intent(velocity_W_m_s=self.velocity_W, watch_W_m=self.watch_W_m), self.place_W)


def run(options: BenchOptions) -> dict[str, Any]:
    """Sweep w_track."""
    vehicle = load_vehicle("paper")
    sweep: dict[str, dict[str, float]] = {}
    latency: list[float] = []
    for number, w_track in enumerate(W_TRACKS):
        gathered: dict[str, list[tuple[float, float, float]]] = {"wake-aware": [], "unaware": []}
        for seed in SEEDS:
            options.progress(number * len(SEEDS) + seed - 1, len(W_TRACKS) * len(SEEDS), f"w_track {w_track:g}")
            for method, rows in gathered.items():
                figures, solve_ms = _flown(vehicle, method, w_track, seed)
                rows.append(figures)
                if method == "wake-aware":
                    latency += solve_ms
        gentle, careless = (np.mean(gathered[m], axis=0) for m in ("wake-aware", "unaware"))
        sweep[f"{w_track:g}"] = {
            "velocity_deviation_pct": float(gentle[0]),
            "velocity_deviation_unaware_pct": float(careless[0]),
            "disturbance_reduction_pct": 100.0 * float(1.0 - gentle[1] / careless[1]),
            "target_speed_reduction_pct": 100.0 * float(1.0 - gentle[2] / careless[2]),
            "target_speed_mean_m_s": float(gentle[2]),
        }
    return {
        "w_track": sweep,
        "latency_ms_p99": float(np.percentile(latency, 99)),
        "circular": True,
        "seeds": len(SEEDS),
    }


def _flown(vehicle: Vehicle, method: str, w_track: float, seed: int) -> tuple[tuple[float, float, float], list[float]]:
    """Velocity deviation in percent, mean D and mean target speed of one flight, and the solve times in ms."""
    tank = TankSettings()
    target, region = paper_place(tank.size_m[2])
    base = ControlSettings(wake=WakeSettings(**WAKE_OF["paper"]))
    control = base.model_copy(update={"plan": obeying(base.plan, w_track)})
    plant_rng, tank_rng = np.random.default_rng([seed, 13]).spawn(2)
    trim_N = float(plant_rng.uniform(-tank.trim_range_N, tank.trim_range_N))
    true = perturbed(
        vehicle, plant_rng, mass_pct=5.0, damping_pct=30.0, added_mass_pct=20.0, thrust_pct=5.0, trim_N=trim_N
    )
    place = target.centre_W_m + np.array([-0.65, -0.2, -0.30])
    here = Pose(place, quat_from_matrix(look_at(place, target.centre_W_m)))
    world = PaperWorld(true, target, tank, BodyState(X_WB=here), tank_rng)
    dt_s = 1.0 / control.rate_hz
    pilot = ScriptedOperator(target.centre_W_m, Goal(X_WB=here), dt_s)
    view = WakeView.of(vehicle, region, wake_model(WakeSettings(**WAKE_OF["paper"])))
    asked, done, D, speed, solve_ms = [], [], [], [], []

    def record(step: Step) -> None:
        solve_ms.append(1e3 * step.solve_s)
        if step.time_s < HOLD_S or step.truth is None:
            return
        state = step.truth.state
        asked.append(pilot.velocity_W)
        done.append(state.X_WB.R @ state.nu_B[:3])
        if len(asked) % 5 == 0:
            D.append(disturbance(view.gram(state.X_WB), step.truth.thrusts_N))
            speed.append(world.water().target_speed_mean_m_s)

    fly(
        pilot=pilot,
        controller=make_controller(method, vehicle, region, wake_model(control.wake), control),
        estimator=ErrorStateFilter(vehicle),
        plant=world,
        witness=world,
        start=BodyState(X_WB=here),
        thrusters=len(vehicle.thrusters),
        duration_s=HOLD_S + LEG_S * len(LEGS_W),
        dt_s=dt_s,
        record=record,
    )
    wished = np.array(asked)
    off = np.linalg.norm(np.array(done) - wished, axis=1)
    deviation = 100.0 * float(np.sqrt(np.mean(off**2) / np.mean(np.sum(wished**2, axis=1))))
    return (deviation, float(np.mean(D)), float(np.mean(speed))), solve_ms
