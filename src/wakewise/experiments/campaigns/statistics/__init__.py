"""What figures of many trials say: differences with their sureness, shares with their intervals.

`intervals.py` tests on pairs of one seed, and effect sizes; `intervals.py` for several tests at once; `intervals.py`
Wilson's and the stratified bootstrap; `intervals.py` probability of improvement and performance profiles;
`intervals.py` what a trial without figures counts as; `intervals.py` how many trials a difference needs. Plain arrays
in, plain records out, nothing drawn but from a given seed.
"""

from wakewise.experiments.campaigns.statistics.intervals import (
    WORST,
    Interval,
    PairedTest,
    as_worst,
    bonferroni,
    dropped,
    holm,
    interquartile_mean,
    paired_test,
    pairs_needed,
    performance_profile,
    power_of_pairs,
    probability_of_improvement,
    smallest_effect,
    stratified_bootstrap,
    trials_for_rate,
    wilson,
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
