"""The paper's tables beside ours, from trials that anyone can rerun (`wakewise reproduce`).

`claim.py` says what a figure of the paper is, `quoted.py` and its parts hold them as data; `waters.py` says where
trials are made; `blocks.py` which trials a table is made of, `varied.py` the missions that `success` draws. A trial is
work for a campaign: `flights.py` with `piv_flights.py`, `scans.py`, `measured.py`. `rows.py` turns trials into rows of
paper and ours, `comparison.py` into cells, `judged.py` says what a table is judged by; `run.py` makes a table, or all
of them within a budget.
"""
