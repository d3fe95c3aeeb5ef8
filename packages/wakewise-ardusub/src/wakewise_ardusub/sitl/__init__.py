"""Simulated ArduSub autopilot with the same MAVLink messages, for tests and for trials without a vehicle.

It is no copy of the firmware. It follows ArduSub's public documentation, sources and messages, and the behaviour seen
behind Wakewise's physics (docs/sitl.md lists both). It runs the shipped Lua script.

- `simulated_autopilot.py`: bytes and motion in, pulses and bytes out, without sockets or a clock; failsafes. Read this
  first.
- `mavlink_messages.py`: handlers of received messages, builders and rates of sent ones.
- `modes.py`: sticks, buttons, flight modes and mixer. `servos.py`: outputs, overrides and motor test.
- `own_parameters.py`: parameters. `files.py`: MAVFTP. `scripting.py`: Lua.
- `udp_endpoints.py`: sockets in real time.
- `inprocess_session.py`, `companion_harness.py`: flights in simulated time, with a plain companion and with the shipped
  one.
"""
