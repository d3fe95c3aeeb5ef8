"""The paper's tables and the studies behind them: each a campaign with routes, probes and a table of its own.

- `wash_reduction/`: what methods and mechanisms do to the target's water (`wakewise bench gentle`).
- `operator_study/`: an operator's velocity (`wakewise bench operator`).
- `world_study/`: every world of the library, models included (`wakewise bench worlds`).
- `reproduction/`: the paper's tables beside ours (`wakewise reproduce`); `published.yaml` holds the paper's numbers.
- `flights.py`, `routes.py`: setup functions, probes and routes that the studies share.
- `wake_validation.py`, `flows.py`, `wake_piv.py`: wake models against measured flows (`wakewise wake validate`).
- `learned_wake/`: a network as a rival of the wake models (`wakewise wake learn`).
- `flight_fit/`: a jet calibrated from what the camera sees in flight (`wakewise wake calibrate-flight`).
- `photo_robustness.py`, `photo_sets.py`: models from photographs in turbid water (`wakewise photo-robustness`).
- `lattice_reference/`: lattice Boltzmann reference computations.
- `reports/`: pages and plots. `cli/`: the commands.
"""
