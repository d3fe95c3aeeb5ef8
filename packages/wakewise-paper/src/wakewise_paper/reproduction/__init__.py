"""The paper's tables beside ours, from trials that anyone can repeat (`wakewise reproduce`).

- `published.yaml`: the paper's numbers with their section or table. `claim.py`: reads them; what a table is judged by.
- `table_trials.py`: which trials a table is made of. `worlds.py`: where they are made, and the missions of `success`.
- `scans.py`, `piv_flights.py`: work that is not a plain flight, and PIV in a flight.
- `run.py`: makes tables, as many trials as a budget has room for. `rows.py`: from trials to rows of paper and ours.
"""
