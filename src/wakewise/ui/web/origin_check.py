"""Access to a server: allowed hosts and origins, the token, its addresses, and limits on pending connections.

A page of another site can send requests from a browser to a port of this computer: by a host name that resolves to this
computer (DNS rebinding, visible in the Host header), or directly (visible in the Origin header). Both are refused.
Callers on this computer need nothing more; all others need the token.

A connection takes a descriptor, and often a thread, before its first request. Pending connections are limited by
address and in total. A new one is never refused, because it may be the pilot's. The oldest pending one is closed
instead, of the same address, or of the address with most of them.
"""

from __future__ import annotations

import hmac
import re
import socket
import struct
import threading
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from urllib.parse import urlsplit

from wakewise.core.errors import InputError

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
FRAMED_BY = ("'self'", "http://localhost:*", "http://127.0.0.1:*", "http://blueos.local:*", "http://192.168.2.2:*")
"""Pages that may show ours within them: this computer's, and BlueRobotics Cockpit where a BlueROV2 serves it."""
TOKEN_HEADER = "X-Wakewise-Token"
"""Where a caller shows the token."""
_NAME = re.compile(r"([A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\])(:\d+)?\Z")


@dataclass(frozen=True, kw_only=True)
class RequestOrigin:
    """Who asks: address of the other end, and the headers Host and Origin, None where they are not sent."""

    address: str
    host: str | None
    origin: str | None


@dataclass(frozen=True, kw_only=True)
class OriginCheck:
    """Rules of one server: its port, its token, and whether it listens beyond this computer (`open_to_net`).

    `origins` are those of a proxy before it, as a browser writes them ("http://192.168.2.2"). Behind a proxy everybody
    comes from this computer, so that all must show the token.
    """

    port: int
    token: str
    open_to_net: bool = False
    origins: tuple[str, ...] = ()

    def refusal(self, caller: RequestOrigin) -> str | None:
        """Why a request is refused; None where it is let in."""
        if caller.host is None:
            return "no Host header"
        if _NAME.match(caller.host) is None:
            return f"Host {_short(caller.host)}: not the name of a computer"
        if not self.open_to_net and not self._local(caller.host) and caller.host not in self._proxies():
            return f"Host {_short(caller.host)}: this page is served as {self._names()} only"
        if caller.origin is not None and caller.origin not in self._origins(caller.host):
            return f"Origin {_short(caller.origin)}: pages of other sites may not ask"
        return None

    def needs_token(self, caller: RequestOrigin) -> bool:
        """Whether a caller who was let in must show the token."""
        return bool(self.origins) or not (
            is_loopback(caller.address) and caller.host is not None and self._local(caller.host)
        )

    def fits(self, token: str | None) -> bool:
        """Whether a token is the right one; takes the same time whatever is wrong with it."""
        return token is not None and equal_secrets(token, self.token)

    def _origins(self, host: str) -> set[str]:
        """Where a page must come from that was asked for under this name."""
        own = {f"http://{name}:{self.port}" for name in LOOPBACK} if self._local(host) else set()
        return own | {f"http://{host}", *self.origins}

    def _proxies(self) -> set[str]:
        """What a proxy may write into Host: its own name."""
        return {origin.partition("://")[2] for origin in self.origins}

    def _local(self, host: str) -> bool:
        return host.lower() in {f"{name}:{self.port}" for name in LOOPBACK}

    def _names(self) -> str:
        return ", ".join(f"{name}:{self.port}" for name in LOOPBACK)


def equal_secrets(one: str, other: str) -> bool:
    """Whether two secrets are the same, in a time that tells nothing; any text may be compared."""
    return hmac.compare_digest(one.encode(errors="surrogatepass"), other.encode(errors="surrogatepass"))


def origin_of(text: str) -> str:
    """An address as a browser writes it into Origin: scheme, host and port.

    Raises InputError if it is none of http or https.
    """
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError:
        parts, port = urlsplit(""), None
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.path not in ("", "/") or parts.query:
        raise InputError(
            f"origin {_short(text)}: expected where the page is asked for, as http://192.168.2.2 or https://name:8443"
        )
    named = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    usual = {"http": 80, "https": 443}[parts.scheme]
    return f"{parts.scheme}://{named}" + (f":{port}" if port not in (None, usual) else "")


