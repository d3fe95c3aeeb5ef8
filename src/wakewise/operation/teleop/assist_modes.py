"""What assists wish of a body: the camera on the target, and the ways of sticks in the level frame or on a sphere."""

from __future__ import annotations

import math

import numpy as np

from wakewise.control.intent import HIGHEST_RAD
from wakewise.core.arrays import Array
from wakewise.core.geometry import (
    euler_from_quat,
    matrix_from_quat,
    quat_conjugate,
    quat_from_euler,
    quat_from_matrix,
    quat_multiply,
)
from wakewise.operation.teleop.motion import STEEPEST_RAD, AttitudeReference
from wakewise.scene.missions import CameraAim
from wakewise.scene.missions.orbit import R_FC

_Q_FC = quat_from_matrix(R_FC)
OVER_M = 0.15
"""Nearer to the vertical through the target than this, no heading is better than another: it stays as it is."""
_ROUNDS = 3


def camera_on_target(
    place_W_m: Array, velocity_W_m_s: Array, yaw_rad: float, target_W_m: Array, aim: CameraAim, dt_s: float
) -> AttitudeReference:
    """Attitude and tilt with which a body at a place keeps its camera on a target: tilt first, pitch beyond its stops.

    Parameters
    ----------
    place_W_m, velocity_W_m_s, target_W_m : ndarray, shape (3,)
    yaw_rad : float
        Heading now, which stays right over the target, where none is better.
    aim : CameraAim
    dt_s : float
        Over which the rates are taken.
    """
    angles, tilt = _watching(place_W_m, yaw_rad, target_W_m, aim)
    if not velocity_W_m_s.any():
        return AttitudeReference(angles_rad=angles, rates_rad_s=np.zeros(3), tilt_rad=tilt)
    before, tilt_before = _watching(place_W_m - dt_s * velocity_W_m_s, yaw_rad, target_W_m, aim)
    rates = (np.remainder(angles - before + math.pi, 2.0 * math.pi) - math.pi) / dt_s
    return AttitudeReference(
        angles_rad=angles, rates_rad_s=rates, tilt_rad=tilt, tilt_rad_s=(tilt - tilt_before) / dt_s
    )


def _watching(place_W_m: Array, yaw_rad: float, target_W_m: Array, aim: CameraAim) -> tuple[Array, float]:
    away = target_W_m - place_W_m
    over = math.hypot(away[0], away[1]) < OVER_M
    bearing = yaw_rad if over else math.atan2(away[1], away[0])
    angles, tilt = np.array([0.0, 0.0, bearing]), 0.0
    # The eye moves with the body that turns it: the lever is shorter than the sight, so a few rounds suffice.
    for _ in range(_ROUNDS):
        R_WB = matrix_from_quat(quat_from_euler(*angles))
        sight = away - R_WB @ aim.mount(tilt).p_m
        level = math.hypot(sight[0], sight[1])
        heading = bearing if over else math.atan2(sight[1], sight[0])
        pitch = min(max(math.atan2(-sight[2], level), -HIGHEST_RAD), HIGHEST_RAD)
        tilt, _ = aim.tilt(pitch)
        q_WC = quat_multiply(quat_from_euler(0.0, pitch, heading), _Q_FC)
        angles = euler_from_quat(quat_multiply(q_WC, quat_conjugate(aim.mount(tilt).q)))
        angles[1] = min(max(angles[1], -STEEPEST_RAD), STEEPEST_RAD)
    return angles, tilt


def level_frame(yaw_rad: float) -> Array:
    """Forward, right and down of the body's level frame in W, the columns of shape (3, 3)."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def sphere_frame(eye_W_m: Array, centre_W_m: Array) -> Array:
    """Towards the centre of a sphere, right and down along it, in W, the columns of shape (3, 3)."""
    away = centre_W_m - eye_W_m
    ahead = away / max(float(np.linalg.norm(away)), 1e-6)
    azimuth = math.atan2(ahead[1], ahead[0])
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    return np.stack([ahead, right, np.cross(ahead, right)], axis=1)


def elevation_rad(eye_W_m: Array, centre_W_m: Array) -> float:
    """Elevation of an eye above the horizon of a centre, shape (3,) each."""
    away = eye_W_m - centre_W_m
    return math.atan2(-float(away[2]), math.hypot(away[0], away[1]))
