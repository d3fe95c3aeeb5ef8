"""Under which addresses others reach a server: those of this computer's networks where it listens at all of them."""

from __future__ import annotations

import socket
import struct
from contextlib import suppress
from ipaddress import ip_address

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
