"""The gentle meter: beside a vehicle that dives, what its thrusters do to the target, and what would have been spared.

It only listens: nothing here can command a vehicle. Start reading in `meter.py` (a `Meter` is asked ten times a second
and answers a `Reading`). `vehicle_listener.py` keeps what the vehicle said last, `mavlink_socket.py` is the connection
that it is heard by, `json_state.py` makes JSON of a reading, `history.py` keeps the last minutes, `record.py` the dive.
`server.py` serves the page in `page/`, `run.py` joins them, `settings.py` is what is asked for. `embedded.py` is the
door for computers that have NumPy and pymavlink only, such as a BlueROV2's own: `python -m
wakewise_ardusub.wash_meter.embedded`.
"""
