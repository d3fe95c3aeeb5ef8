"""By hand: what an operator asks for becomes goals, and a flight goes on until somebody ends it.

`operator_state.py` is what an operator has set, `assisted.py` the pilot between hands and goals; `motion.py` is the one
smooth goal that all share, `arbitration.py` moves it by sticks and `arbitration.py`, `arbitration.py` off what
is solid, `resumable_mission.py` along a mission that waits. `human_pilot.py` is a person at these sticks,
`human_pilot.py` one whose sticks ask any method for velocities. `live.py` flies without an end, by the clock of
`live.py`, and photographs when `live.py` is asked; `live.py` makes a trial's folder of what
was, and `replay.py` flies its hands again.
"""
