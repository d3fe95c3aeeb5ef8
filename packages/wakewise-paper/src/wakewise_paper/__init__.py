"""Studies: questions that take many flights or flows, each answered by a table with its intervals.

Start reading in `gentle/` (what methods and mechanisms do to the target's water: `scenarios/` what is flown,
`flight.py` one flight, `headline.py` what is judged, `bench.py` the study) and `worlds/` (the same in every world of
the library, with models and `judge.py`, the second judge). `flight_batches.py` flies many flights, `flight_batches.py`
keeps them. `operator/` is the same for an operator's velocity. `wake_validation.py` holds wake models against flows
(`flows.py`, `oracle.py`, `real_jet.py`, `wake_piv.py`, the folder `piv/`), `degradation.py` models against worse and
worse water (`photo_sets.py`, `photo_sets.py`), `neural.py` a neural field's model against the cloud's.
"""
