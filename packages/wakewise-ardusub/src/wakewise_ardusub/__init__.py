"""Links: from the tank to the programs and vehicles that people have; the only room that knows pymavlink.

`exports/` writes what a flight was into files that other tools open, `logs/` reads what real vehicles recorded,
`ardusub/` drives one (the room `meter` only watches); `motors.py` is what they know of an autopilot's motors.
`sparing.py` judges pulses for logs and meter, with what `craft.py` knows of a vehicle. `physics/` moves a vehicle
behind an autopilot's firmware, `autopilot/` stands in for the firmware where there is none. `ros/` is what a ROS 2 node
does, `sensors/` what a companion computer reads. Plain arrays and paths come in; who reads a trial's folder is
`trials`.
"""
