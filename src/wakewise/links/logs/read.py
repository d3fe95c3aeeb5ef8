"""Any log of an ArduSub vehicle: told apart by its bytes, not by its name."""

from __future__ import annotations

import mmap
from pathlib import Path

from wakewise.errors import InputError
from wakewise.extras import need
from wakewise.links.logs.gather import VehicleLog

FORMATS = "a telemetry log (.tlog), the autopilot's own (.BIN) or BlueOS's recording (.mcap)"


def read_log(path: Path) -> VehicleLog:
    """Read a .tlog, .BIN or .mcap file, however damaged.

    Raises
    ------
    InputError
        If the file cannot be read, is none of these, or nothing of a vehicle is in it.
    MissingExtra
        If the extra `links` is not installed.
    """
    need("wakewise link log", "links", only=("pymavlink", "mcap"))
    from wakewise.links.logs.dataflash import HEAD, read_dataflash
    from wakewise.links.logs.mcap_file import MAGIC, read_mcap
    from wakewise.links.logs.tlog import holds_packets, read_tlog

    try:
        with path.open("rb") as file:
            if path.stat().st_size == 0:
                raise InputError(f"{path}: empty, expected {FORMATS}")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                if data[: len(MAGIC)] == MAGIC:
                    kind, gather = "mcap", read_mcap(data)
                elif data[:3] == HEAD + b"\x80" or (path.suffix.lower() == ".bin" and data.find(HEAD) >= 0):
                    kind, gather = "dataflash", read_dataflash(data)
                elif holds_packets(data):
                    kind, gather = "tlog", read_tlog(data)
                else:
                    raise InputError(f"{path}: not one record found, expected {FORMATS}")
    except (OSError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read, {getattr(fault, 'strerror', None) or fault}") from None
    log = gather.done(path, kind)
    if not log.series:
        raise InputError(
            f"{path}: {log.records} records and {log.bad_records} bad ones, none of which says sticks, servo outputs, "
            "depth or attitude of a vehicle"
        )
    return log
