"""MAVLink link to an ArduSub vehicle whose motors are driven one by one, beside the pilot's ground station.

- `protocol.py`: message ids, names, times and bounds that companion and script share; read this first.
- `script/`: `wakewise.lua` on the autopilot, and its parameters. `upload.py`: MAVFTP upload of the script.
- `connection.py`: `--connection` strings and pymavlink's connection. `transports.py`: UDP, TCP and serial bytes.
- `mavlink_relay.py`: relay between ground station and vehicle, and a router for several programs.
- `parameters.py`: read, set and parse parameters; functions of the sticks' buttons.
- `motor_interface.py`: thrusts to actuator values, servo outputs to thrusts.
- `message_state.py`: vehicle state from messages. `telemetry_adapter.py`: messages to `Measurement`s.
- `tracking_commands.py`: a target designated in the picture: commands of the camera protocol and their answers.
- `engagement_fsm.py`: state machine that permits thrusts. `output_gate.py`: sends thrusts while it permits them.
- `vehicle_survey.py`: facts for `checks.py` (go or no-go). `motor_test.py`: test of each motor by an operator.
- `session_log.py`: journal of a session.
"""
