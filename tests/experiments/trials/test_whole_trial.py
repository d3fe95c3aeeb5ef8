"""One small trial from flight to report: whole, resumable, reproducible, and its water is not its controller's."""

import json
import os
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from wakewise.control import vehicle_layout
from wakewise.core.errors import InputError
from wakewise.core.run_lock import exclusive_run
from wakewise.experiments.trials import run_trial
from wakewise.operation import Parts, Scenario, fly, load_scenario
from wakewise.operation.worlds.makers import tank_world, true_start, true_vehicle
from wakewise.operation.worlds.quasi_steady_world import QuasiSteadyWater, jets_of
from wakewise.ui.reports import write_report
from wakewise.wake import point_disturbance

SMALL = {
    "world": "tank",
    "name": "small",
    "mission.elevations_deg": [30, 50],
    "mission.views": [10, 8],
    "mission.standoff_m": 0.4,
    "mission.speed_m_s": 0.3,
    "mission.acceleration_m_s2": 0.2,
    "mission.settle_s": 1.0,
    "imaging.width": 480,
    "imaging.height": 360,
    "target.kind": "brain",
    "tank.silt.load_kg_m2": 0.02,
    "reconstruction.mesh_depth": 7,
}


def small(**changes: object) -> Scenario:
    return load_scenario("quick", None, SMALL | changes)


class Stages:
    """A watch that remembers what ran and what was skipped."""

    def __init__(self) -> None:
        self.ran: list[str] = []
        self.skips: list[str] = []

    def stage(self, name: str):
        self.ran.append(name)
        from contextlib import nullcontext

        return nullcontext(lambda *_: None)

    def skipped(self, name: str) -> None:
        self.skips.append(name)


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("trials") / "first"
    told: list[dict] = []

    def tell(figures: dict) -> None:
        assert not (folder / "mesh.ply").exists()
        assert json.loads((folder / "metrics.json").read_text()) == figures
        told.append(figures)

    result = run_trial(small(), folder, told=tell)
    assert told == [result]
    return folder, result


def test_a_folder_that_another_run_is_at_is_let_be(trial: tuple[Path, dict]) -> None:
    """A second run into the same folder is refused at once, with the other's number."""
    folder, _ = trial
    refused = pytest.raises(InputError, match=rf"another run is at it \(pid {os.getpid()}\)")
    with ThreadPoolExecutor(1) as other, exclusive_run(folder), refused:
        other.submit(run_trial, small(), folder).result()


def test_a_trial_leaves_every_file_whole(trial: tuple[Path, dict]) -> None:
    """All files of a trial are there, none temporary, and the figures are those of metrics.json."""
    folder, figures = trial
    for name in ("scenario.yaml", "steps.parquet", "timings.parquet", "exposures.npz", "log.mcap", "planned.csv"):
        assert (folder / name).stat().st_size > 0
    assert len(list((folder / "images").iterdir())) == 18
    assert (folder / "dense.ply").exists()
    assert (folder / "mesh.glb").read_bytes()[:4] == b"glTF"
    assert not list(folder.rglob(".*"))
    assert json.loads((folder / "metrics.json").read_text()) == figures


def test_the_small_scan_makes_a_model(trial: tuple[Path, dict]) -> None:
    """Most photographs find their place and the model is near the truth, even at a quarter of the usual pixels."""
    _, figures = trial
    assert figures["registered_images"] >= 16
    assert figures["mapping"] == "from known poses"
    assert figures["rmse_mm"] < 4.0
    assert figures["completeness_pct"] > 70.0
    assert figures["collisions"] == 0
    assert figures["target_speed_mean_m_s"] > 0.0
    assert figures["from_outside"] == {}
    assert set(figures["why"].values()) == {"the target is rigid and held"}


GOLDEN = json.loads(Path(__file__).with_name("golden.json").read_text())
"""A flight of 4 s by `dp` and a small scan, as they were before parts and packages were moved."""


