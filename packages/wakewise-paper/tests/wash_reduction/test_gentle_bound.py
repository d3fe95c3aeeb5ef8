"""The most that sharing thrusts out could gain: choices, sharings, and what a made-up water makes of them."""

from itertools import pairwise, product
from types import SimpleNamespace

import numpy as np
import pytest

from pools import Here
from wakewise.allocation import compile_layout
from wakewise.control.forward_jet_exclusion import bow_layout
from wakewise.control.null_space_allocation import vehicle_layout
from wakewise.core.errors import InputError
from wakewise.core.interfaces import no_progress
from wakewise.experiments.trials import BenchOptions
from wakewise.robot.vehicles import load_vehicle
from wakewise_paper.cli.bench_wash import show_gentle
from wakewise_paper.wash_reduction import bench as gentle
from wakewise_paper.wash_reduction import energy_optimum
from wakewise_paper.wash_reduction.energy_optimum import (
    ENERGIES,
    FRESH_GUSTS,
    AllocationJudge,
    attained_reductions,
    candidate_allocations,
    candidates,
    choose_under_budget,
    fly_bound,
    fly_dp,
    smoothed,
    split,
    sum_of,
)
from wakewise_paper.wash_reduction.flight import FIGURES
from wakewise_paper.wash_reduction.optimum_figures import NAMED, bound_figures, reductions

VEHICLE = load_vehicle("paper")
LAYOUT = vehicle_layout(VEHICLE)
STEP_S = 0.05


class MadeUp:
    """A water that is known: its speed at the target is that of the present thrusts."""

    def __init__(self, speed, steps):
        self.speed, self.times_s = speed, STEP_S * np.arange(steps + 1)

    def wash_m_s(self, thrusts_N, every, gusts):
        """Gusts add the same to all."""
        return np.array([self.speed(T) for T in thrusts_N[every::every]]) + 0.001 * gusts


def judged(speed, least_N):
    """A flight of given least thrusts, shape (k, n), without settling, in a made-up water."""
    flown = SimpleNamespace(led=MadeUp(speed, len(least_N) - 1), vehicle=VEHICLE, judged_s=0.0)
    return AllocationJudge.of(flown, candidate_allocations(LAYOUT, least_N))


def heavy_flight(seconds):
    """Least thrusts of a vehicle that pushes astern and down, then ahead, shape (k, n)."""
    steps = round(seconds / STEP_S)
    ahead = np.where(np.arange(steps + 1) < steps / 2, -3.0, 1.0)
    return np.array([LAYOUT.inverse @ [x, 0.0, 2.0, 0.0, 0.0, 0.0] for x in ahead])


def of_thruster(number):
    """Speed that one thruster alone makes, as the root of its thrust."""
    return lambda T: 0.02 * np.sqrt(abs(T[number]))


def test_two_stretches_spend_the_power_where_it_buys_more():
    """One bound on the sum, and only one of two stretches can be spared for it: the one with more wash."""
    wash, energy = np.array([[5.0, 1.0], [9.0, 2.0]]), np.array([[0.5, 0.7], [0.5, 0.8]])
    assert choose_under_budget(wash, energy, 1.35).tolist() == [0, 1]
    assert choose_under_budget(wash, energy, 1.25).tolist() == [1, 0]
    assert choose_under_budget(wash, energy, 1.05).tolist() == [0, 0]
    assert (
        choose_under_budget(wash, energy, 1.51).tolist() == choose_under_budget(wash, energy, np.inf).tolist() == [1, 1]
    )
    assert choose_under_budget(wash, energy, 0.9).tolist() == [0, 0]


@pytest.mark.parametrize("seed", range(4))
def test_a_choice_is_the_best_of_all_within_the_bound_and_more_energy_never_harms(seed):
    """Against all that there are: no other within the bound is better, but for what rounding up leaves."""
    rng = np.random.default_rng(seed)
    wash, energy = rng.uniform(size=(4, 5)), 0.25 * rng.uniform(1.0, 2.0, size=(4, 5))
    before = np.inf
    for most in (1.1, 1.3, 1.6, np.inf):
        picks = choose_under_budget(wash, energy, most)
        own = sum_of(wash, picks)
        every = [np.array(each) for each in product(range(5), repeat=4)]
        within = [each for each in every if sum_of(energy, each) <= 0.998 * most]
        if within:
            assert sum_of(energy, picks) <= most + 1e-9
            assert own <= min(sum_of(wash, each) for each in within) + 1e-12
        assert own <= before + 1e-12
        before = own


