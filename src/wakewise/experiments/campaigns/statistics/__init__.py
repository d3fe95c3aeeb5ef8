"""What figures of many trials say: differences with their sureness, shares with their intervals.

`paired.py` tests on pairs of one seed, and effect sizes; `corrections.py` for several tests at once; `intervals.py`
Wilson's and the stratified bootstrap; `profiles.py` probability of improvement and performance profiles; `missing.py`
what a trial without figures counts as; `sample_size.py` how many trials a difference needs. Plain arrays in, plain
records out, nothing drawn but from a given seed.
"""

from wakewise.experiments.campaigns.statistics.corrections import bonferroni, holm
from wakewise.experiments.campaigns.statistics.intervals import (
    Interval,
    interquartile_mean,
    stratified_bootstrap,
    wilson,
)
from wakewise.experiments.campaigns.statistics.missing import WORST, as_worst, dropped
from wakewise.experiments.campaigns.statistics.paired import PairedTest, paired_test
from wakewise.experiments.campaigns.statistics.profiles import performance_profile, probability_of_improvement
from wakewise.experiments.campaigns.statistics.sample_size import (
    pairs_needed,
    power_of_pairs,
    smallest_effect,
    trials_for_rate,
)

__all__ = [
    "WORST",
    "Interval",
    "PairedTest",
    "as_worst",
    "bonferroni",
    "dropped",
    "holm",
    "interquartile_mean",
    "paired_test",
    "pairs_needed",
    "performance_profile",
    "power_of_pairs",
    "probability_of_improvement",
    "smallest_effect",
    "stratified_bootstrap",
    "trials_for_rate",
    "wilson",
]
