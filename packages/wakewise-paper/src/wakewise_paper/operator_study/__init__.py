"""An operator's velocity in the tank's worlds: how closely it is obeyed, what that costs the water (research log 47).

`worlds.py` says which world a seed is, `flight.py` what the pilots ask for, `flight.py` flies it, `bench.py` and
`bench.py` say what it gave; `paper.py` is the same in the paper's own water, which is circular.
"""
