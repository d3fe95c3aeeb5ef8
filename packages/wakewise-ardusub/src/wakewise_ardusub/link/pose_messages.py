"""Pose of the body (FRD) in the world (NED) of ODOMETRY and VISION_POSITION_ESTIMATE, in whichever frame they come."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, quat_from_euler, quat_multiply

SENSED_POSES = ("VISION_POSITION_ESTIMATE", "ODOMETRY")
_LOCAL_NED, _LOCAL_ENU, _LOCAL_FRD, _LOCAL_FLU = 1, 4, 20, 21
_BODY_NED, _BODY_FRD, _BODY_FLU = 8, 12, 13
_NED_FROM_ENU = np.array([0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0])
_FRD_FROM_FLU = np.array([0.0, 1.0, 0.0, 0.0])
_FARTHEST = 1e5


def sensed_pose(name: str, fields: Mapping[str, Any]) -> Pose:
    """Body in the world of a message named in `SENSED_POSES`.

    Raises
    ------
    ValueError, KeyError
        If a number is not finite or too large, the frame is none that tells where the body is, or the quaternion is
        no rotation.
    """
    if name == "ODOMETRY":
        return odometry_pose(fields)
    return Pose(finite(fields, "x", "y", "z"), quat_from_euler(*finite(fields, "roll", "pitch", "yaw")))


def odometry_pose(fields: Mapping[str, Any]) -> Pose:
    """Body in the world of an ODOMETRY message, whatever of the usual frames it is said in.

    Raises
    ------
    ValueError, KeyError
        As `sensed_pose`.
    """
    frame, child = int(fields["frame_id"]), int(fields["child_frame_id"])
    place, q = finite(fields, "x", "y", "z"), np.array([float(v) for v in fields["q"]])
    if not abs(float(np.linalg.norm(q)) - 1.0) < 0.01:
        raise ValueError
    q = q / np.linalg.norm(q)
    # A world in FLU is turned to FRD by pi about its x axis, one in ENU by swapping its first two axes.
    into = {_LOCAL_NED: None, _LOCAL_FRD: None, _LOCAL_ENU: _NED_FROM_ENU, _LOCAL_FLU: _FRD_FROM_FLU}[frame]
    body = {_BODY_FRD: None, _BODY_NED: None, _BODY_FLU: _FRD_FROM_FLU}[child]
    if frame == _LOCAL_ENU:
        place = place[[1, 0, 2]] * np.array([1.0, 1.0, -1.0])
    elif frame == _LOCAL_FLU:
        place = place * np.array([1.0, -1.0, -1.0])
    if into is not None:
        q = quat_multiply(into, q)
    if body is not None:
        q = quat_multiply(q, body)
    return Pose(place, q)


def finite(fields: Mapping[str, Any], *names: str) -> Array:
    """Numbers of a message by name, shape (n,).

    Raises
    ------
    ValueError, KeyError
        If one is missing, not finite or larger than 1e5.
    """
    values = np.array([float(fields[name]) for name in names])
    if not np.isfinite(values).all() or np.abs(values).max() > _FARTHEST:
        raise ValueError
    return values
