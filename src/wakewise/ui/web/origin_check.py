"""Who may come in: names under which the page may be asked for, who may open its socket, and who must show a token.

A page of another site can have a browser talk to a port of this computer: by a name of its own that it points here (DNS
rebinding; the Host header tells), or straight (the Origin header tells). Both are refused. From this computer by its
loopback names nothing more is asked; anybody else must show the token.
"""

from __future__ import annotations

import hmac
import re
from dataclasses import dataclass
from ipaddress import ip_address
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

    Raises
    ------
    InputError
        If it is none of http or https.
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
