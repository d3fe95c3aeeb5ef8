"""The study of operators: how closely an operator's velocity is followed, and what it costs the water.

- `bench.py`: which flights are made, and the answer of `wakewise bench operator`.
- `worlds.py`: which world a seed is. `flight.py`: what the pilots ask for; setup and probe of a flight.
- `paper.py`: the same in the paper's own water, which is circular.

What is flown and judged was written down before the first flight (docs/research-log/0047).
"""
