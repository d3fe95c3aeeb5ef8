"""The loop and its recorder, on a plant simple enough to know by heart."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from wakewise.core.errors import StageError
from wakewise.core.geometry import Pose, quat_from_matrix
from wakewise.core.interfaces import BodyState, Command, Goal, Measurement, ScalarGrid, Truth, WaterTruth
from wakewise.operation import FlightRecorder, read_exposures, step_columns
from wakewise.operation.flight_log import TAGS, FlightLog
from wakewise.operation.loop import run_loop
from wakewise.scene.missions import MissionSettings, RoutePilot, plan_route
from wakewise.scene.missions.orbit import R_FC

ROUTE = plan_route(
    np.array([0.0, 0.0, 1.4]), MissionSettings(elevations_deg=(30,), views=(4,), speed_m_s=0.5, settle_s=1)
)
X_BC = Pose(np.array([0.2, 0.0, 0.0]), quat_from_matrix(R_FC))
DT_S = 0.02


@dataclass
class Perfect:
    """Plant, estimator, controller and truth provider in one: it is always exactly where the goal was."""

    commands: list[np.ndarray] = field(default_factory=list)
    state: BodyState = field(default_factory=lambda: ROUTE.body(0.0, X_BC))
    name: str = "perfect"

    def init(self, start: BodyState | None = None) -> int:
        return 0

    def step(self, *arguments: Any) -> Any:
        if len(arguments) == 2:
            self.commands.append(np.asarray(arguments[0]))
            return (Measurement(time_s=0.0),)
        if isinstance(arguments[-1], Goal):
            self.state = BodyState(X_WB=arguments[-1].X_WB, nu_B=arguments[-1].nu_B)
            count = int(arguments[0]) + 1
            return count, Command(thrusts_N=np.full(2, float(count)), wrench_B=np.zeros(6))
        return 0, self.state

    def observe(self) -> Truth:
        return Truth(state=self.state, thrusts_N=np.zeros(2), power_W=1.0, collision=False)

    def water(self) -> WaterTruth:
        return WaterTruth(
            target_speed_mean_m_s=0.1, target_speed_p95_m_s=0.2, bed_speed_p95_m_s=0.3, turbidity_per_m=0.4
        )

    def silt(self) -> ScalarGrid:
        return ScalarGrid(origin_W_m=np.zeros(3), spacing_m=0.1, values=np.ones((2, 3, 4)))


def flown(known: bool = True, plant: Perfect | None = None) -> tuple[FlightRecorder, Perfect]:
    everything = plant or Perfect()
    truth_provider = everything if known else None
    recorder = FlightRecorder(
        route=ROUTE, X_BC=X_BC, exposure_s=0.01, instants=3, thrusters=2, dt_s=DT_S, truth_provider=truth_provider
    )
    run_loop(
        pilot=RoutePilot(route=ROUTE, aim=X_BC),
        controller=everything,
        estimator=everything,
        plant=everything,
        truth_provider=truth_provider,
        start=everything.state,
        thrusters=2,
        duration_s=ROUTE.duration_s,
        dt_s=DT_S,
        record=recorder,
    )
    return recorder, everything


def test_every_step_is_recorded_once_and_in_order() -> None:
    """One row per control step, time in equal steps, columns as documented, each command flown once."""
    recorder, plant = flown()
    frame = recorder.frame()
    assert len(frame) == round(ROUTE.duration_s / DT_S) == len(plant.commands)
    np.testing.assert_allclose(np.diff(frame["time_s"].to_numpy()), DT_S, atol=1e-12)
    assert frame.columns[: len(step_columns(2))] == step_columns(2)
    assert frame["command_1_N"].to_list() == [command[0] for command in plant.commands]


def test_a_goal_that_the_controller_changed_is_recorded_and_aims_the_camera() -> None:
    """Of `Command.goal` come the columns of the goal and the joint's angle; without it, the pilot's own."""

    @dataclass
    class Leans(Perfect):
        aimed: list[float] = field(default_factory=list)

        def aim(self, tilt_rad: float) -> None:
            self.aimed.append(tilt_rad)

        def step(self, *arguments: Any) -> Any:
            answer = super().step(*arguments)
            if isinstance(arguments[-1], Goal) and int(arguments[0]) % 2:
                count, command = answer
                goal = replace(arguments[-1], tilt_rad=0.25, X_WB=Pose(np.full(3, 7.0)))
                return count, replace(command, goal=goal)
            return answer

    recorder, plant = flown(plant=Leans())
    tilt, place = recorder.frame()["goal_tilt_deg"].to_numpy(), recorder.frame()["goal_x_m"].to_numpy()
    assert isinstance(plant, Leans) and plant.aimed[:4] == [0.0, 0.25, 0.0, 0.25]
    np.testing.assert_allclose(np.radians(tilt), plant.aimed)
    assert np.all((place == 7.0) == (tilt != 0.0)) and 0.45 < np.mean(place == 7.0) < 0.55


def test_each_exposure_is_recorded_at_its_place() -> None:
    """A vehicle that is where it should be photographs from where it was planned, and moves while it does."""
    recorder, _ = flown()
    assert len(recorder.exposures) == 4
    assert int(recorder.frame()["exposing"].sum()) == 4
    for exposure, planned, opens_s in zip(recorder.exposures, ROUTE.X_WC_planned, ROUTE.exposures_s, strict=True):
        assert exposure.time_s == pytest.approx(opens_s)
        np.testing.assert_allclose(exposure.X_WC_true[0].p_m, planned.p_m, atol=2e-3)
        assert len(exposure.X_WC_true) == 3
    middle = recorder.exposures[1]
    moved = np.linalg.norm(middle.X_WC_true[-1].p_m - middle.X_WC_true[0].p_m)
    speed = np.linalg.norm(ROUTE.camera(middle.time_s)[1])
    assert moved == pytest.approx(speed * 0.01, rel=0.1)
    # This plant jumps to its goal at once, so its estimate, taken before, is one step behind.
    behind = np.linalg.norm(middle.X_WC_est.p_m - middle.X_WC_true[1].p_m)
    assert behind == pytest.approx(speed * DT_S, rel=0.1)


def test_a_flight_survives_its_files(tmp_path: Path) -> None:
    """What is read back is what was recorded, and the bytes of steps.parquet do not depend on the clock."""
    first, _ = flown()
    second, _ = flown()
    first.write(tmp_path / "a")
    second.write(tmp_path / "b")
    assert (tmp_path / "a/steps.parquet").read_bytes() == (tmp_path / "b/steps.parquet").read_bytes()
    assert pl.read_parquet(tmp_path / "a/steps.parquet").equals(first.frame())
    for written, read in zip(first.exposures, read_exposures(tmp_path / "a/exposures.npz"), strict=True):
        assert read.time_s == written.time_s
        np.testing.assert_array_equal(read.X_WC_true[2].p_m, written.X_WC_true[2].p_m)
        np.testing.assert_array_equal(read.silt.values, written.silt.values)


def test_at_sea_nobody_knows_the_truth() -> None:
    """Without a truth provider the flight is recorded, true columns hold NaN, and no exposure is invented."""
    recorder, _ = flown(known=False)
    frame = recorder.frame()
    assert frame["true_x_m"].is_nan().all()
    assert frame["target_speed_mean_m_s"].is_nan().all()
    assert not frame["est_x_m"].is_nan().any()
    assert recorder.exposures == []
    assert int(frame["exposing"].sum()) == 4


class NeverRead(list[Any]):
    """A list that may grow and must not be gone through."""

    def __iter__(self) -> Iterator[Any]:
        raise AssertionError("the whole record was read at one step")


@dataclass
class Spy:
    """An estimator that keeps what it is told, beside one that answers."""

    answers: Perfect
    told: list[np.ndarray] = field(default_factory=list)

    def init(self, start: BodyState) -> int:
        return 0

    def step(self, state: int, dt_s: float, measurements: object, thrusts_N: np.ndarray) -> tuple[int, BodyState]:
        self.told.append(np.array(thrusts_N))
        return state, self.answers.state


def test_the_estimator_is_told_what_was_flown() -> None:
    """Over fifty steps the thrusts that it hears are the commands that the plant got, in order, none of them zero."""
    everything = Perfect()
    spy = Spy(everything)
    recorder = FlightRecorder(
        route=ROUTE,
        X_BC=X_BC,
        exposure_s=0.01,
        instants=3,
        thrusters=2,
        dt_s=DT_S,
        truth_provider=None,
        log=FlightLog(tags={name: NeverRead() for name in TAGS}),
    )
    run_loop(
        pilot=RoutePilot(route=ROUTE, aim=X_BC),
        controller=everything,
        estimator=spy,
        plant=everything,
        truth_provider=None,
        start=everything.state,
        thrusters=2,
        duration_s=50 * DT_S,
        dt_s=DT_S,
        record=recorder,
    )
    assert len(spy.told) == len(everything.commands) == 50
    np.testing.assert_array_equal(spy.told, everything.commands)
    np.testing.assert_array_equal(spy.told, [np.full(2, k + 1.0) for k in range(50)])


class Diverging(Perfect):
    """A plant that is fast, or without end, from a time on; or whose estimate or controller is."""

    def __init__(self, part: str, value: float) -> None:
        super().__init__()
        self.part, self.value, self.steps = part, value, 0

    def step(self, *arguments: Any) -> Any:
        self.steps += 1
        late = self.steps > 30
        made = super().step(*arguments)
        if late and self.part == "plant" and len(arguments) == 2:
            Pose(np.full(3, self.value))
            self.state = BodyState(X_WB=self.state.X_WB, nu_B=np.full(6, self.value))
        if late and self.part == "controller" and isinstance(arguments[-1], Goal):
            return made[0], Command(thrusts_N=np.full(2, self.value), wrench_B=np.zeros(6))
        if late and self.part == "estimator" and len(arguments) == 4 and not isinstance(arguments[-1], Goal):
            return 0, BodyState(X_WB=self.state.X_WB, nu_B=np.full(6, self.value))
        return made


@pytest.mark.parametrize(
    ("part", "value", "words"),
    [
        ("plant", np.nan, "in the vehicle's motion: p_m: holds NaN"),
        ("plant", np.inf, "in the vehicle's motion"),
        ("plant", 1e6, r"in the (vehicle's motion|estimator): the vehicle moves or turns at 1e\+06"),
        ("estimator", 1e6, r"in the estimator: the vehicle moves or turns at 1e\+06"),
        ("estimator", np.nan, "in the estimator: nu_B: holds NaN"),
        ("controller", np.nan, "in the controller: thrusts_N: holds NaN"),
    ],
)
def test_a_simulation_that_diverges_says_when_and_in_which_part(part: str, value: float, words: str) -> None:
    """It is no fault of the input, so it is a StageError."""
    with pytest.raises(StageError, match=rf"the simulation diverged at t = 0\.\d\d s {words}"):
        flown(plant=Diverging(part, value))
