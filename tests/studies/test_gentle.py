"""The gentle bench: its statistics, its trials, what it keeps, and the paper's own world."""

import json

import numpy as np
import pytest

from wakewise.errors import InputError, StageError
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState
from wakewise.operation.instant_water import InstantWater, paper_jets
from wakewise.reports.levers import draw_levers
from wakewise.studies.flight_store import FlightStore, source_version, store_folder
from wakewise.studies.gentle import bench as gentle
from wakewise.studies.gentle.figures import change, flow_figures, reduction_pct
from wakewise.studies.gentle.flight import FIGURES, Trial, gentle_route, helped_by, scenario_of
from wakewise.studies.gentle.levers import GENTLE, PARTS, PLAIN, entries, method_trial, together
from wakewise.tank import TankSettings
from wakewise.targets import coral, place_on_bed
from wakewise.trials import BenchOptions
from wakewise.vehicles import load_vehicle
from wakewise.wake import wake_model

VEHICLE = load_vehicle("paper")
SPEED = "target_speed_mean_m_s"
ROW = dict.fromkeys(FIGURES, 1.0)


def rows(values):
    return {k: {SPEED: v} for k, v in enumerate(values)}


def made_up(trial):
    """Figures that depend on the trial alone."""
    return ROW | {SPEED: 1e-3 * trial.seed * (1.0 + len(trial.method) + len(trial.control))}


def test_a_reduction_is_that_of_the_means_and_its_interval_holds_it():
    """Half the speed is 50 %; an interval of equal halves has no width; one of mixed seeds contains the value."""
    base = rows([1.0, 2.0, 3.0, 2.0])
    value, interval = reduction_pct(base, rows([0.5, 1.0, 1.5, 1.0]), SPEED)
    assert value == pytest.approx(50.0) and interval == pytest.approx((50.0, 50.0))
    value, interval = reduction_pct(base, rows([1.2, 0.4, 1.0, 2.5]), SPEED)
    assert interval[0] < value < interval[1]
    value, interval = reduction_pct(rows([0.0, 2.0]), rows([0.0, 1.0]), SPEED)  # a seed without any has no share
    assert value == pytest.approx(50.0) and np.isfinite(interval).all()
    assert change(base, rows([2.0, 3.0, 4.0, 3.0]), SPEED) == (pytest.approx(1.0), pytest.approx((1.0, 1.0)))


def test_only_seeds_that_both_flew_are_compared():
    """A lever with fewer seeds is held against the same seeds of its base; one pair has no interval."""
    base = rows([1.0, 100.0])
    value, interval = reduction_pct(base, {0: {SPEED: 0.2}}, SPEED)
    assert value == pytest.approx(80.0) and interval is None
    assert reduction_pct(base, {7: base[0]}, SPEED) == (None, None)


@pytest.mark.parametrize("world", ["parcels", "paper"])
def test_every_lever_is_a_valid_scenario(world):
    """Each lever's settings are accepted and differ from what it is held against."""
    table = entries(world)
    for name, entry in table.items():
        trial = entry.trial(world, 1)
        assert scenario_of(trial).method == trial.method
        base = table.get(entry.base)
        against = base.trial(world, 1) if base else method_trial(world, entry.base, 1)
        assert trial != against, name


def test_each_lever_is_flown_alone_and_each_of_the_set_is_left_out_once():
    """The table holds every lever alone, all of the set together (the method itself), and the set less each one."""
    table = entries("parcels")
    assert set(PARTS) <= set(table) and all(table[name].group == "alone" for name in PARTS)
    assert dict(method_trial("parcels", "wake-aware", 3).control) == together(GENTLE)
    for name in GENTLE:
        left = dict(table[f"without {name}"].control)
        assert left == together(tuple(other for other in GENTLE if other != name)) != together(GENTLE)
    assert all(dict(method_trial("paper", m, 1).control) == {} for m in gentle.METHODS)


