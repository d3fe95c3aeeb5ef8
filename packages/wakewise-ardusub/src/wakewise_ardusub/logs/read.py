"""Reads any log of an ArduSub vehicle. The format is found by the bytes, and other vehicles are refused by name."""

from __future__ import annotations

import mmap
from dataclasses import replace
from pathlib import Path

import numpy as np

from wakewise.core.errors import InputError
from wakewise_ardusub.logs.channels import VehicleLog
from wakewise_ardusub.optional_dependencies import need

FORMATS = "a telemetry log (.tlog), the autopilot's own (.BIN) or BlueOS's recording (.mcap)"
_FOREIGN = {
    b"SQLite format 3\0": "an SQLite file, as a ROS 2 bag's .db3 is",
    b"#ROSBAG": "a ROS 1 bag",
    b"ULog\x01\x12\x35": "a log of PX4 (ULog)",
    b"\x28\xb5\x2f\xfd": "compressed by zstd; unpack it first",
    b"\x1f\x8b": "compressed by gzip; unpack it first",
    b"PK\x03\x04": "a zip archive; unpack it first",
}
"""First bytes of files that people have beside logs, and what they are."""
ABOVE_WATER_M = 2.0
"""Farther above the surface than an ArduSub's depth can read, which goes by the pressure of water."""
_SHARE_ABOVE_PCT = 5.0
_OF_WATER = ("depth VFR_HUD", "depth CTUN", "depth BARO")
_ARDUSUBS_ALONE = ("sticks", "pressure 1", "pressure 2", "pressure 3")


def read_log(path: Path, *, any_vehicle: bool = False) -> VehicleLog:
    """Read a .tlog, .BIN or .mcap file of an ArduSub, however damaged.

    Parameters
    ----------
    path : Path
    any_vehicle : bool
        Read another vehicle's log, too: without sticks and water pressure, whose meaning is ArduSub's; a height is a
        depth below 0.

    Raises
    ------
    InputError
        If the file cannot be read, is none of these, nothing of a vehicle is in it, or the vehicle is another.
    MissingExtra
        If the extra `links` is not installed.
    """
    need("wakewise link log", "links", only=("pymavlink", "mcap"))
    from wakewise_ardusub.logs.dataflash import HEAD, read_dataflash
    from wakewise_ardusub.logs.mavlink import MAGIC, holds_packets, is_ros_bag, read_mcap, read_tlog

    if path.is_dir():
        raise InputError(f"{path}: {_folder(path)}, expected {FORMATS}")
    try:
        with path.open("rb") as file:
            if path.stat().st_size == 0:
                raise InputError(f"{path}: empty, expected {FORMATS}")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                foreign = next((words for begin, words in _FOREIGN.items() if data[: len(begin)] == begin), None)
                if foreign is not None:
                    raise InputError(f"{path}: {foreign}; expected {FORMATS}")
                if data[: len(MAGIC)] == MAGIC:
                    kind, collector = "mcap", read_mcap(data)
                    if is_ros_bag(data) and not any(
                        system_records.rows for system_records in collector.systems.values()
                    ):
                        raise InputError(f"{path}: a ROS bag (MCAP), not a recording of BlueOS; expected {FORMATS}")
                elif data[:3] == HEAD + b"\x80" or (path.suffix.lower() == ".bin" and data.find(HEAD) >= 0):
                    kind, collector = "dataflash", read_dataflash(data)
                elif holds_packets(data):
                    kind, collector = "tlog", read_tlog(data)
                elif _is_ground_station_table(bytes(data[:4096])):
                    raise InputError(
                        f"{path}: QGroundControl's telemetry table (CSV), which holds no motor outputs; the .tlog of "
                        "the same dive, in QGroundControl's folder Telemetry, or the autopilot's .BIN has them"
                    )
                else:
                    raise InputError(f"{path}: not one record found, expected {FORMATS}")
    except (OSError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read, {getattr(fault, 'strerror', None) or fault}") from None
    log = collector.done(path, kind)
    if not log.series:
        raise InputError(
            f"{path}: {log.records} records and {log.bad_records} bad ones, none of which says sticks, servo outputs, "
            "depth or attitude of a vehicle"
        )
    if any_vehicle:
        return log if not log.identity.is_other else _generic(log)
    _require_ardusub(log)
    return log


def _is_ground_station_table(begin: bytes) -> bool:
    """Whether a file begins with the header of QGroundControl's CSV telemetry."""
    header = [name.strip().strip('"') for name in begin.split(b"\n")[0].decode("utf-8-sig", "replace").split(",")]
    return header[0] == "Timestamp" and {"roll", "pitch", "heading"} <= set(header)


def _folder(path: Path) -> str:
    """What a folder is that was given for a file."""
    if (path / "metadata.yaml").is_file() or any(path.glob("*.db3")):
        return "a ROS 2 bag folder"
    named = sorted(file.name for file in path.iterdir() if file.suffix.lower() in (".tlog", ".bin", ".mcap"))
    return "a folder" + (f" (give one of its files, such as {named[0]})" if named else "")


def _require_ardusub(log: VehicleLog) -> None:
    """Refuse what is known to be another vehicle, or what flies where nothing says what it is."""
    way_out = "--any-vehicle reads what needs no table of ArduSub (attitude, height, outputs, voltage)"
    if log.identity.is_other:
        raise InputError(f"{log.path}: a log of another vehicle, {log.identity.words}, not of an ArduSub; {way_out}")
    if log.identity.is_known:
        return
    for name in _OF_WATER:
        known = log.series[name].values if name in log.series else np.zeros(0)
        known = known[np.isfinite(known)]
        highest_m = -float(np.percentile(known, _SHARE_ABOVE_PCT)) if known.size else 0.0
        if highest_m > ABOVE_WATER_M:
            raise InputError(
                f"{log.path}: no heartbeat or firmware says what vehicle this is, and it was {highest_m:.1f} m above "
                f"the water ({name.removeprefix('depth ')}), where no ArduSub is; {way_out}"
            )


def _generic(log: VehicleLog) -> VehicleLog:
    """Without the channels that mean what they say on an ArduSub only."""
    return replace(log, series={name: s for name, s in log.series.items() if name not in _ARDUSUBS_ALONE})
