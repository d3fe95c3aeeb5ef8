"""By hand: what an operator asks for becomes goals, and a flight goes on until somebody ends it.

`operator_state.py` is what an operator has set, `assisted.py` the pilot between hands and goals; `motion.py` is the one
smooth goal that all share, `arbitration.py` moves it by sticks and `assist_modes.py`, `collision_limiter.py` off what
is solid, `resumable_mission.py` along a mission that waits. `simulated_operator.py` is a person at these sticks,
`human_pilot.py` one whose sticks ask any method for velocities. `live.py` flies without an end, by the clock of
`realtime_pacer.py`, and photographs when `photo_trigger.py` is asked; `live_folder.py` makes a trial's folder of what
was, and `replay.py` flies its hands again.
"""
