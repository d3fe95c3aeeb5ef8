"""MAVFTP server of the simulated autopilot: upload, list, read and remove a script. Files are kept in memory.

Packet layout and numbers: mavlink.io, "MAVLink FTP". A repeated request (same number) gets the same answer again.
"""

from __future__ import annotations

import binascii
import struct
from dataclasses import dataclass, field

PAYLOAD_B = 251
"""Bytes of FILE_TRANSFER_PROTOCOL's payload."""
DATA_B = 239
MOST_B = 4_000_000
"""All files together."""
_HEAD = struct.Struct("<HBBBBBxI")

TERMINATE, RESET, LIST, OPEN_READ, READ, CREATE, WRITE, REMOVE, MAKE_FOLDER, REMOVE_FOLDER, OPEN_WRITE = range(1, 12)
TRUNCATE, RENAME, CRC32, BURST_READ = range(12, 16)
ACK, NAK = 128, 129
_FAIL, _INVALID_SIZE, _INVALID_SESSION, _NO_SESSIONS, _EOF, _UNKNOWN, _EXISTS, _PROTECTED, _NOT_FOUND = (
    1, 3, 4, 5, 6, 7, 8, 9, 10,
)  # fmt: skip


@dataclass
class MavftpServer:
    """Files by name and the one session that is open."""

    content: dict[str, bytearray] = field(default_factory=dict)
    folders: set[str] = field(default_factory=lambda: {"/", "/APM", "/APM/scripts"})
    _open: str | None = None
    _last: tuple[bytes, bytes] | None = None

    def scripts(self) -> dict[str, str]:
        """Lua scripts in APM/scripts by name, as text of one character a byte."""
        found = {}
        for path, data in sorted(self.content.items()):
            folder, _, name = path.rpartition("/")
            if folder == "/APM/scripts" and name.endswith(".lua"):
                found[name] = bytes(data).decode("latin-1")
        return found

    def put(self, path: str, data: bytes) -> None:
        """A file as if it had been uploaded."""
        self.content[_absolute(path)] = bytearray(data)

    def answer(self, payload: bytes) -> bytes:
        """The payload that answers a request's, both `PAYLOAD_B` long."""
        request = payload[:PAYLOAD_B].ljust(PAYLOAD_B, b"\0")
        if self._last is not None and self._last[0] == request:
            return self._last[1]
        number, session, opcode, size, _, _, offset = _HEAD.unpack_from(request)
        data = request[_HEAD.size : _HEAD.size + min(size, DATA_B)]
        code, said = self._do(opcode, data, size, offset)
        # A burst is cut to its first part; the client asks for the rest itself.
        done = 1 if opcode == BURST_READ and code == ACK else 0
        head = _HEAD.pack((number + 1) & 0xFFFF, session, code, len(said), opcode, done, offset)
        reply = (head + said).ljust(PAYLOAD_B, b"\0")
        self._last = (request, reply)
        return reply

    def _do(self, opcode: int, data: bytes, size: int, offset: int) -> tuple[int, bytes]:
        if opcode in (TERMINATE, RESET):
            self._open = None
            return ACK, b""
        if opcode in (WRITE, READ, BURST_READ):
            return self._transfer(opcode, data, size, offset)
        path = _absolute(data.split(b"\0")[0].decode("latin-1"))
        if opcode == LIST:
            return self._list(path, offset)
        if opcode in (OPEN_READ, OPEN_WRITE, CREATE):
            return self._begin(opcode, path)
        if opcode == CRC32:
            if path not in self.content:
                return NAK, bytes([_NOT_FOUND])
            # The firmware's sum starts from 0 and is not turned over at the end.
            crc = binascii.crc32(self.content[path], 0xFFFFFFFF) ^ 0xFFFFFFFF
            return ACK, struct.pack("<I", crc)
        if opcode == REMOVE:
            return (ACK, b"") if self.content.pop(path, None) is not None else (NAK, bytes([_NOT_FOUND]))
        if opcode == MAKE_FOLDER:
            if path in self.folders:
                return NAK, bytes([_EXISTS])
            self.folders.add(path)
            return ACK, b""
        return NAK, bytes([_UNKNOWN])

    def _begin(self, opcode: int, path: str) -> tuple[int, bytes]:
        if self._open is not None:
            return NAK, bytes([_NO_SESSIONS])
        if opcode == CREATE:
            if path.rpartition("/")[0] not in self.folders:
                return NAK, bytes([_NOT_FOUND])
            self.content[path] = bytearray()
        elif path not in self.content:
            return NAK, bytes([_NOT_FOUND])
        self._open = path
        return ACK, struct.pack("<I", len(self.content[path]))

    def _transfer(self, opcode: int, data: bytes, size: int, offset: int) -> tuple[int, bytes]:
        if self._open is None or self._open not in self.content:
            return NAK, bytes([_INVALID_SESSION])
        content = self.content[self._open]
        if opcode == WRITE:
            if size > DATA_B:
                return NAK, bytes([_INVALID_SIZE])
            if offset + len(data) > MOST_B - sum(len(held) for held in self.content.values()):
                return NAK, bytes([_FAIL])
            if offset > len(content):
                content.extend(bytes(offset - len(content)))
            content[offset : offset + len(data)] = data
            return ACK, b""
        if offset >= len(content):
            return NAK, bytes([_EOF])
        return ACK, bytes(content[offset : offset + min(size or DATA_B, DATA_B)])

    def _list(self, folder: str, offset: int) -> tuple[int, bytes]:
        if folder not in self.folders:
            return NAK, bytes([_NOT_FOUND])
        base = folder.rstrip("/") + "/"
        entries = [f"D{name[len(base) :]}" for name in self.folders if _inside(name, base)]
        entries += [f"F{path[len(base) :]}\t{len(data)}" for path, data in self.content.items() if _inside(path, base)]
        said = b""
        for entry in sorted(entries)[offset:]:
            line = entry.encode("latin-1", "replace") + b"\0"
            if len(said) + len(line) > DATA_B:
                break
            said += line
        return (ACK, said) if said else (NAK, bytes([_EOF]))


def _inside(path: str, base: str) -> bool:
    return path.startswith(base) and path != base and "/" not in path[len(base) :]


def _absolute(path: str) -> str:
    return "/" + "/".join(part for part in path.split("/") if part and part != ".")
