"""The mixer: demands to one pulse per motor, by the factors of ArduSub's vectored frames.

Roll, pitch and throttle are summed and divided by the largest sum where that is above 1; yaw, forward and lateral
likewise; both are added and cut at 1 (see `wakewise.control.motor_mix`, which tells the sources). MOT_n_DIRECTION turns
a motor's pulse about the middle.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.vehicles.mixing import ARDUSUB_VECTORED, ARDUSUB_VECTORED_6DOF
from wakewise_ardusub.link.protocol import FULL_US, MIDDLE_US
from wakewise_ardusub.sitl.own_parameters import FRAME_VECTORED
from wakewise_ardusub.sitl.parameters import ParameterTable
from wakewise_ardusub.sitl.sticks import PilotDemands


def factors_of(parameters: ParameterTable) -> Array:
    """Motor factors of the frame, shape (n, 6): roll, pitch, yaw, throttle, forward, lateral."""
    frame = parameters.value("FRAME_CONFIG", otherwise=FRAME_VECTORED)
    return ARDUSUB_VECTORED if frame == FRAME_VECTORED else ARDUSUB_VECTORED_6DOF


def directions_of(parameters: ParameterTable, motors: int) -> Array:
    """MOT_n_DIRECTION of each motor, shape (n,): 1 or -1."""
    said = [parameters.value(f"MOT_{i + 1}_DIRECTION", otherwise=1.0) for i in range(motors)]
    return np.where(np.array(said) < 0.0, -1.0, 1.0)


def motor_pulses_us(demands: PilotDemands, factors: Array, directions: Array) -> list[int]:
    """Pulse of each motor, shape (n,), for demands."""
    asked = np.array(
        [demands.roll, demands.pitch, demands.yaw, demands.throttle, demands.forward, demands.lateral], dtype=np.float64
    )
    groups = [factors[:, own] @ asked[own] for own in ([0, 1, 3], [2, 4, 5])]
    mixed = sum(group / max(1.0, float(np.abs(group).max())) for group in groups)
    outputs = directions * np.clip(mixed, -1.0, 1.0)
    return [int(pulse) for pulse in np.round(MIDDLE_US + FULL_US * outputs)]
