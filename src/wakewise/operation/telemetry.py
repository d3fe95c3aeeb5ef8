"""Telemetry of a flight as an MCAP file for Foxglove, with the time of the trial."""

from __future__ import annotations

import math
from pathlib import Path

import foxglove
import polars as pl
from foxglove.channels import PoseInFrameChannel
from foxglove.messages import Pose, PoseInFrame, Quaternion, Timestamp, Vector3

from wakewise.core.files import whole_file

_NS = 1_000_000_000


def write_mcap(steps: pl.DataFrame | pl.LazyFrame, path: Path, every: int = 5) -> None:
    """Write poses (`/true/pose`, `/estimated/pose`, `/goal/pose`) and figures (`/thrusts`, `/water`) of a flight.

    `steps` is the table of steps.parquet; one row of `every` is kept: 10 Hz of a 50 Hz loop is what viewers need.
    """
    kept = steps.lazy().gather_every(every).collect()
    thrusts = [name for name in kept.columns if name.startswith("thrust_")]
    water = [name for name in kept.columns if name.startswith(("target_", "bed_", "turbidity_"))]
    context = foxglove.Context()
    with whole_file(path) as temporary, foxglove.open_mcap(temporary, allow_overwrite=True, context=context):
        poses = {
            who: PoseInFrameChannel(f"/{topic}/pose", context=context)
            for who, topic in (("true", "true"), ("est", "estimated"), ("goal", "goal"))
        }
        thrust_channel = foxglove.Channel("/thrusts", schema=_numbers(thrusts), context=context)
        water_channel = foxglove.Channel("/water", schema=_numbers([*water, "disturbance"]), context=context)
        for row in kept.iter_rows(named=True):
            at_ns = round(row["time_s"] * _NS)
            for who, channel in poses.items():
                channel.log(_pose(row, who, at_ns), log_time=at_ns)
            thrust_channel.log({name: row[name] for name in thrusts}, log_time=at_ns)
            water_channel.log({name: _finite(row[name]) for name in [*water, "disturbance"]}, log_time=at_ns)


def _pose(row: dict[str, float], who: str, at_ns: int) -> PoseInFrame:
    return PoseInFrame(
        timestamp=Timestamp(sec=at_ns // _NS, nsec=at_ns % _NS),
        frame_id="world_ned",
        pose=Pose(
            position=Vector3(x=row[f"{who}_x_m"], y=row[f"{who}_y_m"], z=row[f"{who}_z_m"]),
            orientation=Quaternion(w=row[f"{who}_qw"], x=row[f"{who}_qx"], y=row[f"{who}_qy"], z=row[f"{who}_qz"]),
        ),
    )


def _numbers(names: list[str]) -> dict[str, object]:
    return {"type": "object", "properties": {name: {"type": ["number", "null"]} for name in names}}


def _finite(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value
