"""Telemetry logs of ground stations: each record is eight bytes of time and one MAVLink packet.

A record counts as bad if the checksum of its packet is wrong and the next record follows where it should, which is what
pymavlink counts as BAD_DATA; a stretch of bytes in which no record is found counts as one more. After damage the reader
goes on at the next packet whose checksum is right.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from wakewise_ardusub.logs.channels import LogCollector
from wakewise_ardusub.logs.mavlink import WANTED, record_message

Buffer = Any
"""Bytes, or a file mapped into memory."""
_STAMP = struct.Struct(">Q")
_MARK_1, _MARK_2, _SIGNED = 0xFE, 0xFD, 0x01
# Times before the year 4253 have a first byte of 0.
_LIKELY = re.compile(rb"(?=\x00.{7}[\xfd\xfe])", re.DOTALL)


@dataclass(frozen=True)
class TlogPacket:
    """Where a packet lies and what its head says; `end` is where the next record begins."""

    stamp_s: float
    start: int
    end: int
    number: int
    system: int
    component: int


def packet_at(data: Buffer, at: int) -> TlogPacket | None:
    """The record at an offset by its head alone; None where there is none or the file ends within it."""
    start, size = at + 8, len(data)
    if start + 8 > size or data[at] != 0:
        return None
    mark, length = data[start], data[start + 1]
    if mark == _MARK_2:
        if start + 12 > size:
            return None
        end = start + 12 + length + (13 if data[start + 2] & _SIGNED else 0)
        number = data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16
        system, component = data[start + 5], data[start + 6]
    elif mark == _MARK_1:
        end, number, system, component = start + 8 + length, data[start + 5], data[start + 3], data[start + 4]
    else:
        return None
    if end > size:
        return None
    stamp_s = 1e-6 * _STAMP.unpack(data[at:start])[0]
    return TlogPacket(stamp_s=stamp_s, start=start, end=end, number=number, system=system, component=component)


def read_tlog(data: Buffer) -> LogCollector:
    """Read all records of a telemetry log, damaged or not."""
    from pymavlink.dialects.v20 import ardupilotmega

    known = ardupilotmega.mavlink_map
    decoder = ardupilotmega.MAVLink(None)
    gather = LogCollector()
    for packet, size in _records(data, gather, ardupilotmega):
        if packet is None:
            gather.spoiled("no record", size)
            continue
        message = known.get(packet.number)
        if message is None:
            # Another dialect's: whole as far as can be told.
            gather.records += 1
            continue
        if not _is_whole(data, packet, ardupilotmega):
            gather.spoiled("checksum", size)
            continue
        gather.records += 1
        fields: dict[str, Any] = {}
        if message.msgname in WANTED:
            try:
                fields = decoder.decode(bytearray(data[packet.start : packet.end])).to_dict()
            except Exception:  # pymavlink raises what the fields made it raise
                gather.spoiled("fields", size)
                continue
        try:
            record_message(gather, packet.stamp_s, packet.system, packet.component, message.msgname, fields)
        except (KeyError, TypeError, ValueError):
            gather.spoiled("fields", size)
    return gather


def holds_packets(data: Buffer) -> bool:
    """Whether a first whole packet lies in the file."""
    from pymavlink.dialects.v20 import ardupilotmega

    return _next(data, 0, ardupilotmega) is not None


def _records(data: Buffer, gather: LogCollector, dialect: Any) -> Iterator[tuple[TlogPacket | None, int]]:
    """Records in their order with their sizes; None is a stretch that is none."""
    at, size = 0, len(data)
    while at < size:
        packet = packet_at(data, at)
        if packet is not None and (_follows(data, packet.end) or _is_whole(data, packet, dialect)):
            yield packet, packet.end - at
            at = packet.end
            continue
        after = _next(data, at + 1, dialect)
        if after is None and _is_head(data, at) and _promises_more(data, at):
            gather.cut_short = True
            return
        yield None, (size if after is None else after) - at
        at = size if after is None else after


def _follows(data: Buffer, at: int) -> bool:
    """Whether a record, or the end of the file, is at an offset."""
    return at == len(data) or _is_head(data, at)


def _is_head(data: Buffer, at: int) -> bool:
    """Whether bytes look like the begin of a record, as far as the file goes."""
    return at < len(data) and data[at] == 0 and (at + 8 >= len(data) or data[at + 8] in (_MARK_1, _MARK_2))


def _next(data: Buffer, at: int, dialect: Any) -> int | None:
    """Offset of the next record whose packet is known and whole."""
    while (found := _LIKELY.search(data, at)) is not None:
        packet = packet_at(data, found.start())
        if packet is not None and packet.number in dialect.mavlink_map and _is_whole(data, packet, dialect):
            return found.start()
        at = found.start() + 1
    return None


def _is_whole(data: Buffer, packet: TlogPacket, dialect: Any) -> bool:
    """Whether a packet's checksum is right; that of an unknown message cannot be told and counts as wrong."""
    message = dialect.mavlink_map.get(packet.number)
    if message is None:
        return False
    start = packet.start
    head = 10 if data[start] == _MARK_2 else 6
    end = start + head + data[start + 1]
    crc = dialect.x25crc(bytes(data[start + 1 : end]))
    crc.accumulate(bytes([message.crc_extra]))
    return bool(crc.crc == data[end] | data[end + 1] << 8)


def _promises_more(data: Buffer, at: int) -> bool:
    """Whether the record that begins at an offset goes on behind the end of the file."""
    start = at + 8
    if start + 2 > len(data):
        return True
    return bool(start + (12 if data[start] == _MARK_2 else 8) + data[start + 1] > len(data))
