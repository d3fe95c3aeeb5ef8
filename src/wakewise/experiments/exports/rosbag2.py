"""A flight as a ROS 2 bag (rosbag2, MCAP), written without ROS: ENU/FLU, times on the clock of the flight.

Topics: `/true/pose`, `/estimated/pose` (geometry_msgs/PoseStamped in `map`), `/tf` (`map` to `base_link` as estimated,
`base_link_true`, `camera_optical` and `camera_optical_true`), `/thrusts` (std_msgs/Float64MultiArray, N, forward is
positive), `/wrench` (geometry_msgs/WrenchStamped in `base_link`), `/camera/image/compressed`
(sensor_msgs/CompressedImage, the files as they are) and `/camera/camera_info` (plumb_bob; ROS counts pixel centres from
0, so the principal point lies half a pixel lower than ours). Metadata are of version 8, the older
of the two that rosbags writes.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from wakewise.core.errors import InputError
from wakewise.experiments.exports.records import Photographs, ThrustRecord, Trajectory, flu_of, ros_body, ros_optical

_NS = 1_000_000_000
_BAG_VERSION = 8
_FORMATS = {".jpg": "jpeg", ".jpeg": "jpeg", ".png": "png"}
WHO = {"true": "_true", "estimated": ""}
"""Whose poses there may be, and what is put behind the names of their frames."""

Message = tuple[int, int, str, Any]
"""Time in ns, rank among those of one time, topic, message."""


def write_bag(
    folder: Path,
    bodies: Mapping[str, Trajectory],
    telemetry: ThrustRecord | None = None,
    cameras: Mapping[str, Trajectory] | None = None,
    photographs: Photographs | None = None,
) -> int:
    """Write a bag and return how many messages it holds.

    `folder` must not exist; the file inside is named after it. `bodies` and `cameras` are keyed by `WHO`.

    Raises InputError if a time is negative, which ROS cannot hold, or a photograph is neither JPEG nor PNG.
    """
    store = get_typestore(Stores.ROS2_HUMBLE)
    make = _Messages(store.types)
    streams: list[Iterator[Message]] = [make.poses(who, track) for who, track in bodies.items()]
    streams += [make.cameras(who, track) for who, track in (cameras or {}).items()]
    streams += [] if telemetry is None else [make.telemetry(telemetry)]
    streams += [] if photographs is None else [make.photographs(photographs)]
    written = 0
    with Writer(folder, version=_BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for at_ns, _, topic, message in heapq.merge(*streams, key=lambda row: row[:2]):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], at_ns, store.serialize_cdr(message, kind))
            written += 1
    return written


class _Messages:
    """Makes messages of ROS 2 from our records."""

    def __init__(self, types: Mapping[str, Any]) -> None:
        self._types = types

    def _new(self, kind: str, *fields: Any) -> Any:
        package, name = kind.split("/")
        return self._types[f"{package}/msg/{name}"](*fields)

    def _header(self, at_ns: int, frame: str) -> Any:
        return self._new("std_msgs/Header", self._new("builtin_interfaces/Time", at_ns // _NS, at_ns % _NS), frame)

    def _quaternion(self, q: list[float]) -> Any:
        w, x, y, z = q
        return self._new("geometry_msgs/Quaternion", x, y, z, w)

    def _vector(self, v: list[float]) -> Any:
        return self._new("geometry_msgs/Vector3", *v)

    def _tf(self, at_ns: int, child: str, p: list[float], q: list[float]) -> Any:
        transform = self._new("geometry_msgs/Transform", self._vector(p), self._quaternion(q))
        stamped = self._new("geometry_msgs/TransformStamped", self._header(at_ns, "map"), child, transform)
        return self._new("tf2_msgs/TFMessage", [stamped])

    def poses(self, who: str, track: Trajectory) -> Iterator[Message]:
        """A body's poses and its transform."""
        positions, turns = ros_body(track.p_W_m, track.q)
        for time_s, p, q in zip(track.times_s.tolist(), positions.tolist(), turns.tolist(), strict=True):
            at_ns = _ns(time_s)
            pose = self._new("geometry_msgs/Pose", self._new("geometry_msgs/Point", *p), self._quaternion(q))
            yield at_ns, 0, "/tf", self._tf(at_ns, f"base_link{WHO[who]}", p, q)
            yield at_ns, 1, f"/{who}/pose", self._new("geometry_msgs/PoseStamped", self._header(at_ns, "map"), pose)

    def cameras(self, who: str, track: Trajectory) -> Iterator[Message]:
        """The transforms of a camera."""
        positions, turns = ros_optical(track.p_W_m, track.q)
        for time_s, p, q in zip(track.times_s.tolist(), positions.tolist(), turns.tolist(), strict=True):
            at_ns = _ns(time_s)
            yield at_ns, 2, "/tf", self._tf(at_ns, f"camera_optical{WHO[who]}", p, q)

    def telemetry(self, telemetry: ThrustRecord) -> Iterator[Message]:
        """Thrusts and wrenches."""
        count = telemetry.thrusts_N.shape[1]
        axis = self._new("std_msgs/MultiArrayDimension", "thruster", count, count)
        layout = self._new("std_msgs/MultiArrayLayout", [axis], 0)
        forces, moments = flu_of(telemetry.wrenches_B[:, :3]).tolist(), flu_of(telemetry.wrenches_B[:, 3:]).tolist()
        for time_s, thrusts, force, moment in zip(
            telemetry.times_s.tolist(), telemetry.thrusts_N, forces, moments, strict=True
        ):
            at_ns = _ns(time_s)
            wrench = self._new("geometry_msgs/Wrench", self._vector(force), self._vector(moment))
            yield at_ns, 3, "/thrusts", self._new("std_msgs/Float64MultiArray", layout, np.array(thrusts))
            stamped = self._new("geometry_msgs/WrenchStamped", self._header(at_ns, "base_link"), wrench)
            yield at_ns, 4, "/wrench", stamped

    def photographs(self, photographs: Photographs) -> Iterator[Message]:
        """Photographs, read one at a time, each with the camera's numbers."""
        for time_s, file in zip(photographs.track.times_s.tolist(), photographs.files, strict=True):
            form = _FORMATS.get(file.suffix.lower())
            if form is None:
                raise InputError(f"{file}: a bag holds photographs that are .jpg or .png")
            at_ns, data = _ns(time_s), np.frombuffer(file.read_bytes(), dtype=np.uint8)
            header = self._header(at_ns, "camera_optical")
            yield at_ns, 5, "/camera/camera_info", self._info(header, photographs)
            yield at_ns, 6, "/camera/image/compressed", self._new("sensor_msgs/CompressedImage", header, form, data)

    def _info(self, header: Any, photographs: Photographs) -> Any:
        fx, fy, cx, cy, k1, k2, p1, p2 = photographs.params.tolist()
        cx, cy = cx - 0.5, cy - 0.5
        return self._new(
            "sensor_msgs/CameraInfo",
            header,
            photographs.height,
            photographs.width,
            "plumb_bob",
            np.array([k1, k2, p1, p2, 0.0]),
            np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
            np.eye(3).ravel(),
            np.array([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
            0,
            0,
            self._new("sensor_msgs/RegionOfInterest", 0, 0, 0, 0, False),
        )


def _ns(time_s: float) -> int:
    if time_s < 0.0:
        raise InputError(f"a time of {time_s:g} s: a bag holds none below 0")
    return round(time_s * _NS)
