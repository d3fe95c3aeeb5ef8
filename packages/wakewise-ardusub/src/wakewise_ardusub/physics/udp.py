"""The socket of the physics link; loopback unless another address is asked for."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

from wakewise.core.errors import InputError
from wakewise_ardusub.physics.datagrams import LARGEST_B
from wakewise_ardusub.physics.physics import PhysicsServer

LOOPBACK = "127.0.0.1"
_LISTEN_S = 0.2


def open_socket(host: str, port: int) -> socket.socket:
    """A UDP socket that listens; port 0 lets the system choose.

    Raises
    ------
    InputError
        If the address cannot be had.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"--port {port}: 0 to 65535 are allowed")
    listening = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        listening.bind((host, port))
    except OSError as fault:
        listening.close()
        raise InputError(
            f"UDP {host}:{port}: {fault.strerror or fault}; another program listens there, or it is no address here"
        ) from None
    listening.settimeout(_LISTEN_S)
    return listening


def serve(
    physics: PhysicsServer,
    listening: socket.socket,
    going: Callable[[], bool],
    *,
    said: Callable[[], None] | None = None,
    every_s: float = 1.0,
) -> None:
    """Answer frames until `going` says no; `said` is called now and then, also while nobody sends.

    Whoever sends is answered; `going` is asked at least five times a second.
    """
    next_s = time.monotonic() + every_s
    while going():
        try:
            datagram, sender = listening.recvfrom(LARGEST_B + 1)
        except TimeoutError:
            datagram = b""
        except ConnectionResetError:  # Windows says so when the last answer found nobody
            continue
        now_s = time.monotonic()
        if datagram:
            reply = physics.answer(datagram, sender, now_s)
            if reply is not None:
                listening.sendto(reply, sender)
        if said is not None and now_s >= next_s:
            said()
            next_s = now_s + every_s
