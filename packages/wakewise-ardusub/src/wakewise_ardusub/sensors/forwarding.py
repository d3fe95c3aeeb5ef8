"""Poses handed on as MAVLink's VISION_POSITION_ESTIMATE, to an autopilot, a ground station or `wakewise link ardusub`.

Fields and the layout of the covariance are those of MAVLink's common set
(https://mavlink.io/en/messages/common.html#VISION_POSITION_ESTIMATE): NED and FRD, the upper triangle of a 6 x 6 matrix
by rows, its first number NaN where it is not known. Who reads the message is `wakewise_ardusub.link.telemetry_adapter`.
"""

from __future__ import annotations

import math
import socket
from typing import Any

import numpy as np

from wakewise.core.errors import EnvironmentFailure
from wakewise.core.geometry import euler_from_quat
from wakewise.core.interfaces import Measurement
from wakewise.core.optional_dependencies import need
from wakewise_ardusub.link.protocol import DEFAULT_SYSTEM
from wakewise_ardusub.sensors.devices import read_place
from wakewise_ardusub.sensors.samples import PoseSample

COMPONENT = 197
"""MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY: a part of the vehicle beside its companion, which is 191."""
_UPPER = np.triu_indices(6)


def vision_position_estimate(sample: PoseSample) -> dict[str, Any] | None:
    """Fields of the message that says a pose; None for a position alone, which the message cannot say."""
    pose = sample.measurement.X_WB
    if pose is None:
        return None
    roll, pitch, yaw = (float(angle) for angle in euler_from_quat(pose.q))
    covariance = [math.nan] + [0.0] * 20
    if sample.covariance is not None:
        covariance = [float(x) for x in sample.covariance[_UPPER]]
    x, y, z = (float(c) for c in pose.p_m)
    return {
        "usec": max(round(1e6 * sample.measurement.time_s), 0),
        **{"x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw},
        "covariance": covariance,
        "reset_counter": 0,
    }


class PoseForwarder:
    """Sends poses to a place, `HOST:PORT`, over UDP, as a part of the vehicle of id `system`.

    Raises
    ------
    InputError, EnvironmentFailure
        If the place is none, or its name leads nowhere.
    MissingExtra
        If pymavlink is not installed.
    """

    def __init__(self, place: str, system: int = DEFAULT_SYSTEM) -> None:
        need("wakewise link sensors --forward", "links", only=("pymavlink",))
        from pymavlink.dialects.v20 import common

        host, port = read_place(place, "--forward")
        try:
            self._to = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)[0][4]
        except OSError as fault:
            raise EnvironmentFailure(f"--forward {place}: {fault.strerror or fault}") from None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._link = common.MAVLink(None, srcSystem=system, srcComponent=COMPONENT)
        self._message = common.MAVLink_vision_position_estimate_message
        self.sent = 0
        self.lost = 0
        """Poses that did not leave this computer, and positions alone."""

    def __call__(self, sample: Measurement | PoseSample) -> None:
        """Send a pose; what is none is let be."""
        if not isinstance(sample, PoseSample):
            return
        fields = vision_position_estimate(sample)
        try:
            if fields is None:
                raise OSError
            message = self._message(**fields).pack(self._link)
            self._link.seq = (self._link.seq + 1) % 256
            self._socket.sendto(message, self._to)
        except OSError:
            self.lost += 1
            return
        self.sent += 1

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()
