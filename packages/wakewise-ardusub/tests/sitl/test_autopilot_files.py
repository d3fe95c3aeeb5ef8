"""The stand-in's files over MAVFTP."""

from __future__ import annotations

import binascii
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise_ardusub.sitl import files as ftp
from wakewise_ardusub.sitl.files import PAYLOAD_B, MavftpServer

HEAD = struct.Struct("<HBBBBBxI")
PATH = b"/APM/scripts/own.lua"


class Client:
    """Requests with numbers of their own."""

    def __init__(self, files: MavftpServer) -> None:
        self.files, self.number = files, 0

    def ask(self, opcode: int, data: bytes = b"", *, size: int | None = None, offset: int = 0) -> tuple[int, bytes]:
        """Code and data of the answer."""
        self.number += 2
        head = HEAD.pack(self.number, 0, opcode, len(data) if size is None else size, 0, 0, offset)
        answer = self.files.answer(head + data)
        number, _, code, count, asked, _, at = HEAD.unpack_from(answer)
        assert (len(answer), number, asked, at) == (PAYLOAD_B, self.number + 1, opcode, offset)
        return code, answer[HEAD.size : HEAD.size + count]

    def upload(self, path: bytes, data: bytes) -> None:
        """As clients do it."""
        assert self.ask(ftp.CREATE, path)[0] == ftp.ACK
        for at in range(0, len(data), 80):
            assert self.ask(ftp.WRITE, data[at : at + 80], offset=at)[0] == ftp.ACK
        assert self.ask(ftp.TERMINATE)[0] == ftp.ACK


def test_what_was_uploaded_is_read_listed_summed_and_removed() -> None:
    """And is a script for the next start."""
    files, text = MavftpServer(), b"-- own\n" * 60
    client = Client(files)
    client.upload(PATH, text)
    assert files.scripts() == {"own.lua": text.decode()}
    assert client.ask(ftp.OPEN_READ, PATH) == (ftp.ACK, struct.pack("<I", len(text)))
    read = b""
    while True:
        code, part = client.ask(ftp.READ, size=200, offset=len(read))
        if code == ftp.NAK:
            break
        read += part
    assert read == text
    assert part == bytes([6])
    client.ask(ftp.TERMINATE)
    assert client.ask(ftp.LIST, b"/APM/scripts") == (ftp.ACK, b"Fown.lua\t%d\0" % len(text))
    assert client.ask(ftp.LIST, b"/APM") == (ftp.ACK, b"Dscripts\0")
    assert client.ask(ftp.REMOVE, PATH)[0] == ftp.ACK
    assert files.scripts() == {}


def test_the_sum_is_crc_32_from_zero_and_not_inverted() -> None:
    """As the firmware reckons it: of one byte, the table's entry for it."""
    client = Client(MavftpServer())
    client.upload(PATH, b"\x01")
    assert client.ask(ftp.CRC32, PATH) == (ftp.ACK, struct.pack("<I", 0x77073096))
    assert binascii.crc32(b"\x01") != 0x77073096


def test_a_repeated_request_is_answered_alike_and_done_once() -> None:
    """A lost answer must not open a second session."""
    files = MavftpServer()
    request = HEAD.pack(2, 0, ftp.CREATE, len(PATH), 0, 0, 0) + PATH
    assert files.answer(request) == files.answer(request)
    assert files.answer(request)[3] == ftp.ACK


@pytest.mark.parametrize(
    ("opcode", "data", "fault"),
    [
        (ftp.OPEN_READ, b"/none", 10),
        (ftp.CREATE, b"/none/own.lua", 10),
        (ftp.READ, b"", 4),
        (ftp.WRITE, b"x", 4),
        (ftp.LIST, b"/none", 10),
        (ftp.REMOVE, b"/none", 10),
        (ftp.CRC32, b"/none", 10),
        (ftp.MAKE_FOLDER, b"/APM", 8),
        (ftp.RENAME, b"/APM", 7),
        (99, b"", 7),
    ],
)
def test_what_cannot_be_done_is_refused_with_its_reason(opcode: int, data: bytes, fault: int) -> None:
    """By the protocol's own numbers."""
    assert Client(MavftpServer()).ask(opcode, data) == (ftp.NAK, bytes([fault]))


@given(st.lists(st.binary(max_size=260), max_size=20))
def test_any_bytes_are_answered(requests: list[bytes]) -> None:
    """With a packet of the right length, and nothing grows beyond its bound."""
    files = MavftpServer()
    for request in requests:
        assert len(files.answer(request)) == PAYLOAD_B
    assert sum(map(len, files.content.values())) <= ftp.MOST_B