def test_the_flight_is_the_one_that_was_flown_before() -> None:
    """Poses and commands of `dp` every 0.4 s; another processor may round otherwise, so not to the byte.

    With ideal thrusters: a pulse is sent or not, and rounding may shift one by a step.
    """
    scenario = small(method="dp", **{"tank.silt.load_kg_m2": 0.02, "tank.ideal_thrusters": True})
    flown = fly(scenario, duration_s=4.0).steps.gather_every(20).select(GOLDEN["columns"])
    np.testing.assert_allclose(flown.to_numpy(), np.array(GOLDEN["rows"]), rtol=1e-6, atol=1e-7)


def test_the_small_scan_is_as_good_as_it_was(trial: tuple[Path, dict]) -> None:
    """The same photographs are placed, and the model is as near to the truth.

    Rounding, which is the processor's own, shifts pulses of thrusters and so the flight. Mean and standard deviation
    are of nine flights whose sensor noise differed by 1e-9 to 5e-3 of itself.
    """
    _, figures = trial
    before = GOLDEN["scan"]
    assert figures["registered_images"] == before["registered_images"] == before["images"]
    assert figures["rmse_mm"] == pytest.approx(before["rmse_mm"], abs=4.0 * before["rmse_std_mm"])
    assert figures["completeness_pct"] == pytest.approx(before["completeness_pct"], abs=0.3)
    assert figures["duration_s"] == pytest.approx(before["duration_s"])


def test_running_again_does_nothing_and_running_after_a_loss_does_only_what_is_missing(
    trial: tuple[Path, dict], tmp_path: Path
) -> None:
    """A finished trial is skipped stage by stage; a lost photograph is rendered again, the same to the byte."""
    folder, figures = trial
    again = Stages()
    assert run_trial(small(), folder, again) == figures
    assert again.ran == []
    assert again.skips == ["plan", "fly", "photograph", "reconstruct", "evaluate", "mesh", "colours"]
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    lost = copy / "images" / "007.png"
    before = lost.read_bytes()
    lost.unlink()
    for name in ("images.csv", "model.json", "score.json"):
        (copy / name).unlink()
    resumed = Stages()
    run_trial(small(), copy, resumed)
    # A mesh that comes out the same keeps its colours.
    assert [name for name in resumed.ran if name != "colours"] == ["photograph", "reconstruct", "evaluate"]
    assert lost.read_bytes() == before
    assert (copy / "images.csv").read_bytes() == (folder / "images.csv").read_bytes()


def test_the_same_seed_flies_the_same_flight_and_another_does_not() -> None:
    """Every column is the same to the last bit for the same seed; another seed meets another trim and other noise."""
    one, again, other = (fly(small(seed=seed, **{"target.points": 60}), duration_s=2.0).steps for seed in (1, 1, 2))
    assert one.equals(again)
    assert not one.equals(other)


@pytest.mark.slow
def test_the_report_of_a_real_trial_is_one_file_without_addresses(trial: tuple[Path, dict]) -> None:
    """report.html names the verdict and the figures, and asks no host for anything."""
    folder, figures = trial
    page = write_report(folder).read_text(encoding="utf-8")
    assert ("Success" in page) or ("Fail" in page)
    for key in figures["units"]:
        assert key in page
    assert 'src="http' not in page


@dataclass(frozen=True)
class Likeness:
    """How a world's water differs from what the controller believes of it, whatever the strength of either.

    `shape` is the share of the mean square speed about the running jets that the belief, scaled at best, leaves; 0 if
    one is a multiple of the other. `memory` is the share of the speed that is left 2 s after the thrusters stopped,
    when the belief has none.
    """

    shape: float
    memory: float

    @property
    def own(self) -> bool:
        """Whether the water follows a law of its own."""
        return self.shape > 0.1 and self.memory > 0.05


