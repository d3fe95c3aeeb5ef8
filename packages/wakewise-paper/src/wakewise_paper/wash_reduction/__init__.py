"""What each method and each lever does to the target's water where users have the trouble (see `bench.py`).

`scenarios/` and `library.py` say what is flown, `strata.py` which trim and current a seed has, `courses.py` how it is
flown, `flight.py` flies it, `figures.py` and `headline.py` say what it gave. `bound.py` works out the most that
sharing thrusts out could gain, with `sharings.py` and `choosing.py`; `bound_figures.py` tells it.
"""
