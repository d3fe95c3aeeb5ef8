"""One autopilot's bytes for several programs, and theirs for it and for each other, as a router on a vehicle does it.

Nothing is looked into, kept or changed. Every place is UDP; a place that is silent is sent to all the same.
"""

from __future__ import annotations

import select
from collections.abc import Callable, Sequence

from wakewise.core.errors import InputError
from wakewise_ardusub.link.connection import Endpoint
from wakewise_ardusub.link.transports import UdpTransport

WAIT_S = 0.1
"""How soon `going` is asked again while nobody speaks."""
_UDP = ("udpin", "udpout")


class MavlinkRouter:
    """Sockets of an autopilot and of those who share it, in the order given: the autopilot first.

    Attributes
    ----------
    passed : list of int
        Datagrams that came from each.
    lost : int
        Copies that could not be sent.

    Raises
    ------
    InputError
        If a place is not UDP.
    EnvironmentFailure
        If one cannot be had.
    """

    def __init__(self, places: Sequence[Endpoint]) -> None:
        for place in places:
            if place.way not in _UDP:
                raise InputError(f"{place.words}: only udpin:HOST:PORT and udpout:HOST:PORT can be shared")
        self._ends: list[UdpTransport] = []
        try:
            self._ends += map(UdpTransport, places)
        except BaseException:
            self.close()
            raise
        self.passed, self.lost = [0] * len(places), 0

    def turn(self) -> None:
        """Wait a little for somebody to speak, and hand on what came: to everybody else."""
        heard = select.select([end.socket for end in self._ends], [], [], WAIT_S)[0]
        for index, end in enumerate(self._ends):
            data = end.receive(0.0) if end.socket in heard else b""
            if not data:
                continue
            self.passed[index] += 1
            for other in self._ends:
                if other is not end:
                    self._hand(other, data)

    def run(self, going: Callable[[], bool]) -> None:
        """Turns until `going` says no."""
        while going():
            self.turn()

    def close(self) -> None:
        """Give the ports back."""
        for end in self._ends:
            end.close()

    def _hand(self, end: UdpTransport, data: bytes) -> None:
        try:
            end.send(data)
        except OSError:  # nobody there yet
            self.lost += 1