def test_sharings_make_the_same_wrench_within_limits_and_begin_with_the_least():
    """The first is the least thrusts; in others a thruster rests at every step; none is there twice."""
    least = heavy_flight(2.0)
    every = candidate_allocations(LAYOUT, least)
    assert np.array_equal(every[0], least)
    assert np.abs((every - least) @ LAYOUT.B.T).max() < 1e-9
    assert (every >= LAYOUT.lower_N - 1e-9).all() and (every <= LAYOUT.upper_N + 1e-9).all()
    rests = (np.abs(every).min(axis=2) < 1e-9).all(axis=1)
    assert rests.any() and not rests[0]
    apart = np.abs(every[:, None] - every[None]).mean(axis=(2, 3)) + np.eye(len(every))
    assert apart.min() > 0.001
    assert np.allclose(split(LAYOUT, every[3])[0], least)


def test_spare_thrusts_that_share_thrusters_are_refused():
    """Lines are what the grid is made of."""
    B = np.zeros((6, 4))
    B[0] = 1.0
    with pytest.raises(InputError, match="lines"):
        candidate_allocations(compile_layout(B, -np.ones(4), np.ones(4)), np.zeros((3, 4)))


def test_the_front_falls_with_energy_and_without_a_bound_the_jet_that_does_it_rests():
    """A thruster that alone stirs the target is at rest where power does not matter, and pushes less for little."""
    least = heavy_flight(20.0)
    judge = judged(of_thruster(0), least)
    found = attained_reductions(judge)
    bounds = [found[f"bound_{name}_m_s"] for name in ENERGIES]
    assert all(more <= less + 1e-12 for less, more in pairwise(bounds))
    assert bounds[0] < judge.wash_m_s(0) and bounds[-1] < 0.05 * bounds[0]
    for name, most in ENERGIES.items():
        assert found[f"attained_{name}_energy"] <= most + 1e-9
        # Water without memory gives what was promised, and gusts that did not choose are what it is judged by.
        assert found[f"attained_{name}_m_s"] >= found[f"bound_{name}_m_s"] + 0.001 * np.mean(FRESH_GUSTS) - 1e-12
    assert found["attained_any_m_s"] == pytest.approx(found["bound_any_m_s"] + 0.0015)


def test_where_no_jet_reaches_the_target_nothing_is_to_be_gained():
    """Water that is the same whatever the thrusts: the bound is the least thrusts' own wash, at their energy."""
    judge = judged(lambda T: 0.004, heavy_flight(10.0))
    found = attained_reductions(judge)
    for name in ENERGIES:
        assert found[f"bound_{name}_m_s"] == pytest.approx(judge.wash_m_s(0))
        assert found[f"attained_{name}_m_s"] == pytest.approx(0.0055)
    assert judge.energy(0) == 1.0


@pytest.mark.slow
def test_a_flight_of_dp_is_judged_with_the_rule_and_the_belief_among_the_choices(monkeypatch, tmp_path):
    """Its first seconds: all choices make its wrench, the rule's bow thrusters never blow ahead, and all keys are told;
    the belief spares the target by what it knows, for power.
    """
    flown = fly_dp("orbit/paper", 1, 12.0)
    monkeypatch.setattr(
        energy_optimum, "candidate_allocations", lambda layout, least_N: candidate_allocations(layout, least_N)[:3]
    )
    grid, named = candidates(flown)
    assert np.abs((grid - grid[0]) @ flown.layout.B.T).max() < 1e-6
    rule = bow_layout(flown.vehicle)
    assert (grid[named["rule"]] >= rule.lower_N - 1e-6).all() and (grid[named["rule"]] <= rule.upper_N + 1e-6).all()
    assert not (grid[0] >= rule.lower_N - 1e-6).all() or not (grid[0] <= rule.upper_N + 1e-6).all()
    monkeypatch.setattr(energy_optimum, "fly_dp", lambda *_: flown)
    monkeypatch.setattr(energy_optimum, "candidates", lambda _: (grid, named))
    row = fly_bound({"scenario": "orbit/paper", "seed": 1}, tmp_path, no_progress)
    assert None not in row.values() and row["sharings"] == 6.0
    assert row["belief_any_m_s"] < 0.8 * row["least_m_s"] and row["belief_any_energy"] > 1.05
    assert row["bound_any_m_s"] <= row["bound_1.05_m_s"] <= 1.5 * row["least_m_s"]


