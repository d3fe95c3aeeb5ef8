"""A plant with a truth provider as the body behind a firmware."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState, Truth
from wakewise.operation.scenario import Scenario
from wakewise.operation.worlds.lattice_world import LatticeWater
from wakewise.operation.worlds.quasi_steady_world import QuasiSteadyWater
from wakewise.robot.vehicles import load_vehicle
from wakewise.simulation.tank.tank import Tank
from wakewise_ardusub.physics import PhysicsServer, PulseTable, ServoFrame, read_reply, write_request
from wakewise_ardusub.physics.surface import WaterSurface
from wakewise_ardusub.sitl_plant import PlantBody, SitlPlant

HEAVY = load_vehicle("bluerov2-heavy")
TURNED = quat_from_euler(0.3, -0.2, 1.1)


class Sledge:
    """Moves in W at an acceleration of thrust 0, 1, 2 over a mass of 1 kg, its attitude fixed."""

    def __init__(self) -> None:
        self.p, self.v = np.zeros(3), np.array([0.1, 0.0, 0.0])
        self.held: list[float] = []

    def step(self, thrusts_N: np.ndarray, dt_s: float) -> tuple[()]:
        self.held.append(dt_s)
        self.v = self.v + dt_s * thrusts_N[:3]
        self.p = self.p + dt_s * self.v
        return ()

    def observe(self) -> Truth:
        X_WB = Pose(self.p, TURNED)
        nu_B = np.concatenate([X_WB.R.T @ self.v, [0.0, 0.0, 0.2]])
        state = BodyState(X_WB=X_WB, nu_B=nu_B)
        return Truth(state=state, thrusts_N=np.zeros(3), power_W=0.0, collision=False)


class World:
    """A sledge, with or without somebody who knows its truth."""

    name = "sledge"

    def __init__(self, known: bool = True) -> None:
        self.known = known

    def begin(self) -> tuple[Sledge, Sledge | None]:
        sledge = Sledge()
        return sledge, sledge if self.known else None


def test_the_specific_force_is_acceleration_less_gravity_in_the_body() -> None:
    """Exactly, over any step; place, velocity and rate are the truth provider's."""
    sledge = Sledge()
    body = PlantBody(sledge, sledge)
    push = np.array([0.5, -0.25, 0.75])
    for dt_s in (0.0025, 0.01, 0.0025):
        motion = body.step(push, dt_s)
        R_WB = Pose(np.zeros(3), motion.q_WB).R
        assert R_WB @ motion.force_B_m_s2 == pytest.approx(push - [0.0, 0.0, GRAVITY_M_S2])
    assert motion.v_W_m_s == pytest.approx(np.array([0.1, 0.0, 0.0]) + 0.015 * push)
    assert motion.p_WB_m == pytest.approx(sledge.p)
    assert motion.omega_B_rad_s == pytest.approx([0.0, 0.0, 0.2])
    assert motion.time_s == pytest.approx(0.015)


def test_each_start_is_the_same_and_a_world_without_truth_is_refused() -> None:
    """A firmware can only be told what somebody knows."""
    parts = Scenario.preset("quick").parts()
    behind = SitlPlant(parts=parts.replace(world=World()))
    moved = behind.begin()
    moved.step(np.ones(8), 0.1)
    again = behind.begin().step(np.zeros(8), 0.1)
    assert again.p_WB_m == pytest.approx([0.01, 0.0, 0.0])
    with pytest.raises(InputError, match="nobody knows the truth"):
        SitlPlant(parts=parts.replace(world=World(known=False))).begin()


class Buoy(Sledge):
    """A sledge that can be pushed: the vehicle's mass and added mass, neither weight nor buoyancy left over."""

    def __init__(self) -> None:
        super().__init__()
        self.p, self.v, self.wrench_B = np.array([0.0, 0.0, 1.0]), np.zeros(3), np.zeros(6)

    def push(self, wrench_B: np.ndarray) -> None:
        self.wrench_B = wrench_B

    def step(self, thrusts_N: np.ndarray, dt_s: float) -> tuple[()]:
        lift = Pose(self.p, TURNED).R @ (HEAVY.allocation_matrix @ thrusts_N + self.wrench_B)[:3]
        self.v = self.v + dt_s * (lift - 60.0 * np.abs(self.v) * self.v - 10.0 * self.v) / 26.0
        self.p = self.p + dt_s * self.v
        return ()


