"""Does a small policy, trained for minutes in a jet model, leave the target's water stiller than dp?"""

import sys

import numpy as np
from gymnasium.vector import SyncVectorEnv

from wakewise import learning as wl

generations, tanks = (int(given) for given in (sys.argv[1:3] or ("150", "20")))  # 5 to 15 minutes on two cores
task, rng = wl.StationKeepingTask(), np.random.default_rng(0)
short = wl.StationKeepingVectorEnv(1024, wl.StationKeepingTask(episode_s=5.0))
parameters = wl.train(short, rng, generations=generations, episodes=16)
jets, water = wl.StationKeepingVectorEnv(256, task), SyncVectorEnv([lambda: wl.StationKeepingEnv(task)] * tanks)
for world, env, seed in (("jet model", jets, 2000), ("tank", water, 5000)):  # episodes that training did not see
    for name, policy in (("dp", wl.DpPolicy(task)), ("learned", wl.ResidualPolicy(task, parameters))):
        got = {figure: float(values.mean()) for figure, values in wl.rollout(env, policy, seed=seed).items()}
        place_mm, wash_mm_s = 1e3 * got["position_rmse_m"], 1e3 * got["wash_m_s"]
        water_line = f"water {wash_mm_s:.2f} mm/s, {place_mm:.1f} mm off, {got['energy_J']:.1f} J"
        print(f"{world}, {name}: return {got['return']:.2f}, {water_line}")