def test_power_goes_to_the_flight_in_which_it_buys_more():
    """Two flights share 1.3: one gains nothing by it, the other nearly all beyond it."""
    plain = dict.fromkeys((f"{name}_{what}" for name in NAMED for what in ("m_s", "energy")), None)
    plain |= {"dp_m_s": 0.05, "least_m_s": 0.05, "least_power_W": 5.0}

    def row(speeds):
        own = {
            f"{kind}_{name}_m_s": v for kind in ("bound", "attained") for name, v in zip(ENERGIES, speeds, strict=True)
        }
        energies = {
            f"{kind}_{name}_energy": min(v, 1.8) for kind in ("bound", "attained") for name, v in ENERGIES.items()
        }
        return plain | own | energies

    rows = {("a", "bound", 1): row([0.05] * 6), ("b", "bound", 1): row([0.05, 0.05, 0.05, 0.005, 0.005, 0.005])}
    trouble = bound_figures(rows)["trouble"]
    assert trouble["bound_1.3_less_pct"] == pytest.approx(0.0)
    assert trouble["bound_1.3_summed_less_pct"] == pytest.approx(100.0 * (1.0 - np.sqrt(0.1)))
    assert trouble["bound_1.5_summed_less_pct"] == trouble["bound_any_less_pct"]
    assert trouble["rule_less_pct"] is None and trouble["rule_flights"] == 0
    assert reductions(rows["b", "bound", 1])["attained_1.5_less_pct"] == pytest.approx(90.0)


def test_a_mean_over_rows_keeps_what_is_straight_and_takes_noise_away():
    """Away from the ends a line stays; what alternates goes to a third."""
    line = np.arange(20.0)[:, None]
    assert np.allclose(smoothed(line, 5)[2:-2], line[2:-2])
    noise = np.where(np.arange(21) % 2, -1.0, 1.0)[:, None]
    assert np.abs(smoothed(noise, 3)[1:-1]).max() == pytest.approx(1 / 3)


def test_the_bench_tells_the_bound_where_it_is_desired(monkeypatch, tmp_path, capsys):
    """Beside the flights; kept like them."""
    row = {"dp_m_s": 0.03, "least_m_s": 0.03, "least_power_W": 5.0, "rule_m_s": 0.01, "rule_energy": 1.2}
    row |= {"belief_m_s": 0.01, "belief_energy": 1.1, "belief_any_m_s": 0.01, "belief_any_energy": 1.5}
    for kind in ("bound", "attained"):
        row |= {f"{kind}_{name}_m_s": 0.006 for name in ENERGIES} | {f"{kind}_{name}_energy": 1.05 for name in ENERGIES}
    worked = []

    def made_up(settings, folder, progress):
        worked.append(settings)
        return row

    monkeypatch.setattr(gentle, "_engine", lambda _: Here())
    monkeypatch.setattr("wakewise.experiments.campaigns.study.compile_kernels", lambda **_: None)
    monkeypatch.setattr("wakewise.experiments.campaigns.flights.fly_stage", lambda *_: dict.fromkeys(FIGURES, 0.02))
    monkeypatch.setattr("wakewise_paper.wash_reduction.energy_optimum.fly_bound", made_up)
    options = BenchOptions(seeds=1, bound=2, scenarios=("orbit/paper",), methods=("dp",), store=tmp_path)
    found = gentle.run(options)
    assert len(worked) == 2 and found["failed"] == 0
    assert found["bound"]["flights"]["orbit/paper 2"]["bound_1.3_less_pct"] == pytest.approx(80.0)
    show_gentle(found)
    assert "the most that sharing" in capsys.readouterr().out
    gentle.run(options)
    assert len(worked) == 2
    assert (
        gentle.run(BenchOptions(seeds=1, scenarios=("orbit/paper",), methods=("dp",), store=tmp_path))["bound"] is None
    )
