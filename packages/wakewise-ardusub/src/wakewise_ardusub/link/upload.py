"""MAVFTP client that uploads the script to the autopilot's card and reads it back byte by byte.

Our own, because pymavlink's client is GPL-3. Layout and numbers: mavlink.io, "MAVLink FTP". If an upload is
interrupted, the script is incomplete and the autopilot refuses to load it.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from wakewise.core.errors import EnvironmentFailure
from wakewise_ardusub.link.connection import MavlinkSession, send_command
from wakewise_ardusub.link.parameters import set_parameter
from wakewise_ardusub.link.protocol import AUTOPILOT_COMPONENT
from wakewise_ardusub.link.script import SCRIPT_FOLDERS, SCRIPT_NAME

DATA_BYTES = 239
ATTEMPTS = 6
WAIT_S = 0.5
_PAYLOAD_BYTES = 251
_HEAD = struct.Struct("<HBBBBBxI")
"""Number, session, operation, size, operation that is answered, burst complete, padding, offset."""
_TERMINATE, _RESET, _LIST, _OPEN_READ, _READ, _CREATE, _WRITE = 1, 2, 3, 4, 5, 6, 7
_MAKE_FOLDER = 9
_ACK = 128
_FAULTS = {
    1: "it failed",
    2: "its file system refused",
    3: "wrong size",
    4: "no such session",
    5: "no session is free",
    6: "end of file",
    7: "it does not know how",
    8: "it is there already",
    9: "it is protected",
    10: "there is no such file",
}
_END = 6
_REBOOT_COMMAND, _REBOOT_AUTOPILOT, _ACCEPTED = 246, 1, 0
_ARMED = 128
Progress = Callable[[float, float], None]


@dataclass(frozen=True)
class _Answer:
    good: bool
    session: int
    data: bytes

    @property
    def fault(self) -> int:
        return self.data[0] if self.data else 1


class _Client:
    """Requests one at a time, each until it is answered; the server answers a repeated one as it did before."""

    def __init__(self, link: MavlinkSession) -> None:
        self._link, self._number, self.session = link, 0, 0

    def ask(self, operation: int, data: bytes = b"", *, offset: int = 0, size: int | None = None) -> _Answer:
        self._number = (self._number + 1) % 65536
        head = _HEAD.pack(self._number, self.session, operation, len(data) if size is None else size, 0, 0, offset)
        payload = (head + data).ljust(_PAYLOAD_BYTES, b"\0")
        for _ in range(ATTEMPTS):
            self._link.send(
                "file_transfer_protocol",
                target_network=0,
                target_system=self._link.system,
                target_component=AUTOPILOT_COMPONENT,
                payload=payload,
            )
            answer = self._answer(operation)
            if answer is not None:
                self._number = (self._number + 1) % 65536
                return answer
        raise EnvironmentFailure("the autopilot does not answer file transfers: put the script there by hand")

    def done(self, operation: int, what: str, data: bytes = b"", *, offset: int = 0) -> _Answer:
        """As `ask`, and a refusal is an error."""
        answer = self.ask(operation, data, offset=offset)
        if not answer.good:
            raise EnvironmentFailure(
                f"{what}: {_FAULTS.get(answer.fault, f'fault {answer.fault}')}, says the autopilot"
            )
        return answer

    def _answer(self, operation: int) -> _Answer | None:
        until = time.monotonic() + WAIT_S
        while True:
            heard: Any = self._link.hear({"FILE_TRANSFER_PROTOCOL"}, max(until - time.monotonic(), 0.0))
            if heard is None:
                return None
            payload = bytes(heard.payload)
            number, session, code, size, answered, _, _ = _HEAD.unpack_from(payload)
            if answered == operation and number == (self._number + 1) % 65536:
                data = payload[_HEAD.size : _HEAD.size + min(size, DATA_BYTES)]
                return _Answer(code == _ACK, session, data)


def upload_script(link: MavlinkSession, script: bytes, *, progress: Progress | None = None) -> str:
    """Put the script where the autopilot looks for scripts, and say where that was.

    Raises
    ------
    EnvironmentFailure
        If the autopilot does not answer or refuses, or what is read back is not what was sent.
    """
    client = _Client(link)
    client.ask(_RESET)
    path = f"{_folder(client)}/{SCRIPT_NAME}"
    client.session = client.done(_CREATE, path, path.encode("ascii")).session
    for offset in range(0, len(script), DATA_BYTES):
        client.done(_WRITE, path, script[offset : offset + DATA_BYTES], offset=offset)
        if progress is not None:
            progress(0.5 * (offset + DATA_BYTES), len(script))
    client.done(_TERMINATE, path)
    if _read(client, path, len(script), progress) != script:
        raise EnvironmentFailure(f"{path}: what is read back is not what was sent; send it again")
    return path


def start_script(link: MavlinkSession) -> None:
    """Have the autopilot load its scripts: SCR_ENABLE to 1, read back, and a reboot. It must be disarmed.

    Raises
    ------
    EnvironmentFailure
        If it is armed, or does not do either.
    """
    beat: Any = link.hear({"HEARTBEAT"}, 3.0)
    if beat is None or beat.base_mode & _ARMED:
        raise EnvironmentFailure("the autopilot is armed or not heard: it is not rebooted; disarm it first")
    set_parameter(link, "SCR_ENABLE", 1.0)
    send_command(link, _REBOOT_COMMAND, _REBOOT_AUTOPILOT)
    until = time.monotonic() + 3.0
    while (left_s := until - time.monotonic()) > 0.0:
        answer: Any = link.hear({"COMMAND_ACK"}, left_s)
        if answer is not None and answer.command == _REBOOT_COMMAND:
            if answer.result == _ACCEPTED:
                return
            break
    raise EnvironmentFailure("the autopilot did not accept to reboot: switch it off and on")


def _folder(client: _Client) -> str:
    """The first of the folders that there is; else the first that can be made."""
    for folder in SCRIPT_FOLDERS:
        listed = client.ask(_LIST, folder.encode("ascii"))
        if listed.good or listed.fault == _END:
            return folder
    for folder in SCRIPT_FOLDERS:
        if client.ask(_MAKE_FOLDER, folder.encode("ascii")).good:
            return folder
    raise EnvironmentFailure("the autopilot has no folder for scripts: set SCR_ENABLE to 1, reboot, and try again")


def _read(client: _Client, path: str, most: int, progress: Progress | None) -> bytes:
    client.session = client.done(_OPEN_READ, path, path.encode("ascii")).session
    read = b""
    while len(read) <= most:
        answer = client.ask(_READ, offset=len(read), size=DATA_BYTES)
        if not answer.good or not answer.data:
            break
        read += answer.data
        if progress is not None:
            progress(0.5 * (most + len(read)), most)
    client.done(_TERMINATE, path)
    return read
