"""ArduPilot's JSON physics link: a vehicle of Wakewise in its water behind the real firmware, or behind the stand-in.

Start reading in `physics.py` (a frame of pulses is answered by motion). `datagrams.py` is what is on the wire,
`physics.py` which frames are new, `physics.py` what a pulse gives, `surface.py` a body for quick tests, `surface.py`
and `surface.py` where the water ends and how a vehicle comes under it, `depth_monitor.py` whether the autopilot
knows its depth, `physics.py` the socket. A tank is put behind it in `wakewise_ardusub.sitl_plant`.
"""

from wakewise_ardusub.physics.datagrams import (
    PhysicsState,
    ServoFrame,
    read_reply,
    read_request,
    write_reply,
    write_request,
)
from wakewise_ardusub.physics.physics import PhysicsFigures, PhysicsServer, PulseTable, SimulatedBody
from wakewise_ardusub.physics.surface import FreeWater

__all__ = [
    "FreeWater",
    "PhysicsFigures",
    "PhysicsServer",
    "PhysicsState",
    "PulseTable",
    "ServoFrame",
    "SimulatedBody",
    "read_reply",
    "read_request",
    "write_reply",
    "write_request",
]
