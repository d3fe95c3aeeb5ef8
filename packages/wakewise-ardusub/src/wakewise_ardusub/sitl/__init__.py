"""A stand-in for ArduSub: the same bytes over MAVLink, for tests and for trying Wakewise with no vehicle.

It is no copy of the firmware: what is here is what its public documentation, sources and messages say, and what was
seen of it behind Wakewise's physics (docs/sitl.md tells both apart). It runs the script that is shipped, itself.

Start reading in `simulated_autopilot.py` (bytes and motion in, pulses and bytes out; no socket, no clock of its own).
`mavlink_messages.py` is what a message does, `mavlink_messages.py` what is told and how often; `modes.py`, `modes.py`
and `modes.py` lead from the pilot to the motors, `modes.py` is what the pilot's buttons do, `servos.py` leads to one
motor alone, `servos.py` from there to the outputs, past which a script may go; `simulated_autopilot.py` is what happens
when somebody falls silent; `own_parameters.py` with `own_parameters.py`, `files.py` (MAVFTP) and `scripting.py` (Lua)
are the rest of the computer. `udp_endpoints.py` has the sockets: ground stations on one side, physics on the other.
`inprocess_session.py` flies it in its own time beside a companion that is a mere stream, `companion_harness.py` beside
the shipped one; `inprocess_session.py` is a pilot for whom nobody must be there.
"""
