"""What is asked of a meter, checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise_ardusub.link.connection import Endpoint, parse_connection

TICK_S = 0.1
PORT = 8765


@dataclass(frozen=True, kw_only=True)
class MeterSettings:
    """What one meter does.

    Parameters
    ----------
    connection : str
        `udpin:HOST:PORT` where the vehicle's router sends to, or `udpout:HOST:PORT` of its server.
    host, port : str, int
        Where the page is served; port 0 takes any.
    token : bool
        Whether callers from other computers must show the token.
    system : int or None
        The vehicle's MAVLink system id; the first with servo outputs if None.
    publish : bool
        Send D and saved per cent as NAMED_VALUE_FLOAT.
    ask : bool
        Ask the autopilot for its motors' channels and directions.
    out : Path or None
        Folder for the dive's record.
    """

    connection: str
    host: str = "127.0.0.1"
    port: int = PORT
    token: bool = True
    system: int | None = None
    publish: bool = False
    ask: bool = False
    out: Path | None = None

    def __post_init__(self) -> None:
        _ = self.ends
        if self.system is not None and not 1 <= self.system <= 255:
            raise InputError(f"--system {self.system}: 1 to 255 are allowed")
        if not 0 <= self.port <= 65535:
            raise InputError(f"--port {self.port}: 0 to 65535 are allowed")
        if self.out is not None and self.out.exists() and not self.out.is_dir():
            raise InputError(f"--out {self.out}: a file is there, a folder is needed")

    @property
    def ends(self) -> Endpoint:
        """The connection taken apart.

        Raises
        ------
        InputError
            If it is none of UDP: a server for one client, such as BlueOS' TCP one, is not for somebody who only looks.
        """
        ends = parse_connection(self.connection)
        if ends.way not in ("udpin", "udpout"):
            raise InputError(
                f"--connection {self.connection}: a meter listens by UDP, udpin:HOST:PORT or udpout:HOST:PORT; a file "
                "is for `wakewise link log`"
            )
        return ends
