"""Learning: Gymnasium environments of station keeping in front of a target, reference policies, a trainer (extra).

- `task.py`: the task: pose to hold, observation, action, reward; what an episode draws.
- `vector_env.py`: many vehicles at once on the batched dynamics with a jet model; `hold_kernels.py`: its kernel.
- `tank_env.py`: one vehicle in the simulated tank, with its sensors and state estimation.
- `policies.py`: `dp` on observations, a small network beside it, and rollouts.
- `evolution.py`: evolution strategies (ES) in NumPy.

Importing this package registers `wakewise/StationKeeping-v0` and `wakewise/StationKeepingJet-v0` with Gymnasium.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes
from wakewise.core.optional_dependencies import has

if TYPE_CHECKING:
    from wakewise.learning.evolution import train
    from wakewise.learning.policies import DpPolicy, ResidualPolicy, rollout
    from wakewise.learning.tank_env import StationKeepingEnv
    from wakewise.learning.task import StationKeepingTask
    from wakewise.learning.vector_env import StationKeepingVectorEnv

__all__ = [
    "DpPolicy",
    "ResidualPolicy",
    "StationKeepingEnv",
    "StationKeepingTask",
    "StationKeepingVectorEnv",
    "rollout",
    "train",
]

lazy_attributes(__name__, "learning")

if has("learning"):
    import gymnasium

    gymnasium.register("wakewise/StationKeeping-v0", entry_point="wakewise.learning.tank_env:StationKeepingEnv")
    gymnasium.register(
        "wakewise/StationKeepingJet-v0", vector_entry_point="wakewise.learning.vector_env:StationKeepingVectorEnv"
    )
