"""Who may come in: this computer by its own names, others with the token, other sites' pages never."""

import pytest

from wakewise.core.errors import InputError
from wakewise.ui.web.origin_check import OriginCheck, RequestOrigin, origin_of, page_headers

GATE = OriginCheck(port=8765, token="secret")
OPEN = OriginCheck(port=8765, token="secret", open_to_net=True)
HOME = "127.0.0.1:8765"


@pytest.mark.parametrize("host", [HOME, "localhost:8765", "[::1]:8765", "LOCALHOST:8765"])
def test_loopback_names_with_the_port_are_let_in(host: str) -> None:
    """With or without an Origin that is the page's own."""
    assert GATE.refusal(RequestOrigin(address="127.0.0.1", host=host, origin=None)) is None
    assert GATE.refusal(RequestOrigin(address="127.0.0.1", host=host, origin=f"http://{host}")) is None


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8765", "127.0.0.1", "127.0.0.1:80", "", None, HOME * 2])
def test_another_host_is_refused(host: str | None) -> None:
    """A name that was pointed at this computer is not one of its own (DNS rebinding)."""
    assert GATE.refusal(RequestOrigin(address="127.0.0.1", host=host, origin=None)) is not None


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "https://127.0.0.1:8765", "http://127.0.0.1:8000", HOME, "http://localhost:8765@x"],
)
def test_another_origin_is_refused(origin: str) -> None:
    """Pages of other sites, ports and schemes may not talk to the socket, open to the net or not."""
    assert "Origin" in (GATE.refusal(RequestOrigin(address="127.0.0.1", host=HOME, origin=origin)) or "")
    assert "Origin" in (OPEN.refusal(RequestOrigin(address="10.0.0.7", host="rov.local:8765", origin=origin)) or "")


def test_only_this_computer_by_its_own_names_needs_no_token() -> None:
    """Neither a caller from the net who says localhost, nor this computer under another name."""
    assert not OPEN.needs_token(RequestOrigin(address="127.0.0.1", host=HOME, origin=None))
    assert not OPEN.needs_token(RequestOrigin(address="::1", host="[::1]:8765", origin=None))
    assert OPEN.needs_token(RequestOrigin(address="10.0.0.7", host=HOME, origin=None))
    assert OPEN.needs_token(RequestOrigin(address="127.0.0.1", host="rov.local:8765", origin=None))
    assert OPEN.needs_token(RequestOrigin(address="", host=HOME, origin=None))


def test_the_token_must_be_the_very_one() -> None:
    """Nothing else fits, not even letters that no token has."""
    assert GATE.fits("secret")
    assert not any(GATE.fits(token) for token in (None, "", "secre", "secret ", "sécret"))


def test_a_page_may_only_be_framed_by_whom_it_is_meant_for() -> None:
    """The header names this computer's pages and those of a BlueROV2, and lets scripts come from here alone."""
    rules = page_headers(HOME)["Content-Security-Policy"]
    assert "frame-ancestors 'self'" in rules
    assert "default-src 'self'" in rules
    assert f"ws://{HOME}" in rules


def test_behind_a_proxy_its_origin_may_come_in_with_the_token() -> None:
    """Whatever Host it writes; everybody comes from this computer then, so that nobody is let off the token."""
    origin = origin_of("http://192.168.2.2:80/")
    assert origin == "http://192.168.2.2"
    behind = OriginCheck(port=8765, token="secret", origins=(origin,))
    for host in (HOME, "192.168.2.2"):
        caller = RequestOrigin(address="127.0.0.1", host=host, origin=origin)
        assert behind.refusal(caller) is None
        assert behind.needs_token(caller)
    assert behind.needs_token(RequestOrigin(address="127.0.0.1", host=HOME, origin=None))
    assert "Origin" in (
        behind.refusal(RequestOrigin(address="127.0.0.1", host=HOME, origin="http://192.168.2.3")) or ""
    )
    assert "Host" in (behind.refusal(RequestOrigin(address="127.0.0.1", host="evil.example", origin=None)) or "")
    assert "ws://192.168.2.2" in page_headers(HOME, behind.origins)["Content-Security-Policy"]


@pytest.mark.parametrize("text", ["", "192.168.2.2", "ftp://a", "http://a/b", "http://a:port", "http://", "http://a?b"])
def test_what_is_no_origin_is_refused_in_words(text: str) -> None:
    """Said with what would be right."""
    with pytest.raises(InputError, match=r"http://192\.168\.2\.2"):
        origin_of(text)
