"""Where others find a page: origin_check that can be typed into a phone."""

from __future__ import annotations

from ipaddress import ip_address
from urllib.parse import urlsplit

import pytest

from wakewise.ui.web import origin_check
from wakewise.ui.web.origin_check import page_addresses


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost", "rov.local", "192.168.2.1"])
def test_a_host_that_can_be_asked_for_is_given_as_it_is(host: str) -> None:
    """With brackets about an IPv6 address."""
    (found,) = page_addresses(host, 8765, "#token=x")
    assert urlsplit(found).hostname == host
    assert found.endswith(":8765/#token=x")


@pytest.mark.parametrize("host", ["0.0.0.0", "::", ""])
def test_all_addresses_are_told_one_by_one(host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The way out comes first, a tether without one after it; loopback names, which no phone reaches, do not count."""
    monkeypatch.setattr(origin_check, "_way_out", lambda version: ["10.0.0.5" if version == 4 else "2001:db8::5"])
    monkeypatch.setattr(origin_check, "_own", lambda: ["127.0.0.1", "10.0.0.5", "192.168.2.1"])
    hosts = [urlsplit(one).hostname for one in page_addresses(host, 8765)]
    assert hosts == (["2001:db8::5"] if host == "::" else ["10.0.0.5", "192.168.2.1"])


def test_what_this_computer_says_of_itself_can_be_asked_for() -> None:
    """Each is an address of the family that is listened at, never the unspecified one, and there is at least one."""
    for host, version in (("0.0.0.0", 4), ("::", 6)):
        found = [ip_address(urlsplit(one).hostname or "") for one in page_addresses(host, 1)]
        assert found
        assert all(one.version == version and not one.is_unspecified for one in found)
