"""The bench of the environments for learning: speed, protocol, refusals."""

from functools import partial

import numpy as np
import pytest

from wakewise.experiments.trials.timing import BenchOptions
from wakewise.learning import ResidualPolicy, StationKeepingTask
from wakewise_benchmarks import learning
from wakewise_benchmarks.registry import run_bench

pytestmark = pytest.mark.slow

SHORT = StationKeepingTask(episode_s=0.2, points=12)


def test_steps_per_second_are_more_than_asked() -> None:
    """By thread CPU on one thread, the default task makes more than 20,000 environment steps per second."""
    figures = learning.speed_figures(StationKeepingTask(), count=256, rounds=3)
    assert figures["steps_per_s_cpu_1_thread"] > learning.ASKED_STEPS_PER_S == figures["asked_steps_per_s"]
    assert figures["tank_steps_per_cpu_s"] > 0.0


def test_the_untrained_policy_differs_from_dp_in_nothing() -> None:
    """Both worlds compare pairs of the same episodes: for the same policy all differences are zero."""
    parameters = ResidualPolicy.start(SHORT, np.random.default_rng(0))
    found = learning.policy_figures(SHORT, parameters, tanks=2)
    assert (found["jet"]["episodes"], found["tank"]["episodes"]) == (learning.JET_EPISODES, 2)
    for world in ("jet", "tank"):
        for name in ("return", "wash_m_s", "position_rmse_m", "energy_J"):
            assert found[world][name]["difference"][0] == 0.0


def test_the_bench_trains_and_compares_in_both_worlds(monkeypatch: pytest.MonkeyPatch) -> None:
    """`wakewise bench learning` gives speed, time of training and both worlds; cut to one short generation."""
    cut = {"ENVIRONMENTS": 8, "ROUNDS": 1, "GENERATIONS": 1, "CANDIDATES": 2, "EPISODES": 2, "JET_EPISODES": 4}
    for name, value in (cut | {"EPISODE_S": 0.1, "StationKeepingTask": lambda: SHORT}).items():
        monkeypatch.setattr(learning, name, value)
    monkeypatch.setattr(learning, "speed_figures", partial(learning.speed_figures, count=8, rounds=1))
    found = run_bench("learning", BenchOptions(seeds=2))
    assert found.keys() == {"speed", "training_s", "training_cpu_s", "jet", "tank"}
    assert found["tank"]["episodes"] == 2