def test_seeds_are_pairs():
    """Methods and levers of one seed share vehicle, trim, sensors and mission: their trials differ in control alone."""
    trials = gentle.planned_trials(gentle.METHODS, {"parcels": entries("parcels")}, 2)
    for key, trial in trials.items():
        assert trial.seed == key[2]
        plain = scenario_of(Trial(world="parcels", method="dp", seed=key[2]))
        assert scenario_of(trial).model_copy(update={"control": plain.control, "method": "dp"}) == plain


def test_the_answer_has_the_keys_that_were_promised(tmp_path):
    """Methods, reductions and levers of both flows, and a picture of them, from made-up flights."""
    flights = {m: dict.fromkeys((1, 2), ROW) for m in gentle.METHODS}
    flights |= {PLAIN: {1: ROW, 2: ROW}, "wide cone": {1: ROW | {SPEED: 0.5}}}
    flows = {w: flow_figures(w, flights, gentle.METHODS, entries("parcels")) for w in ("parcels", "paper")}
    found = flows["parcels"]
    assert found["circular"] is False and flows["paper"]["circular"] is True
    assert set(found["methods"]) == set(gentle.METHODS) and found["reduction_vs_unaware_pct"] == pytest.approx(0.0)
    assert found["reduction_vs_dp_pct"] == pytest.approx(0.0) and found["position_change_vs_dp_mm"] == 0.0
    assert found["levers"] == {PLAIN: pytest.approx(0.0), "wide cone": pytest.approx(50.0)}
    assert found["lever_details"]["wide cone"]["flights"] == 1
    for key in ("target_speed_mean_m_s", "exposure_speed_mean_m_s", "disturbance", "position_rmse_mm", "energy_kJ"):
        assert found["methods"]["dp"][key] == 1.0
    draw_levers({"flows": flows}, tmp_path / "levers.png")
    assert (tmp_path / "levers.png").stat().st_size > 10_000
    with pytest.raises(InputError, match="ending"):
        draw_levers({"flows": flows}, tmp_path / "levers.doc")


def test_flights_are_kept_by_what_was_flown(tmp_path):
    """The same trial is found again, another is not, and `fresh` finds none; nonsense on disk counts as not flown."""
    store, trial = FlightStore(tmp_path), Trial(world="paper", method="dp", seed=1)
    assert store.load(trial) is None
    store.save(trial, ROW)
    assert store.load(trial) == ROW and len(source_version()) == 64
    assert store.load(Trial(world="paper", method="dp", seed=2)) is None
    assert store.load(Trial(world="paper", method="dp", seed=1, float_N=0.5)) is None
    assert FlightStore(tmp_path, fresh=True).load(trial) is None
    store.path(trial).write_text("[1, 2")
    assert store.load(trial) is None


