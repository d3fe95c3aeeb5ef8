"""Where MAVLink packets lie in a datagram, whatever else is in it: a packet counts only if its checksum is right."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

_MARK_1, _MARK_2, _SIGNED = 0xFE, 0xFD, 0x01
_HEAD_1, _HEAD_2, _CHECKSUM, _SIGNATURE = 6, 10, 2, 13


@dataclass(frozen=True)
class MavlinkPacket:
    """A packet of a datagram: where it begins and ends, where its payload begins, and its message's number."""

    start: int
    end: int
    payload: int
    number: int


@cache
def dialect() -> Any:
    """The messages that are known: ArduPilot's."""
    from pymavlink.dialects.v20 import ardupilotmega

    return ardupilotmega


def packets(data: bytes) -> Iterator[MavlinkPacket | tuple[int, int]]:
    """Packets in their order, and between them the stretches of bytes that are none, as (start, end).

    Of a message that is unknown the checksum cannot be told, so it counts as a stretch that is none.
    """
    at = noise = 0
    while (at := _next_mark(data, at)) < len(data):
        packet = packet_at(data, at)
        if packet is None:
            at += 1
            continue
        if noise < at:
            yield noise, at
        yield packet
        at = noise = packet.end
    if noise < len(data):
        yield noise, len(data)


def packet_at(data: bytes, at: int) -> MavlinkPacket | None:
    """The whole packet at an offset; None where there is none."""
    size, mark = len(data), data[at]
    if mark == _MARK_2 and at + _HEAD_2 + _CHECKSUM <= size:
        payload, number = at + _HEAD_2, int.from_bytes(data[at + 7 : at + 10], "little")
        signature = _SIGNATURE if data[at + 2] & _SIGNED else 0
    elif mark == _MARK_1 and at + _HEAD_1 + _CHECKSUM <= size:
        payload, number, signature = at + _HEAD_1, data[at + 5], 0
    else:
        return None
    last = payload + data[at + 1]
    end = last + _CHECKSUM + signature
    message = dialect().mavlink_map.get(number)
    if end > size or message is None:
        return None
    told = int.from_bytes(data[last : last + _CHECKSUM], "little")
    return MavlinkPacket(at, end, payload, number) if checksum(data[at + 1 : last], message.crc_extra) == told else None


def partial_packet_start(data: bytes) -> int:
    """Where a packet begins whose end has not come yet, by what its head promises; the end where there is none."""
    at = 0
    for part in packets(data):
        if isinstance(part, MavlinkPacket):
            at = part.end
    while (at := _next_mark(data, at)) < len(data):
        if len(data) - at < _HEAD_2 or at + _HEAD_2 + data[at + 1] + _CHECKSUM + _SIGNATURE > len(data):
            return at
        at += 1
    return len(data)


def is_signed(data: bytes, packet: MavlinkPacket) -> bool:
    """Whether a packet bears a signature, so that nobody may change it."""
    return data[packet.start] == _MARK_2 and bool(data[packet.start + 2] & _SIGNED)


def checksum(data: bytes, extra: int) -> int:
    """CRC-16/MCRF4XX of a packet from its length on, with the extra byte of its message."""
    crc = dialect().x25crc(data)
    crc.accumulate(bytes([extra]))
    return int(crc.crc)


def _next_mark(data: bytes, at: int) -> int:
    """Offset of the next byte that may begin a packet; the end where there is none."""
    found = [place for mark in (_MARK_1, _MARK_2) if (place := data.find(mark, at)) >= 0]
    return min(found, default=len(data))
