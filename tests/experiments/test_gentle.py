"""The gentle bench: its statistics, its trials, and the paper's own world."""

import numpy as np
import pytest

from wakewise.errors import InputError
from wakewise.experiments.benches import gentle
from wakewise.experiments.benches.gentle_trial import FIGURES, Trial, gentle_route, scenario_of
from wakewise.experiments.benches.paper_world import PaperWorld
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState
from wakewise.tank import TankSettings
from wakewise.targets import coral, place_on_bed
from wakewise.vehicles import load_vehicle
from wakewise.wake import wake_model

VEHICLE = load_vehicle("paper")


def rows(values):
    return {k: {"target_speed_mean_m_s": v} for k, v in enumerate(values)}


def test_a_reduction_is_that_of_the_means_and_its_interval_holds_it():
    """Half the speed is 50 %; an interval of equal halves has no width; one of mixed seeds contains the value."""
    base = rows([1.0, 2.0, 3.0, 2.0])
    value, interval = gentle.reduction_pct(base, rows([0.5, 1.0, 1.5, 1.0]), "target_speed_mean_m_s")
    assert value == pytest.approx(50.0) and interval == pytest.approx((50.0, 50.0))
    value, interval = gentle.reduction_pct(base, rows([1.2, 0.4, 1.0, 2.5]), "target_speed_mean_m_s")
    assert interval[0] < value < interval[1]


def test_only_seeds_that_both_flew_are_compared():
    """A lever with fewer seeds is held against the same seeds of its base; no common seed gives no figure."""
    base = rows([1.0, 100.0])
    value, _ = gentle.reduction_pct(base, {0: {"target_speed_mean_m_s": 0.2}}, "target_speed_mean_m_s")
    assert value == pytest.approx(80.0)
    assert gentle.reduction_pct(base, {7: base[0]}, "target_speed_mean_m_s") == (None, None)


def test_every_lever_is_a_valid_scenario():
    """Each lever's settings are accepted and differ from the plain trial in something."""
    plain = Trial(world="parcels", method="wake-aware", seed=1)
    for name in gentle.LEVERS:
        trial = gentle.lever_trial("parcels", name, 1)
        assert scenario_of(trial).method == trial.method
        assert trial != plain, name


def test_the_answer_has_the_keys_that_were_promised():
    """Methods, reductions and levers of both flows, from made-up flights."""
    row = dict.fromkeys((*FIGURES, "hover_speed_mean_m_s", "orbit_speed_mean_m_s"), 1.0)
    flown = {(w, m, s): row for w in ("parcels", "paper") for m in gentle.METHODS for s in (1, 2)}
    flown |= {("parcels", "halo", 1): row | {"target_speed_mean_m_s": 0.5}}
    found = gentle.flow_figures("parcels", flown)
    assert found["circular"] is False and gentle.flow_figures("paper", flown)["circular"] is True
    assert set(found["methods"]) == set(gentle.METHODS) and found["reduction_vs_unaware_pct"] == pytest.approx(0.0)
    assert found["levers"] == {"halo": pytest.approx(50.0)} and found["lever_details"]["halo"]["seeds"] == 1
    assert found["methods"]["dp"]["exposure_speed_mean_m_s"] == 1.0


def test_the_route_hovers_then_orbits_and_stays_at_its_standoff():
    """Camera at the standoff all along, at rest while it hovers, photographs on both legs."""
    route = gentle_route(np.array([0.0, 0.0, 1.43]), 0.5, 0.3)
    for time_s in np.linspace(0.0, route.duration_s, 40):
        X_WC, _, _ = route.camera(float(time_s))
        assert np.linalg.norm(X_WC.p_m - route.centre_W_m) == pytest.approx(0.5)
    assert np.linalg.norm(route.body(12.0, VEHICLE.X_BC).nu_B) == 0.0
    assert {route.leg_name(float(t)) for t in route.exposures_s} == {"hover", "orbit"}


def test_the_papers_world_is_the_papers_model():
    """One thruster at full lag: the water is sqrt(T) times the model's unit velocity; none, and it is still."""
    target = place_on_bed("branching", coral("branching", 0), 1.5)
    settings = TankSettings(current_m_s=(0.0, 0.0, 0.0))
    start = BodyState(X_WB=Pose(np.array([0.0, 0.0, 0.9])))
    world = PaperWorld(VEHICLE, target, settings, start, np.random.default_rng(0))
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


def test_seeds_from_the_environment_are_checked(monkeypatch):
    """A number, or a refusal."""
    monkeypatch.setenv("WAKEWISE_SEEDS", "3")
    assert gentle._wished_seeds() == 3
    monkeypatch.setenv("WAKEWISE_SEEDS", "many")
    with pytest.raises(InputError, match="WAKEWISE_SEEDS"):
        gentle._wished_seeds()
