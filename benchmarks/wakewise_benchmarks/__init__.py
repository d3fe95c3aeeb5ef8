"""Benches: speed and quality of one part, side by side with a peer or the readable twin in the same run.

One module per bench, named like it, with `run(options) -> dict` returning the keys that the command prints. Figures
depend on the machine, so no test holds them; `wakewise bench NAME` and `make bench` print them.
"""

from wakewise.experiments.trials.timing import BenchOptions, timed_us
from wakewise_benchmarks.registry import BENCHES, run_bench

__all__ = ["BENCHES", "BenchOptions", "run_bench", "timed_us"]