def test_the_cache_folder_follows_the_environment(monkeypatch, tmp_path):
    """XDG_CACHE_HOME is where users say that caches go."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert store_folder().is_relative_to(tmp_path)


class Here:
    """A pool of this process: as executors go, and no other process."""

    def submit(self, work, trial):
        from concurrent.futures import Future

        future = Future()
        try:
            future.set_result(work(trial))
        except StageError as error:
            future.set_exception(error)
        return future

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


def test_a_bench_that_was_stopped_goes_on_and_failures_are_named(monkeypatch, tmp_path):
    """A second run flies what the first could not; a failed flight is counted with its reason and not kept."""
    flown = []

    def flight(trial):
        flown.append(trial)
        if trial.method == "dp" and trial.seed == 2 and len(flown) < 10:
            raise StageError("the vehicle was lost")
        return made_up(trial)

    monkeypatch.setattr(gentle, "_pool", lambda _: Here())
    monkeypatch.setattr(gentle, "fly_trial", flight)
    said = []
    options = BenchOptions(
        seeds=3,
        methods=("dp", "wake-aware"),
        flows=("parcels",),
        levers=("wide cone",),
        store=tmp_path,
        progress=lambda done, total, note="": said.append((done, total, note)),
    )
    first = gentle.run(options)
    assert first["flights"] == 12 and first["failed"] == 1 and first["flown"] == 11
    assert first["failures"] == [
        {"flow": "parcels", "name": "dp", "seed": 2, "reason": "StageError: the vehicle was lost"}
    ]
    assert said[-1][:2] == (12, 12) and "min left" in said[-1][2]
    again = gentle.run(options)
    assert again["flown"] == 1 and again["failed"] == 0 and len(flown) == 13
    assert again["flows"]["parcels"]["methods"]["dp"]["flights"] == 3
    assert again["why"]["smooth"] == "this method was left out" and "paper" in again["why"]
    assert json.dumps(again, allow_nan=False)


def test_wishes_are_checked():
    """Names that do not exist and numbers out of range are refused with what is allowed."""
    with pytest.raises(InputError, match="allowed: dp"):
        gentle.run(BenchOptions(methods=("magic",)))
    with pytest.raises(InputError, match="allowed: none"):
        gentle.run(BenchOptions(levers=("magic",)))
    with pytest.raises(InputError, match="seeds: 0"):
        BenchOptions(seeds=0)


def test_the_route_hovers_then_orbits_and_stays_at_its_standoff():
    """Camera at the standoff all along, at rest while it hovers, photographs on both legs, the arc either way."""
    route = gentle_route(np.array([0.0, 0.0, 1.43]), 0.5, 0.3)
    for time_s in np.linspace(0.0, route.duration_s, 40):
        X_WC, _, _ = route.camera(float(time_s))
        assert np.linalg.norm(X_WC.p_m - route.centre_W_m) == pytest.approx(0.5)
    assert np.linalg.norm(route.body(12.0, VEHICLE.X_BC).nu_B) == 0.0
    assert {route.leg_name(float(t)) for t in route.exposures_s} == {"hover", "orbit"}
    back = gentle_route(np.array([0.0, 0.0, 1.43]), 0.5, 0.3, -1.0)
    middle = route.starts_s[2] + 5.0
    assert route.body(middle, VEHICLE.X_BC).nu_B[1] == pytest.approx(-back.body(middle, VEHICLE.X_BC).nu_B[1])


def test_the_current_helps_where_it_runs_along_the_arc():
    """At azimuth 0 (north of the target) larger azimuths lie to the east."""
    assert helped_by((0.0, 0.03, 0.0), 0.0) == 1.0 and helped_by((0.0, -0.03, 0.0), 0.0) == -1.0
    assert helped_by((0.03, 0.0, 0.0), 0.5 * np.pi) == -1.0


def test_the_papers_world_is_the_papers_model():
    """One thruster at full lag: the water is sqrt(T) times the model's unit velocity; none, and it is still."""
    target = place_on_bed("branching", coral("branching", 0), 1.5)
    settings = TankSettings(current={"velocity_m_s": (0.0, 0.0, 0.0)})
    start = BodyState(X_WB=Pose(np.array([0.0, 0.0, 0.9])))
    world = InstantWater(paper_jets(), VEHICLE, target, settings, start, np.random.default_rng(0))
    points = np.array([[0.09, 0.14, 1.2], [0.0, 0.0, 1.4]])
    assert np.all(world.speeds_m_s(points) == 0.0)
    thrusts = np.zeros(8)
    thrusts[4] = -2.0
    for _ in range(30):
        measured = world.step(thrusts, 0.02)
    assert measured is not None
    truth = world.observe()
    origin = truth.state.X_WB.apply(VEHICLE.thruster_positions_B_m)[4:5]
    jet = truth.state.X_WB.R @ VEHICLE.thruster_axes_B[4]
    unit = wake_model("paper-calibrated").unit_velocity(points, origin, jet[None], VEHICLE.disk_areas_m2[4:5])[0]
    expected = np.sqrt(-truth.thrusts_N[4]) * np.linalg.norm(unit, axis=1)
    np.testing.assert_allclose(world.speeds_m_s(points), expected, rtol=1e-9)
    assert expected[0] > 0.05
