"""The gentle meter: beside a vehicle that dives, what its thrusters do to the target, and what would have been spared.

It only listens: nothing here can command a vehicle. Start reading in `meter.py` (a `Meter` is asked ten times a second
and answers a `Reading`). `vehicle_listener.py` keeps what the vehicle said last, `vehicle_listener.py` is the
connection that it is heard by, `meter.py` makes JSON of a reading, `meter.py` keeps the last minutes, `meter.py` the
dive. `server.py` serves the page in `page/`, `run.py` joins them, `run.py` is what is asked for. `embedded.py` is the
door for computers that have NumPy and pymavlink only, such as a BlueROV2's own: `python -m
wakewise_ardusub.wash_meter.embedded`.
"""
