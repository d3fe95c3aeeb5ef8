"""The devices themselves: an I2C bus and a serial port of Linux, a socket. What goes wrong is said in one line."""

from __future__ import annotations

import os
import select
import socket
from pathlib import Path
from types import TracebackType

from wakewise.core.errors import EnvironmentFailure, InputError

_I2C_SLAVE = 0x0703
"""ioctl of linux/i2c-dev.h: the device that reads and writes go to."""
_CHUNK = 4096
PATIENCE_S = 1.0
"""How long a line may take no bytes."""


class LinuxI2C:
    """/dev/i2c-N, through the kernel's own i2c-dev; needs no library."""

    def __init__(self, path: Path | str) -> None:
        self._path = Path(path)
        self._fd = _open(self._path, os.O_RDWR, "an I2C bus, such as /dev/i2c-1 (`ls /dev/i2c-*`)")
        self._address: int | None = None

    def write(self, address: int, data: bytes) -> None:
        """Send bytes to a device; OSError if it does not answer."""
        self._choose(address)
        os.write(self._fd, data)

    def read(self, address: int, count: int) -> bytes:
        """Take bytes from a device; OSError if it does not answer."""
        self._choose(address)
        return os.read(self._fd, count)

    def close(self) -> None:
        """Give the bus back."""
        os.close(self._fd)

    def _choose(self, address: int) -> None:
        from fcntl import ioctl

        if address != self._address:
            ioctl(self._fd, _I2C_SLAVE, address)
            self._address = address


class SerialPort:
    """A serial line, raw, read without waiting; needs no library.

    Parameters
    ----------
    path : Path or str
    baud : int
    writes : bool
        Whether it is written to as well.
    """

    def __init__(self, path: Path | str, baud: int, *, writes: bool = False) -> None:
        try:
            import termios
            import tty
        except ImportError:
            raise EnvironmentFailure(f"{path}: serial ports are read on Linux and macOS only") from None
        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            raise InputError(f"baud {baud}: not a rate that this computer's serial ports know, such as 9600 or 115200")
        self._path = Path(path)
        flags = (os.O_RDWR if writes else os.O_RDONLY) | os.O_NOCTTY | os.O_NONBLOCK
        self._fd = _open(self._path, flags, "a serial port, such as /dev/ttyUSB0")
        try:
            tty.setraw(self._fd)
            settings = termios.tcgetattr(self._fd)
            settings[4] = settings[5] = speed
            termios.tcsetattr(self._fd, termios.TCSANOW, settings)
        except termios.error:
            os.close(self._fd)
            raise InputError(f"{path}: is no serial port, such as /dev/ttyUSB0") from None

    def read(self) -> bytes:
        """What has come since.

        Raises
        ------
        EnvironmentFailure
            If the device went away.
        """
        try:
            data = os.read(self._fd, _CHUNK)
        except BlockingIOError:
            return b""
        except OSError as fault:
            raise EnvironmentFailure(f"{self._path}: {fault.strerror}, the device went away") from None
        return data

    def write(self, data: bytes) -> None:
        """Hand bytes over; OSError if the line takes none for `PATIENCE_S`, or is gone."""
        while data:
            if not select.select([], [self._fd], [], PATIENCE_S)[1]:
                raise TimeoutError(f"{self._path}: takes no bytes")
            data = data[os.write(self._fd, data) :]

    def fileno(self) -> int:
        """What the operating system calls it, for `select`."""
        return self._fd

    def close(self) -> None:
        """Give the port back."""
        os.close(self._fd)


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


def _open(path: Path, flags: int, what: str) -> int:
    try:
        return os.open(path, flags)
    except FileNotFoundError:
        raise InputError(f"{path}: no such device; give {what}") from None
    except PermissionError:
        raise EnvironmentFailure(f"{path}: no permission; is your user in the device's group (dialout, i2c)?") from None
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror}; give {what}") from None
