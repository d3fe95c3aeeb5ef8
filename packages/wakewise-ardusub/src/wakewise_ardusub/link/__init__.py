"""ArduSub vehicles: their eight motors driven one by one, beside the ground station that the pilot already uses.

Start reading in `protocol.py`, which is what companion and script agree on; `script/wakewise.lua` runs on the
autopilot, `upload.py` puts it there. `connection.py` opens MAVLink (`mavlink_relay.py` for several programs),
`parameters.py` reads what the autopilot is set to, `motor_interface.py` turns thrusts into motor commands,
`parameters.py` is what the autopilot does at a button of the sticks. Before anything is driven: `vehicle_survey.py`
gathers facts, `checks.py` judges them (`checks.py` motor by motor), `motor_test.py` has somebody look at each motor
(`checks.py`).
"""
