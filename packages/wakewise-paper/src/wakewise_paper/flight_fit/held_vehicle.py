"""A vehicle that is held while one bow thruster after the other pushes: the jets one at a time, before its own camera.

Held by hand at the pool's side, in its frame or on the ground, far from what must not be harmed. Free flight cannot
show it: what pushes astern takes both bow thrusters, whose jets cross a hand's breadth ahead and are no two round jets
any more. Water, flakes and current are the tank's; thrusts differ by a tenth from what was asked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, FlakeCloud, Goal, Truth
from wakewise.operation.loop import Step
from wakewise.robot.vehicles import Vehicle
from wakewise.simulation.tank.flakes import Flakes
from wakewise.simulation.water import Water
from wakewise.simulation.water.round_jet_closure import JetSpreading
from wakewise.vision.imaging.camera import Camera
from wakewise_paper.flight_fit.flake_tracks import FlakeObserver, FlakeTracks
from wakewise_paper.learned_wake.truth import SampledWater

PUSH_S, LEVELS_N = 15.0, (0.3, 0.5, 0.8)
"""How long each push is, and how hard, in turn: harder ones are too fast for the frames, weaker ones bend at once."""
ARRIVED_S = 6.0
"""Into a push: the weakest jet has reached the end of the view, the last one has gone."""
CARRIED_S = 0.3
"""Flakes are carried on that often."""
DEPTH_M, BED_M = 0.75, 1.5
THRUST_ERROR = 0.1
STEP_S = 0.02
TURBULENCE = 0.25


@dataclass(frozen=True)
class _Steady:
    velocity_W_m_s: Array
    steady = True
    uniform = True

    def velocity(self, points_W_m: Array, time_s: float) -> Array:  # noqa: ARG002
        return np.tile(self.velocity_W_m_s, (len(points_W_m), 1))


@dataclass
class _Held:
    """Who knows the flakes of the held vehicle's water."""

    drifting: Flakes
    water: Water
    time_s: float = 0.0

    def flakes(self, X_WC: Pose) -> FlakeCloud:
        return self.drifting.before(X_WC, self.time_s, self.water)


def bow_jets(vehicle: Vehicle) -> list[tuple[int, float]]:
    """Thrusters, and the sign of their thrust, whose jet goes forward and level before the camera's plane."""
    X_BC = vehicle.X_BC_at(0.0)
    found = []
    for i, (place, axis) in enumerate(zip(vehicle.thruster_positions_B_m, vehicle.thruster_axes_B, strict=True)):
        for sign in (1.0, -1.0):
            middle = X_BC.inverse().apply((place - sign * 0.35 * axis)[None])[0]
            ahead = middle[2] > 0.0 and np.hypot(*middle[:2]) < middle[2]
            if ahead and place[0] > 0.0:
                found.append((i, sign))
    return found


def held_sightings(
    vehicle: Vehicle,
    camera: Camera,
    drawn: SampledWater,
    current_m_s: Array,
    rng: np.random.Generator,
    *,
    minutes: float,
    per_m3: float,
) -> FlakeTracks:
    """What the camera sees of so many minutes of pushes; pairs of frames count once a push has gone on for a while."""
    X_WB = Pose(np.array([0.0, 0.0, DEPTH_M]))
    X_WC = X_WB @ vehicle.X_BC_at(0.0)
    ambient = _Steady(np.asarray(current_m_s, dtype=np.float64))
    water = Water(
        vehicle.disk_areas_m2,
        density_kg_m3=FRESH_WATER_KG_M3,
        bed_z_m=BED_M,
        rng=rng.spawn(1)[0],
        ambient=ambient,
        turbulence=TURBULENCE,
        spreading=JetSpreading.of_width(drawn.half_width_growth),
        wake_life=drawn.wake_life,
    )
    middle = X_WC.apply(np.array([[0.0, 0.0, 0.35]]))[0]
    held = _Held(Flakes(middle, BED_M, ambient, rng.spawn(1)[0]), water)
    watcher = FlakeObserver(camera=camera, vehicle=vehicle, rng=rng.spawn(1)[0], per_m3=per_m3)
    origins, axes = X_WB.apply(vehicle.thruster_positions_B_m), vehicle.thruster_axes_B @ X_WB.R.T
    n = len(vehicle.thrusters)
    true_share = rng.uniform(1.0 - THRUST_ERROR, 1.0 + THRUST_ERROR, n)
    jets = bow_jets(vehicle)
    state = BodyState(X_WB=X_WB)
    for k in range(math.ceil(60.0 * minutes / STEP_S)):
        now = k * STEP_S
        turn = int(now / PUSH_S)
        i, sign = jets[turn % len(jets)]
        asked = np.zeros(n)
        asked[i] = sign * LEVELS_N[(turn // len(jets)) % len(LEVELS_N)]
        held.time_s = now
        if k % round(CARRIED_S / STEP_S) == 0:
            held.drifting.move(now, water)
        if now - turn * PUSH_S >= ARRIVED_S:
            watcher.watch(_step(now, state, asked), held)  # type: ignore[arg-type]
        pushed = STEP_S * asked * true_share
        water.step(
            STEP_S, origins, origins, axes, np.stack([np.maximum(pushed, 0.0), np.maximum(-pushed, 0.0)], axis=1)
        )
    return watcher.sightings()


def _step(now: float, state: BodyState, thrusts_N: Array) -> Step:
    return Step(
        time_s=now,
        goal=Goal(X_WB=state.X_WB),
        estimate=state,
        command=Command(thrusts_N=thrusts_N, wrench_B=np.zeros(6)),
        truth=Truth(state=state, thrusts_N=thrusts_N, power_W=0.0, collision=False),
        solve_s=0.0,
    )
