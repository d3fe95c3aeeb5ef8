"""A flight of a real vehicle: the loop, parts and record of every flight, joined to a warden that lets thrusts through.

The loop runs from when the vehicle is heard until the session ends, so that the estimate is good when the operator
consents. While the pilot flies, the controller rests, the estimator is told what the servos do, and the goal is where
the vehicle is; each engagement begins afresh from there. In which engagement a step is flown is settled once, when its
goal is asked for, and thrusts of another are not sent (`wakewise_ardusub.link.output_gate`).

Start reading in `session.py` (from a connection to a flight) and `link_join.py` (the parts); `link_join.py` is
who flies now, `session.py` what is spared, `cameras.py` who takes the photographs, `link_join.py` what ground
stations are told, `link_join.py` what is done before it counts.
"""
