"""Sensors that a companion computer reads, and poses that others send it: bytes in, `Measurement` out.

Start reading in `line_poses.py` (what comes out). `ms5837.py` is the pressure sensor of Bar30 and Bar02, `jy901.py`
WitMotion's inertial unit, `line_poses.py` the plain protocol by which any program sends poses; MAVLink's own are read
by `wakewise_ardusub.link.telemetry_adapter`. `devices.py` is the serial port, the I2C bus and the socket themselves,
`sensor_polling.py` reads them all and says what each says, `line_poses.py` hands poses on as MAVLink.
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
