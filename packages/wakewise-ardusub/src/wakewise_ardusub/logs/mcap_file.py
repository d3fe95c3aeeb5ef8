"""What BlueOS records (MCAP): MAVLink messages as JSON under mavlink/SYSTEM/COMPONENT/NAME.

Topics and payloads as bluerobotics/mavlink-server and blueos-recorder write them: an object with `header` and
`message`, the latter with `type` and fields; enumerations in words. Other topics (video, other sensors) are passed
over. The file is walked record by record, so that a damaged chunk costs its own messages only; a chunk that cannot be
unpacked and a message that is no JSON each count as one bad record.
"""

from __future__ import annotations

import json
import re
import struct
from io import BytesIO
from typing import Any

from wakewise_ardusub.logs.channels import LogCollector
from wakewise_ardusub.logs.mavlink import record_message

MAGIC = b"\x89MCAP0\r\n"
_HEADER, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END, _FOOTER = 0x01, 0x04, 0x05, 0x06, 0x0F, 0x02
_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_TOPIC = re.compile(r"/?mavlink/(\d{1,3})/(\d{1,3})/([A-Z][A-Z0-9_]*)\Z")
_BARE_KEY = re.compile(r"([{,]\s*)([A-Za-z_]\w*)\s*:")
MOST_CHUNK_BYTES = 1 << 28


def read_mcap(data: Any) -> LogCollector:
    """Read the MAVLink messages of an MCAP file, damaged or not."""
    gather = LogCollector()
    _walk(gather, data, len(MAGIC), {}, inside=False)
    return gather


def is_ros_bag(data: Any) -> bool:
    """Whether an MCAP file's header says that its messages are of ROS."""
    start = len(MAGIC) + _HEAD.size
    if len(data) < start + 4 or data[len(MAGIC)] != _HEADER:
        return False
    (length,) = struct.unpack("<I", data[start : start + 4])
    return bytes(data[start + 4 : start + 4 + min(length, 4)]) in (b"ros1", b"ros2")


def _walk(gather: LogCollector, data: Any, at: int, topics: dict[int, tuple[int, int, str]], *, inside: bool) -> None:
    """Go through the records of a file, or of an unpacked chunk."""
    size = len(data)
    while at + _HEAD.size <= size:
        kind, length = _HEAD.unpack(data[at : at + _HEAD.size])
        if kind in (_DATA_END, _FOOTER):
            return
        start, end = at + _HEAD.size, at + _HEAD.size + length
        if end > size:
            break
        at = end
        try:
            if kind == _CHUNK and not inside:
                _walk(gather, _unpacked(data[start:end]), 0, topics, inside=True)
            elif kind == _CHANNEL:
                _channel(bytes(data[start:end]), topics)
            elif kind == _MESSAGE:
                gather.records += _message(gather, bytes(data[start:end]), topics)
        except Exception:  # compressors and readers raise errors of many kinds
            gather.spoiled("chunk" if kind == _CHUNK else "message", length)
    if inside:
        if at != size:
            gather.spoiled("chunk", size - at)
    else:
        gather.cut_short = True


def _unpacked(body: bytes) -> bytes:
    from mcap.data_stream import ReadDataStream
    from mcap.records import Chunk
    from mcap.stream_reader import get_chunk_data_stream

    chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    if chunk.uncompressed_size > MOST_CHUNK_BYTES:
        raise ValueError
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(size)


def _channel(body: bytes, topics: dict[int, tuple[int, int, str]]) -> None:
    from mcap.data_stream import ReadDataStream
    from mcap.records import Channel

    channel = Channel.read(ReadDataStream(BytesIO(body)))
    named = _TOPIC.match(channel.topic)
    if named is not None and channel.message_encoding == "json":
        topics[channel.id] = int(named[1]), int(named[2]), named[3]


def _message(gather: LogCollector, body: bytes, topics: dict[int, tuple[int, int, str]]) -> bool:
    """Keep what a message says; whether it was one of MAVLink."""
    number, _, at_ns, _ = _MESSAGE_HEAD.unpack(body[: _MESSAGE_HEAD.size])
    if number not in topics:
        return False
    system, component, name = topics[number]
    text = body[_MESSAGE_HEAD.size :].decode("utf-8")
    try:
        content = json.loads(text)
    except ValueError:  # JSON5, whose keys need no quotes
        content = json.loads(_BARE_KEY.sub(r'\1"\2":', text))
    record_message(gather, 1e-9 * at_ns, system, component, name, content["message"])
    return True
