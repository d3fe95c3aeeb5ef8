"""`bench gpu` without a card: the processor's figures, and reasons for the card's."""

import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.trials.timing import BenchOptions
from wakewise_benchmarks import gpu
from wakewise_paper.lattice_reference import engines


def test_without_a_card_the_processors_figures_and_the_reason_are_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of the card's is made up: null each, and `why` says what is missing."""
    monkeypatch.setattr(gpu, "CELLS", 8)
    monkeypatch.setattr(gpu, "STEPS", 2)
    for module in (gpu, engines):
        monkeypatch.setattr(module, "why_no_gpu", lambda: "no card")
    told = gpu.run(BenchOptions(only=("lattice",)))
    lattice = told["parts"]["lattice"]
    assert lattice["cpu_mlups"] > 0.0
    assert lattice["gpu_mlups"] is lattice["ratio"] is lattice["gap_rel"] is None
    assert told["why"]["lattice"] == "no card"


def test_a_part_that_does_not_exist_is_refused() -> None:
    """With the names of those that do."""
    with pytest.raises(InputError, match="allowed lattice, colmap, field"):
        gpu.run(BenchOptions(only=("ray-tracing",)))
