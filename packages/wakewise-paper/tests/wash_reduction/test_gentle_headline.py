"""The headline's arithmetic, on made-up flights."""

import json

import pytest

from wakewise_paper.wash_reduction.headline import ENERGY, PLACE, SILT, SPEED, SWAY, WRONG, headline


def row(speed_mm_s, silt=1.0, sway=1.0, place=5.0, energy=1.0):
    return {SPEED: 1e-3 * speed_mm_s, SILT: silt, SWAY: sway, PLACE: place, ENERGY: energy}


BAD, WORSE, CALM = ("orbit/paper", 1), ("close/paper", 1), ("calm/paper", 1)
BETWEEN = ("orbit/paper", 2)
FLIGHTS = {
    "dp": {BAD: row(40.0), WORSE: row(20.0), CALM: row(4.0), BETWEEN: row(7.0)},
    "mpc": {BAD: row(40.0), WORSE: row(20.0), CALM: row(4.0)},
    "no-forward-jets": {BAD: row(8.0), WORSE: row(16.0), CALM: row(2.0)},
    "wake-aware": {
        BAD: row(4.0, silt=0.5, sway=0.2, place=5.3, energy=1.4),
        WORSE: row(8.0, silt=0.1, sway=0.4, place=5.3, energy=1.0),
        CALM: row(3.0, silt=1.2, energy=1.1),
        BETWEEN: row(7.0),
    },
    WRONG: {BAD: row(8.0), WORSE: row(8.0)},
}
TRIMS = dict.fromkeys(FLIGHTS["dp"], "heavy")


def test_trouble_is_where_dp_leaves_much_and_calm_where_it_leaves_little():
    """Two flights are in trouble, one is calm, one is neither."""
    found = headline(FLIGHTS, TRIMS, set())
    assert found["trouble"]["flights"] == 2 and found["calm"]["flights"] == 1
    assert found["trouble"]["scenarios"] == ["close/paper", "orbit/paper"]
    # Chosen by its mean over seeds, orbit is in trouble with both of its flights.
    assert found["by_scenario"]["trouble"]["flights"] == 3
    json.dumps(found, allow_nan=False)


def test_the_bars_are_computed_as_decision_33_says():
    """Logarithms for wash, sums for silt, sway and energy, the camera's place for accuracy, the least for the worst."""
    found = headline(FLIGHTS, TRIMS, set())["trouble"]
    assert found["reduction_vs_dp_pct"] == pytest.approx(80.0)  # ln(.1) and ln(.4) average to ln(.2)
    assert found["reduction_vs_mpc_pct"] == pytest.approx(80.0)
    assert found["reduction_vs_no_forward_jets_pct"] == pytest.approx(50.0)
    assert found["worst_world"] == "close/paper" and found["worst_world_pct"] == pytest.approx(60.0)
    assert found["energy_ratio"] == pytest.approx(1.2)
    assert found["silt_rays_reduction_pct"] == pytest.approx(70.0)
    assert found["sway_reduction_pct"] == pytest.approx(70.0)
    assert found["sway_worst_world_pct"] == pytest.approx(60.0)
    assert found["position_ok"] is True and found["dp_camera_rmse_mm"] == pytest.approx(5.0)  # 5.3 <= 5.25 + .2
    # Wrong: ln(.2) and ln(.4) average to ln(.283): 71.7 of 80.
    assert found["wrong_current_keeps_pct"] == pytest.approx(100.0 * 71.716 / 80.0, rel=1e-4)
    calm = headline(FLIGHTS, TRIMS, set())["calm"]
    assert (calm["wash_ratio"], calm["silt_ratio"], calm["energy_ratio"]) == pytest.approx((0.75, 1.2, 1.1))


def test_a_flight_that_failed_is_no_gain_and_no_accuracy():
    """One of ours that failed does not vanish from the mean; one of a rival's has no pair."""
    ours = {key: value for key, value in FLIGHTS["wake-aware"].items() if key != WORSE}
    found = headline(FLIGHTS | {"wake-aware": ours}, TRIMS, {("wake-aware", WORSE)})["trouble"]
    assert found["reduction_vs_dp_pct"] == pytest.approx(100.0 * (1.0 - 0.1**0.5))
    assert found["position_ok"] is False and found["worst_world_pct"] == pytest.approx(0.0)
    rival = {key: value for key, value in FLIGHTS["no-forward-jets"].items() if key != WORSE}
    lost = headline(FLIGHTS | {"no-forward-jets": rival}, TRIMS, {("no-forward-jets", WORSE)})["trouble"]
    assert lost["reduction_vs_no_forward_jets_pct"] == pytest.approx(50.0)


def test_harm_is_looked_for_everywhere():
    """Also where there is no trouble: the calm scenario has the most silt, and none has more wash."""
    found = headline(FLIGHTS, TRIMS, set())["everywhere"]
    assert (found["silt_rays_most_ratio"], found["silt_rays_most_where"]) == (pytest.approx(1.2), "calm/paper")
    assert found["wash_most_ratio"] == pytest.approx(0.75) and found["sway_most_ratio"] == pytest.approx(1.0)


def test_a_camera_that_is_off_is_not_ok():
    """5 % and 0.2 mm are allowed, no more."""
    worse = {key: value | {PLACE: 5.6} for key, value in FLIGHTS["wake-aware"].items()}
    assert headline(FLIGHTS | {"wake-aware": worse}, TRIMS, set())["trouble"]["position_ok"] is False


def test_what_was_not_flown_is_null_with_a_reason():
    """Without rivals, troubles or wrong currents there is nothing to say, and it says why."""
    found = headline({"wake-aware": FLIGHTS["wake-aware"]}, {}, set())
    assert found["trouble"]["reduction_vs_dp_pct"] is None and found["trouble"]["why"]["reduction_vs_dp_pct"]
    assert found["trouble"]["position_ok"] is None and found["calm"]["wash_ratio"] is None
