"""Device access for sensors: I2C bus (smbus2), serial port (pyserial) and UDP socket, without blocking reads.

Errors are one line that names the device.
"""

from __future__ import annotations

import errno
import socket
from pathlib import Path
from types import TracebackType

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise_ardusub.optional_dependencies import need

_CHUNK = 4096
WRITE_TIMEOUT_S = 1.0


class I2CBus:
    """An I2C bus of Linux, such as /dev/i2c-1.

    Raises
    ------
    InputError
        If there is no such device, or it is no I2C bus.
    EnvironmentFailure
        If it may not be opened.
    MissingExtra
        If smbus2 is not installed.
    """

    def __init__(self, path: Path | str) -> None:
        need(f"the I2C bus {path}", "links", only=("smbus2",))
        from smbus2 import SMBus, i2c_msg

        self._message, self._bus = i2c_msg, SMBus()
        try:
            self._bus.open(str(path))
        except OSError as fault:
            self._bus.close()
            raise _not_opened(path, fault, "an I2C bus, such as /dev/i2c-1 (`ls /dev/i2c-*`)") from None

    def write(self, address: int, data: bytes) -> None:
        """Send bytes to a device; OSError if it does not answer."""
        self._bus.i2c_rdwr(self._message.write(address, data))

    def read(self, address: int, count: int) -> bytes:
        """Read bytes from a device; OSError if it does not answer."""
        message = self._message.read(address, count)
        self._bus.i2c_rdwr(message)
        return bytes(message)

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()


class SerialPort:
    """A serial port, raw, 8N1, such as /dev/ttyUSB0 or COM3.

    Raises
    ------
    InputError
        If there is no such device, it is no serial port, or the rate is none of pyserial's.
    EnvironmentFailure
        If it may not be opened.
    MissingExtra
        If pyserial is not installed.
    """

    def __init__(self, path: Path | str, baud: int) -> None:
        need(f"the serial port {path}", "links", only=("serial",))
        import serial

        if baud not in serial.Serial.BAUDRATES:
            raise InputError(f"baud {baud}: no rate of serial ports, such as 9600 or 115200")
        self._path = path
        try:
            self._port = serial.Serial(str(path), baud, timeout=0.0, write_timeout=WRITE_TIMEOUT_S)
        except OSError as fault:
            raise _not_opened(path, fault, "a serial port, such as /dev/ttyUSB0") from None

    def read(self) -> bytes:
        """The bytes that have arrived, none if there are none.

        Raises
        ------
        EnvironmentFailure
            If the device was removed.
        """
        try:
            return bytes(self._port.read(_CHUNK))
        except OSError as fault:
            raise EnvironmentFailure(f"{self._path}: {fault}; the device was removed") from None

    def write(self, data: bytes) -> None:
        """Send bytes; OSError if the port accepts none for `WRITE_TIMEOUT_S`, or was removed."""
        self._port.write(data)

    def fileno(self) -> int:
        """File descriptor, for `select`."""
        return int(self._port.fileno())

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class UdpSocket:
    """A UDP port of this computer, read without waiting; only programs on it reach the default address."""

    def __init__(self, where: str) -> None:
        host, port = read_place(where if ":" in where else f"127.0.0.1:{where}", "--poses")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as fault:
            self._socket.close()
            raise EnvironmentFailure(f"--poses {host}:{port}: cannot listen there, {fault.strerror or fault}") from None
        self._socket.setblocking(False)

    @property
    def port(self) -> int:
        """The port that is listened on, which the system chose where 0 was given."""
        return int(self._socket.getsockname()[1])

    def read(self, most: int = 100) -> list[bytes]:
        """Datagrams that have come since, at most so many."""
        found: list[bytes] = []
        while len(found) < most:
            try:
                found.append(self._socket.recv(65535))
            except BlockingIOError:
                break
            except ConnectionError:
                continue
        return found

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()

    def __enter__(self) -> UdpSocket:
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def read_place(words: str, option: str) -> tuple[str, int]:
    """Host and port of `HOST:PORT`.

    Raises
    ------
    InputError
        If that is not what the words are.
    """
    host, _, port = words.rpartition(":")
    if not host or ":" in host or not (port.isascii() and port.isdecimal()) or int(port) > 65535:
        raise InputError(f"{option} {words}: must be a port and where it is, such as 127.0.0.1:14660")
    return host, int(port)


def _not_opened(path: Path | str, fault: OSError, right: str) -> InputError | EnvironmentFailure:
    """The error for a device that could not be opened; `right` says what would be one."""
    if fault.errno == errno.ENOENT:
        return InputError(f"{path}: no such device; give {right}")
    if fault.errno in (errno.EACCES, errno.EPERM):
        return EnvironmentFailure(f"{path}: no permission; is your user in the device's group (dialout, i2c)?")
    if fault.errno == errno.EBUSY:
        return EnvironmentFailure(f"{path}: {fault.strerror}")
    return InputError(f"{path}: is not {right}")