def is_loopback(address: str) -> bool:
    """Whether an address is one of this computer's own, by which nobody else can come."""
    if address == "localhost":
        return True
    try:
        return ip_address(address.partition("%")[0]).is_loopback
    except ValueError:
        return False


def page_headers(host: str, origins: tuple[str, ...] = ()) -> dict[str, str]:
    """Headers of every file: nothing from elsewhere, no sniffing, framed only by whom it is meant for.

    Besides `FRAMED_BY` that is any port of the name under which it was asked for: the same computer's other pages.
    """
    named = None if host.startswith("[") else _NAME.match(host)  # the rules know no IPv6 addresses
    framed_by = (*FRAMED_BY, *([f"http://{named[1]}:*"] if named else []))
    sockets = [f"ws://{host}", *(f"ws{origin.removeprefix('http')}" for origin in origins)]
    rules = (
        "default-src 'self'",
        f"connect-src 'self' {' '.join(sockets)}",
        "img-src 'self' blob: data:",
        "style-src 'self' 'unsafe-inline'",
        "frame-src http://localhost:* http://127.0.0.1:*",
        "base-uri 'none'",
        "form-action 'none'",
        f"frame-ancestors {' '.join(framed_by)}",
    )
    return {
        "Content-Security-Policy": "; ".join(rules),
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
    }


def _short(text: str) -> str:
    return ascii(text[:60])


_EVERYWHERE = {4: "192.0.2.1", 6: "2001:db8::1"}
"""Addresses for documentation, where nobody is: the way to them is the way to the net. Nothing is sent."""
_GET_ADDRESS = 0x8915  # Linux: SIOCGIFADDR


def page_addresses(host: str, port: int, fragment: str = "") -> tuple[str, ...]:
    """Where a browser finds a page that is served at `host`, best first: addresses that can be typed on a phone.

    A host of all addresses ("0.0.0.0", "::") is no address: each of this computer's own is given in its place.
    """
    return tuple(f"http://{f'[{one}]' if ':' in one else one}:{port}/{fragment}" for one in _hosts(host))


def _hosts(host: str) -> tuple[str, ...]:
    try:
        listens = ip_address(host or "0.0.0.0")
    except ValueError:
        return (host,)
    if not listens.is_unspecified:
        return (host,)
    found = dict.fromkeys([*_way_out(listens.version), *(_own() if listens.version == 4 else ())])
    usable = tuple(one for one in found if not ip_address(one).is_loopback)
    return usable or ("127.0.0.1" if listens.version == 4 else "::1",)


def _way_out(version: int) -> list[str]:
    """Address of this computer on the network that leads to all others."""
    with (
        suppress(OSError),
        socket.socket(socket.AF_INET if version == 4 else socket.AF_INET6, socket.SOCK_DGRAM) as way,
    ):
        way.connect((_EVERYWHERE[version], 9))
        return [str(way.getsockname()[0])]
    return []


def _own() -> list[str]:
    """IPv4 addresses of this computer's network interfaces, such as a tether's, to which no way out leads."""
    found: list[str] = []
    try:
        from fcntl import ioctl

        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
            for _, name in socket.if_nameindex():
                with suppress(OSError):  # an interface without an address
                    told = ioctl(any_socket.fileno(), _GET_ADDRESS, struct.pack("256s", name.encode()[:15]))
                    found.append(socket.inet_ntoa(told[20:24]))
    except (ImportError, OSError):  # not Linux
        pass
    with suppress(OSError):
        found += [str(one[4][0]) for one in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)]
    return found


PER_ADDRESS, IN_ALL = 128, 384
"""A page asks for its thirty files over at most six connections at a time; several pages may share an address."""


class PendingConnections:
    """Connections without a name, oldest first; safe to use from any thread.

    `per_address`, `in_all`: how many are kept.
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
