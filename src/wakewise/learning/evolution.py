"""Evolution strategies (ES): a gradient of the mean return from returns of perturbed policies alone.

T. Salimans, J. Ho, X. Chen, S. Sidor and I. Sutskever 2017, Evolution Strategies as a Scalable Alternative to
Reinforcement Learning, arXiv 1703.03864: antithetic pairs, returns replaced by ranks, Adam (D. P. Kingma and J. Ba
2015, arXiv 1412.6980). All candidates of a generation meet the same episodes.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import no_progress
from wakewise.learning.policies import ResidualPolicy, rollout
from wakewise.learning.vector_env import StationKeepingVectorEnv

SPREAD, RATE = 0.05, 0.05
"""Standard deviation of the perturbations, and learning rate of Adam in the first generation; it falls evenly to 0."""
FIRST, SECOND, LEAST = 0.9, 0.999, 1e-8
"""Decay rates of Adam's moments and its least divisor: the paper's."""


def train(
    env: StationKeepingVectorEnv,
    rng: np.random.Generator,
    *,
    generations: int = 100,
    episodes: int = 8,
    budget_s: float = float("inf"),
    progress: Callable[..., None] = no_progress,
) -> Array:
    """Parameters of a `ResidualPolicy`, shape (size,), trained from `dp` on.

    `episodes`: per generation; num_envs / episodes candidates, an even number, meet them. It ends after `generations`
    or after `budget_s` of wall time. `progress` is called as `(done, total, note)`.
    """
    candidates = env.num_envs // episodes
    mean = ResidualPolicy.start(env.task, rng)
    first, second, began = np.zeros_like(mean), np.zeros_like(mean), time.monotonic()
    for k in range(1, generations + 1):
        if time.monotonic() - began > budget_s:
            break
        half = rng.standard_normal((candidates // 2, len(mean)))
        drawn = np.concatenate([half, -half])
        policy = ResidualPolicy(env.task, mean + SPREAD * drawn)
        flown = rollout(env, policy, seed=int(rng.integers(2**31)), options={"episodes": episodes})
        returns = flown["return"].reshape(candidates, episodes).mean(axis=1)
        ranks = returns.argsort().argsort() / (candidates - 1.0) - 0.5
        slope = ranks @ drawn / (candidates * SPREAD)
        first = FIRST * first + (1.0 - FIRST) * slope
        second = SECOND * second + (1.0 - SECOND) * slope**2
        step = first / (1.0 - FIRST**k) / (np.sqrt(second / (1.0 - SECOND**k)) + LEAST)
        mean = mean + RATE * (1.0 - (k - 1) / generations) * step
        progress(k, generations, f"mean return {returns.mean():.2f}")
    return mean
