"""Connections that have not said who they are yet: how many a server keeps, and which it closes for one more.

Whoever connects costs a descriptor, and often a thread, before the first word. They are bounded here, by address and in
all. One too many is never refused: it might be the pilot. The one that has been silent for longest is closed instead,
of the same address, or of the address that has most.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from ipaddress import IPv6Address, ip_address

PER_ADDRESS, IN_ALL = 128, 384
"""A page asks for its thirty files over at most six connections at a time; several pages may share an address."""


class PendingConnections:
    """Connections without a name, oldest first; safe to use from any thread.

    Parameters
    ----------
    per_address, in_all : int
        How many are kept.
    """

    def __init__(self, per_address: int = PER_ADDRESS, in_all: int = IN_ALL) -> None:
        self._per_address, self._in_all = per_address, in_all
        self._lock = threading.Lock()
        self._kept: dict[int, tuple[str, Callable[[], None]]] = {}
        self._count = 0

    def __len__(self) -> int:
        return len(self._kept)

    def enter(self, address: str, close: Callable[[], None]) -> int:
        """Keep a connection from `address`, which `close` would end; returns its number for `leave`."""
        with self._lock:
            self._count += 1
            number, own = self._count, _network(address)
            self._kept[number] = (own, close)
            counts = Counter(network for network, _ in self._kept.values())
            most = max(counts.values())
            over = None
            if counts[own] > self._per_address:
                over = own
            elif len(self._kept) > self._in_all:
                over = next(network for network, _ in self._kept.values() if counts[network] == most)
            oldest = next((one for one, (network, _) in self._kept.items() if network == over), None)
            closed = None if oldest is None else self._kept.pop(oldest)[1]
        if closed is not None:
            closed()
        return number

    def leave(self, number: int) -> None:
        """A connection has said who it is, or is gone."""
        with self._lock:
            self._kept.pop(number, None)

    def close(self) -> None:
        """End all that still wait."""
        with self._lock:
            kept, self._kept = list(self._kept.values()), {}
        for _, close in kept:
            close()


def _network(address: str) -> str:
    """What one computer can call itself: an IPv4 address, or the first half of an IPv6 one."""
    try:
        known = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if not isinstance(known, IPv6Address):
        return str(known)
    return str(known.ipv4_mapped) if known.ipv4_mapped is not None else known.exploded[:19]
