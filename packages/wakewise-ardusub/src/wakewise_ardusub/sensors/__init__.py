"""Sensors of a companion computer and poses from other programs: bytes in, `Measurement`s out.

- `ms5837.py`: pressure sensor of Bar30 and Bar02. `jy901.py`: WitMotion's inertial unit.
- `line_poses.py`: poses as lines of text, and forwarding of poses as MAVLink.
- `devices.py`: I2C bus, serial port and UDP socket. `sensor_polling.py`: polling of all, rates and errors.

Poses that come as MAVLink are read by `wakewise_ardusub.link.telemetry_adapter`.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise_ardusub.sensors.devices import I2CBus, SerialPort, UdpSocket
    from wakewise_ardusub.sensors.jy901 import FrameReader, InertialUnit, mounting
    from wakewise_ardusub.sensors.line_poses import (
        LinePoses,
        PoseForwarder,
        PoseSample,
        read_line,
        vision_position_estimate,
    )
    from wakewise_ardusub.sensors.ms5837 import I2C, DepthSensor

__all__ = [
    "I2C",
    "DepthSensor",
    "FrameReader",
    "I2CBus",
    "InertialUnit",
    "LinePoses",
    "PoseForwarder",
    "PoseSample",
    "SerialPort",
    "UdpSocket",
    "mounting",
    "read_line",
    "vision_position_estimate",
]

lazy_attributes(__name__)
