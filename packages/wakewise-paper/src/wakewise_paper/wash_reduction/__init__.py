"""What each method and each mechanism does to the target's water where users have the trouble (see `bench.py`).

`scenarios/` and `scenario_files.py` say what is flown, `scenario_files.py` which trim and current a seed has,
`routes.py` how it is flown, `flight.py` flies it, `figures.py` and `summary_table.py` say what it gave.
`energy_optimum.py` works out the most that sharing thrusts out could gain, with `energy_optimum.py` and
`energy_optimum.py`; `figures.py` tells it.
"""
