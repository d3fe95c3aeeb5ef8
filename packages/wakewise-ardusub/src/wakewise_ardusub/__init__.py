"""ArduSub vehicles for Wakewise: MAVLink link, wash meter, vehicle sessions, logs, SITL physics, sensors and ROS 2.

- `link/`: MAVLink connection, parameters, checks before a flight, the state machine and the gate of the thrusts, and
  the Lua script that runs on the autopilot.
- `session/`: a flight of a real vehicle beside its pilot.
- `wash_meter/`: live wash of the thrusters on the target. It commands nothing.
- `logs/`, `reports/`: readers of .tlog, .BIN and .mcap, and the page of a log.
- `physics/`, `sitl_plant.py`: the simulated vehicle behind ArduSub's firmware (ArduPilot's JSON interface).
- `sitl/`: a simulated autopilot in Python, for tests and trials without firmware.
- `sensors/`: pressure sensor, inertial unit and pose messages of a companion computer.
- `ros/`: the computation of the ROS 2 node in `ros2/wakewise_ros`.
- `cli/`: the commands `wakewise link ...`.
- `motors.py`: motor channels, directions and pulses. `wash_savings.py`: wash of flown and of gentler thrusts.
  `vehicle_summary.py`: a vehicle as plain numbers (craft file). `optional_dependencies.py`: the extra `links`.

Only this package imports pymavlink.
"""
