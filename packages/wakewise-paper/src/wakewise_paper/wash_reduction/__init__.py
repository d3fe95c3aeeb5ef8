"""The study of wash: what each method and mechanism does to the target's water (`wakewise bench gentle`).

- `bench.py`: which flights are made, and the answer of the command.
- `scenarios/`, `scenario_files.py`: the scenarios, and what a seed of one is (trim, side of the current).
- `flight.py`: one flight: fields, setup and probes. `paper.py`: the same in the paper's own water, which is circular.
- `headline.py`: the table that was chosen before anything was flown.
- `energy_optimum.py`, `prescribed_motion.py`: the least wash that sharing thrusts can reach.
- `optimum_figures.py`: its table.
"""
