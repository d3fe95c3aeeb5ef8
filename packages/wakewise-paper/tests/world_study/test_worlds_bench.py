"""The bench of worlds: its statistics, what it plans, what it keeps, and one flight."""

import numpy as np
import pytest

from pools import MadeUp
from wakewise.core.errors import InputError, StageError
from wakewise.core.interfaces import no_progress
from wakewise.experiments.campaigns.flights import flight_parts, fly_stage, scenario_of
from wakewise.experiments.campaigns.statistics import mean_figures
from wakewise.experiments.trials import BenchOptions
from wakewise_paper.cli.bench_worlds import show_worlds
from wakewise_paper.world_study import bench
from wakewise_paper.world_study.flight import FLIGHT_FIGURES, MODEL_FIGURES, short_flight
from wakewise_paper.world_study.lattice_comparison import (
    CLEAR,
    CLEAR_M,
    clear_points,
    judge_table,
    judge_trials,
)

SPEED = "target_speed_mean_m_s"


def flight(name, settings):
    """Figures that depend on the trial alone; `dp` is lost with seed 2."""
    method, seed = settings["scenario"]["method"], settings["scenario"]["seed"]
    if (method, seed) == ("dp", 2):
        raise StageError("the vehicle was lost")
    share = {"dp": 1.0, "wake-aware": 0.25}.get(method, 0.8)
    row = dict.fromkeys(FLIGHT_FIGURES, share * seed) | {"sway_rms_mm": None, "cpu_s": 1.0}
    return row | {CLEAR: 2.0} if name.startswith("judge") else row


def made_scan(settings, folder, progress):
    """A model for all but `mpc-smooth`."""
    if settings["scenario"]["method"] == "mpc-smooth":
        raise StageError("too few photographs found their place")
    return dict.fromkeys(MODEL_FIGURES, 1.0)


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr("wakewise.experiments.campaigns.flights.model_stage", made_scan)
    return MadeUp(monkeypatch, bench, flight)


@pytest.fixture
def made_up(here, tmp_path):
    return tmp_path


def parts_of(*what, **more):
    """Parts of a short flight."""
    return flight_parts(short_flight(*what, **more).task.settings)[0]


def flown(trial, folder):
    """Figures of a flight."""
    return fly_stage(trial.task.settings, folder, no_progress)


def test_a_mean_has_an_interval_over_seeds_and_a_figure_that_none_has_is_null():
    """One seed has no interval; more have one that holds the mean."""
    rows = [{SPEED: 1.0, "x": None}, {SPEED: 3.0, "x": None}]
    told = mean_figures(rows, (SPEED, "x"))
    assert told[SPEED] == 2.0 and told[f"{SPEED}_interval"] == pytest.approx((2.0 - 12.7062, 2.0 + 12.7062), abs=1e-3)
    assert told["x"] is None and told["x_interval"] is None and told["flights"] == 2
    assert mean_figures(rows[:1], (SPEED,))[f"{SPEED}_interval"] is None


def test_ratios_are_of_pairs_and_tell_the_worst_seed():
    """Losses are printed beside gains."""
    base, other = {1: {SPEED: 1.0}, 2: {SPEED: 1.0}, 3: {SPEED: 5.0}}, {1: {SPEED: 0.1}, 2: {SPEED: 1.5}}
    told = bench.ratios(base, other)
    assert told["target_speed_less_pct"] == pytest.approx(20.0)
    assert told["target_speed_less_worst_pct"] == pytest.approx(-50.0)
    assert told["target_speed_less_best_pct"] == pytest.approx(90.0)
    assert told["energy_less_pct"] is None


def test_a_failed_flight_or_scan_is_a_failure_of_its_method_and_named(made_up, capsys):
    """It is neither left out of the success nor a mean of nothing; the run goes on."""
    options = BenchOptions(seeds=3, models=1, worlds=("payload",), store=made_up)
    found = bench.run(options)
    table = found["worlds"]["payload"]["methods"]
    assert found["failed"] == 2 and {f["reason"].split(":")[0] for f in found["failures"]} == {"StageError"}
    assert table["dp"]["flights"] == 2 and table["dp"]["success_pct"] == pytest.approx(50.0)
    assert table["mpc-smooth"]["success_pct"] == 0.0 and table["mpc-smooth"]["rmse_mm"] is None
    assert table["mpc-smooth"]["why"]["rmse_mm"] == "no model"
    assert table["wake-aware"]["against"]["dp"]["target_speed_less_pct"] == pytest.approx(75.0)
    assert table["wake-aware"]["sway_rms_mm"] is None and "rigid" in table["wake-aware"]["why"]["sway_rms_mm"]
    show_worlds(found)
    shown = capsys.readouterr().out
    assert "payload" in shown and "75 %" in shown and "the vehicle was lost" in shown