def test_a_vehicle_cannot_leave_the_water() -> None:
    """All thrusters up for a minute: it never has more than its hull above the surface; without a surface it flies."""
    up = np.linalg.pinv(HEAVY.allocation_matrix) @ np.concatenate(
        [Pose(np.zeros(3), TURNED).R.T @ [0.0, 0.0, -80.0], np.zeros(3)]
    )
    highest = {}
    for surface in (WaterSurface.of(HEAVY), None):
        buoy = Buoy()
        body = PlantBody(buoy, buoy, surface)
        highest[surface is not None] = min(float(body.step(up, 0.02).p_WB_m[2]) for _ in range(3000))
    assert highest[True] > -0.5 * float(np.linalg.norm(HEAVY.size_m))
    assert highest[False] < -5.0


@pytest.mark.parametrize("water", [Tank, QuasiSteadyWater, LatticeWater])
def test_every_plant_of_this_package_can_be_given_a_surface(water: Any) -> None:
    """Each world begins with one of these; a plant of others without `push` has none, which is said."""
    assert SitlPlant.has_surface(water)
    assert not SitlPlant.has_surface(Sledge())
    parts = Scenario.preset("quick").parts()
    assert "can rise out of its water" in SitlPlant(parts=parts.replace(world=World())).ready(lambda *_: None)


@pytest.mark.slow
def test_a_push_moves_the_true_vehicle_and_the_surface_holds_it() -> None:
    """In the paper's water: 10 N more of weight sink it; all verticals up, it stays in the water for 20 s."""
    parts = Scenario.preset("quick", world="still-tank", vehicle="bluerov2-heavy", flow="paper").parts()
    plant, truth_provider = parts.world.begin()
    begun = truth_provider.observe().state.X_WB.p_m[2]
    plant.push(np.array([0.0, 0.0, 10.0, 0.0, 0.0, 0.0]))
    plant.step(np.zeros(8), 1.0)
    assert truth_provider.observe().state.X_WB.p_m[2] - begun > 0.05
    body = SitlPlant(parts=parts).begin()
    up = np.linalg.pinv(HEAVY.allocation_matrix) @ np.array([0.0, 0.0, -100.0, 0.0, 0.0, 0.0])
    depths = [float(body.step(up, 0.02).p_WB_m[2]) for _ in range(1000)]
    assert min(depths) > -0.3
    assert max(depths[-100:]) < 0.3


@pytest.mark.slow
def test_the_tank_behind_a_firmware_is_the_trials_own() -> None:
    """At rest the accelerometer feels g upwards; ahead is ahead; steps of 2.5 ms give what steps of 20 ms give."""
    parts = Scenario.preset("quick", world="still-tank", vehicle="bluerov2-heavy").parts()
    behind = SitlPlant(parts=parts)
    behind.ready(lambda *_: None)
    table = PulseTable.of(parts.vehicle)
    ahead = (1420, 1420, 1580, 1580, *(1500,) * 4, *(0,) * 8)
    found = []
    for rate_hz in (400, 50):
        physics = PhysicsServer(behind.begin, table.thrusts)
        frame = 1
        first = physics.answer(
            write_request(ServoFrame(rate_hz=rate_hz, frame=1, pulses_us=(1500,) * 16)), ("a", 1), 0.0
        )
        assert first is not None
        assert np.linalg.norm(read_reply(first).force_B_m_s2) == pytest.approx(GRAVITY_M_S2, rel=0.02)
        start = physics.motion
        for frame in range(2, rate_hz + 2):
            physics.answer(write_request(ServoFrame(rate_hz=rate_hz, frame=frame, pulses_us=ahead)), ("a", 1), 0.0)
        assert start is not None
        assert physics.motion is not None
        nose = Pose(np.zeros(3), start.q_WB).R[:, 0]
        assert nose @ (physics.motion.p_WB_m - start.p_WB_m) > 0.02
        found.append(physics.motion.p_WB_m - start.p_WB_m)
    assert found[0] == pytest.approx(found[1], abs=3e-3)
