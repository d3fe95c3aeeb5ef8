"""By hand: what an operator asks for becomes goals, and a flight goes on until somebody ends it.

`desk.py` is what an operator has set, `assisted.py` the pilot between hands and goals; `motion.py` is the one smooth
goal that all share, `steering.py` moves it by sticks and `assists.py`, `keep_off.py` off what is solid, `scanning.py`
along a mission that waits. `hands.py` is a person at these sticks, `helm.py` one whose sticks ask any method for
velocities. `live.py` flies without an end, by the clock of `pace.py`, and photographs when `shutter.py` is asked;
`live_folder.py` makes a trial's folder of what was, and `replay.py` flies its hands again.
"""