def test_a_run_that_was_stopped_goes_on(here, made_up):
    """What was flown is kept; what failed is flown again, and more seeds add to what is there."""
    options = BenchOptions(seeds=2, models=0, worlds=("payload",), methods=("dp", "wake-aware"), store=made_up)
    bench.run(options)
    here.flown.clear()
    bench.run(options)
    assert here.flown == ["flight/payload/dp/2"]


def test_the_second_judge_flies_the_same_hovers_in_both_waters(made_up, capsys):
    """Every judged world and method in tank and lattice; gains are within one water and null where a flight failed."""
    trials = judge_trials(2)
    assert {flow for flow, *_ in trials} == {"tank", "lattice"} and len(trials) == 2 * 3 * 3 * 2
    scenarios = [scenario_of(one.task.settings) for one in judge_trials(1, ("close",)).values()]
    assert {one.target.elasticity for one in scenarios} == {"none"} and {one.flow for one in scenarios} == {
        "tank",
        "lattice",
    }
    found = bench.run(BenchOptions(seeds=1, models=0, judge=1, worlds=("close",), methods=("dp",), store=made_up))
    table = found["judge"]["close"]
    assert table["wake-aware"]["tank_less_pct"] == pytest.approx(75.0) == table["wake-aware"]["lattice_less_pct"]
    assert table["dp"]["seeds"] == 1
    assert table["wake-aware"]["lattice_clear_m_s"] == 2.0 and table["wake-aware"]["lattice_clear_less_pct"] == 0.0
    show_worlds(found)
    assert "the second judge" in capsys.readouterr().out
    lost = judge_table({("tank", "close", "dp", 1): {SPEED: 1.0}})
    assert lost["close"]["dp"]["tank_m_s"] is None and lost["close"]["dp"]["tank_less_pct"] is None


@pytest.mark.slow
def test_a_judged_flight_is_the_flight_looked_at_off_its_target_as_well(tmp_path):
    """All figures are those of the same flight; 8 cm off the water is looked at once the vehicle has settled."""
    settings = judge_trials(2)["tank", "payload", "dp", 2].task.settings | {"duration_s": 10.0}
    judged, plain = (fly_stage(one, tmp_path, no_progress) for one in (settings, settings | {"probes": {}}))
    same = [key for key in FLIGHT_FIGURES if plain[key] is not None]
    assert [judged[key] for key in same] == [plain[key] for key in same]
    assert 0.001 < judged[CLEAR] < 0.5
    assert fly_stage(settings | {"duration_s": 2.0}, tmp_path, no_progress)[CLEAR] is None


@pytest.mark.slow
def test_clear_points_are_off_the_whole_target_and_off_the_bed():
    """No corner of the mesh is nearer than that, and no point as near to the bed as half of it; most are kept."""
    target = parts_of("payload", "dp", 1).target
    points = clear_points(target)
    gaps = np.linalg.norm(points[:, None] - target.mesh.vertices_m, axis=2).min(axis=1)
    assert 150 < len(points) <= 300 and gaps.min() > 0.999 * CLEAR_M
    assert np.all(points[:, 2] < target.bed_z_m - 0.5 * CLEAR_M)


def test_worlds_and_methods_that_are_not_known_are_refused():
    """In one line with those that are."""
    with pytest.raises(InputError, match="worlds: 'mars' is not known, allowed: "):
        bench.run(BenchOptions(worlds=("mars",)))
    with pytest.raises(InputError, match="methods: 'hope' is not known, allowed: dp"):
        bench.run(BenchOptions(worlds=("payload",), methods=("hope",)))


def test_a_flight_is_of_the_world_its_seed_draws_and_of_the_mission_s_orbits():
    """It begins on the middle orbit at the drawn standoff; another method meets the same world from the same side."""
    one, two = (parts_of("close", m, 2) for m in ("dp", "mpc"))
    assert one.scenario.tank == two.scenario.tank and one.scenario.mission == two.scenario.mission
    X_WC = one.route.body(0.0, one.vehicle.X_BC).X_WB @ one.vehicle.X_BC
    away = X_WC.p_m - one.target.centre_W_m
    assert np.linalg.norm(away) == pytest.approx(one.scenario.mission.standoff_m, abs=1e-6)
    X_WC_two = two.route.body(0.0, two.vehicle.X_BC).X_WB @ two.vehicle.X_BC
    assert X_WC_two.p_m == pytest.approx(X_WC.p_m)


def test_one_flight_gives_the_figures_of_the_table(tmp_path):
    """Those that are of the tank; silt and sway where the world has them."""
    row = flown(short_flight("payload", "dp", 1, duration_s=10.0), tmp_path)
    for key in ("target_speed_mean_m_s", "bed_shear_p95_Pa", "ray_optical_depth", "position_rmse_mm", "energy_kJ"):
        assert row[key] is not None and np.isfinite(row[key])
    assert set(FLIGHT_FIGURES) <= set(row)