def likeness(parts: Parts, water: Any, speeds_m_s: Callable[[Any], Any]) -> Likeness:
    """Blow thrusts of no wrench for 4 s, look round each jet to half a metre and 15 cm aside, stop, look again."""
    vehicle = parts.vehicle
    basis = vehicle_layout(vehicle).null
    null = basis @ basis[0]  # the first thruster's share of what makes no wrench, whatever the basis
    thrusts = 0.6 * null / np.abs(null).max()
    for _ in range(200):
        water.step(thrusts, 0.02)
    origins, axes = (
        water.state.X_WB.apply(vehicle.thruster_positions_B_m),
        vehicle.thruster_axes_B @ water.state.X_WB.R.T,
    )
    places = []
    for origin, jet in zip(origins, -np.sign(thrusts)[:, None] * axes, strict=True):
        aside = np.cross(jet, [0.3, 0.5, 0.8])
        aside /= np.linalg.norm(aside)
        ring = (aside, np.cross(jet, aside), -aside, -np.cross(jet, aside))
        for along in (0.15, 0.25, 0.35, 0.45):
            places += [origin + along * jet + r * n for r in (0.0, 0.03, 0.06, 0.1, 0.15) for n in ring]
    points = np.array(places)
    depth = parts.scenario.tank.size_m[2]
    points = points[(points[:, 2] > 0.02) & (points[:, 2] < depth - 0.02)]
    jet, areas = parts.wake, vehicle.disk_areas_m2
    believed = np.sqrt([point_disturbance(jet, p[None], np.ones(1), origins, axes, areas, thrusts) for p in points])
    real = speeds_m_s(points)
    for _ in range(100):
        water.step(np.zeros(len(thrusts)), 0.02)
    left = speeds_m_s(points)
    shape = 1.0 - (real @ believed) ** 2 / ((real @ real) * (believed @ believed))
    return Likeness(shape=float(shape), memory=float(np.linalg.norm(left) / np.linalg.norm(real)))


def test_the_controllers_water_is_not_the_tanks() -> None:
    """The water of the tank, without turbulence and scaled at will, is not what the controller's wake model says."""
    parts = small(**{"tank.jets.turbulence": 0.0}).parts()
    tank = tank_world(parts).tank()
    found = likeness(parts, tank, lambda points: np.linalg.norm(tank.excess_velocity(points), axis=1))
    assert found.own, found
    vehicle = parts.vehicle
    assert tank.vehicle.mass_kg != vehicle.mass_kg
    assert not np.allclose(tank.vehicle.thrust_gains, vehicle.thrust_gains)


@pytest.mark.parametrize(("gain", "turbulence"), [(1.0, 0.0), (1.3, 0.25)])
def test_water_that_is_the_controllers_own_belief_is_found_out(gain: float, turbulence: float) -> None:
    """A world that blows as the controller's wake model says fails the same test, stronger and noisier as it may be."""
    parts = small().parts()
    exact, noise = jets_of(parts.wake), np.random.default_rng(5)

    def jets(*of: Any) -> Any:
        velocity = exact(*of)
        return gain * velocity * (1.0 + turbulence * noise.normal(size=(len(velocity), 1)))

    settings = parts.scenario.tank
    rng = np.random.default_rng(1)
    water = QuasiSteadyWater(jets, true_vehicle(parts), parts.target, settings, true_start(parts), rng)
    found = likeness(parts, water, water.speeds_m_s)
    assert not found.own
    assert found.shape < 0.1 and found.memory < 1e-3, found


def test_the_table_of_a_flight_makes_sense(trial: tuple[Path, dict]) -> None:
    """The vehicle was where the table says: estimates near truth, thrusts within limits, exposures as planned."""
    folder, _ = trial
    steps = pl.read_parquet(folder / "steps.parquet")
    late = steps.filter(pl.col("time_s") > 1.0)
    error = (
        late.select("est_x_m", "est_y_m", "est_z_m").to_numpy()
        - late.select("true_x_m", "true_y_m", "true_z_m").to_numpy()
    )
    # Sensors whose errors last put the estimate some 5 mm off; a filter that lost its way is off by centimetres.
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.012
    thrusts = steps.select([f"thrust_{i + 1}_N" for i in range(8)]).to_numpy()
    assert np.abs(thrusts).max() <= 51.0 * 1.1
    assert steps["exposing"].sum() == 18
