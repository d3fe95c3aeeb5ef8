"""Simulated vehicle behind ArduSub's firmware or the simulated autopilot, over ArduPilot's JSON interface.

- `physics.py`: servo pulses in, motion out; frames, thrust table and socket. Read this first.
- `datagrams.py`: the wire format.
- `surface.py`: the water's surface, a body for quick tests, and lowering the vehicle at the start.

`wakewise_ardusub.sitl_plant` puts a tank behind it.
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
