"""The plain loop that the lattice's kernel is timed against does the same sum."""

import pytest

from wakewise_benchmarks.lattice import plain_gap


@pytest.mark.slow
def test_the_plain_loop_and_the_kernel_agree() -> None:
    """One step of random populations, to float32's rounding."""
    assert plain_gap() < 1e-6
