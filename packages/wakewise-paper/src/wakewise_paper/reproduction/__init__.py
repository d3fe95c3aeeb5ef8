"""The paper's tables beside ours, from trials that anyone can rerun (`wakewise reproduce`).

`claim.py` says what a figure of the paper is, `published_tables.py` and its parts hold them as data; `worlds.py` says
where trials are made; `table_trials.py` which trials a table is made of, `worlds.py` the missions that
`success` draws. A trial is work for a campaign: `flights.py` with `piv_flights.py`, `scans.py`, `scans.py`.
`rows.py` turns trials into rows of paper and ours, `run.py` into cells, `claim.py` says what a table is
judged by; `run.py` makes a table, or all of them within a budget.
"""
