"""What the flight's thread takes down: averages, energy, deviation, and the truth only while somebody looks."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, Goal, ScalarGrid, Truth, WaterTruth
from wakewise.operation.loop import Step
from wakewise.robot.vehicles import load_vehicle
from wakewise.ui.cockpit.flight_snapshot import SnapshotRecorder

DT_S = 0.02


@dataclass
class Water:
    """A truth provider whose water moves at 3 mm/s everywhere, and who counts how often it is asked."""

    asked: list[str] = field(default_factory=list)

    def observe(self) -> Truth:
        raise AssertionError("the loop asks for that")

    def water(self) -> WaterTruth:
        raise AssertionError("the recorder asks for that")

    def silt(self) -> ScalarGrid:
        self.asked.append("silt")
        return ScalarGrid(origin_W_m=np.zeros(3), spacing_m=1.0, values=np.zeros((1, 1, 1)))

    def excess_velocity(self, points_W_m: Array) -> Array:
        self.asked.append("water")
        return np.full((len(points_W_m), 3), 0.003) * [0.0, 1.0, 0.0]


def step(k: int, thrust_N: float = 1.0, speed_m_s: float = 0.1) -> Step:
    """One step of a flight that goes forward at a speed, with 50 W."""
    state = BodyState(X_WB=Pose(np.array([0.0, 0.0, 1.0])), nu_B=np.array([speed_m_s, 0, 0, 0, 0, 0]))
    return Step(
        time_s=k * DT_S,
        goal=Goal(X_WB=state.X_WB),
        estimate=state,
        command=Command(thrusts_N=np.full(8, thrust_N), wrench_B=np.zeros(6)),
        truth=Truth(state=state, thrusts_N=np.full(8, thrust_N), power_W=50.0, collision=False),
        solve_s=0.004,
    )


def snapshots(asked_m_s: float = 0.1) -> tuple[SnapshotRecorder, list[int]]:
    given: list[int] = []
    asked = np.array([asked_m_s, 0.0, 0.0])
    made = SnapshotRecorder(load_vehicle("paper"), np.zeros((4, 3)), DT_S, lambda: given.append(1), lambda: asked)
    return made, given


def test_pulses_are_averaged_and_energy_adds_up() -> None:
    """Thrusts over the last ten steps, power over all; each step tells that its thrusts are given."""
    look, given = snapshots()
    for k in range(100):
        look(step(k, thrust_N=float(k % 2)), None)
    assert look.now is not None
    np.testing.assert_allclose(look.now.thrusts_N, 0.5)
    assert look.now.energy_J == pytest.approx(100 * DT_S * 50.0)
    assert len(given) == 100
    assert look.solve_ms_p99 == pytest.approx(4.0)


def test_deviation_is_of_what_was_asked() -> None:
    """At the velocity asked for it is nothing, at twice that all of it; hands off there is nothing to deviate from."""
    for asked_m_s, pct in ((0.1, 0.0), (0.05, 100.0)):
        look, _ = snapshots(asked_m_s)
        for k in range(50):
            look(step(k), None)
        assert look.deviation_pct == pytest.approx(pct)
    look, _ = snapshots(0.0)
    assert look.deviation_pct is None
    look(step(0), None)
    assert look.deviation_pct is None


def test_the_truth_is_asked_only_while_somebody_looks() -> None:
    """Water twice, silt once a second of flight; nothing for nobody, and nothing twice in one step."""
    look, _ = snapshots()
    unseen, seen = Water(), Water()
    for k in range(100):
        look(step(k), unseen)
    assert unseen.asked == []
    look.look()
    for k in range(100, 201):
        look(step(k), seen)
    assert 4 <= seen.asked.count("water") <= 5
    assert 2 <= seen.asked.count("silt") <= 3
    assert look.now is not None
    assert look.now.true_m_s is not None
    np.testing.assert_allclose(look.now.true_m_s, 0.003)
