"""Studies: questions that take many flights or flows, each answered by a table with its intervals.

Start reading in `gentle/` (what each method and lever does to the target's water: `flight.py` one flight, `levers.py`
what is varied, `figures.py` the statistics, `store.py` flights that are kept, `bench.py` the study). `operator.py` is
the same for an operator's velocity. `wake_validation.py` holds wake models against flows (`flows.py`, `oracle.py`,
`real_jet.py`, `wake_piv.py`, the folder `piv/`), `degradation.py` models against worse and worse water
(`photo_sets.py`, `photo_model.py`), `neural.py` a neural field's model against the cloud's.
"""
