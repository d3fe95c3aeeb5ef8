"""What ground stations are told of a page, and what lies at its addresses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from wakewise.ui.web.blueos import EXTRAS_PATH, SERVICE_PATH, ServiceDescription
from wakewise.ui.web.files import StaticFiles
from wakewise.ui.web.origin_check import page_headers

OFFER = ServiceDescription(name="A page", description="Shows something.", widget="A widget")


def test_what_is_offered_is_served_to_other_sites() -> None:
    """Both files, as JSON that a ground station's page may read; the names are the offer's."""
    files = StaticFiles(folder=Path("nowhere"), more=OFFER.files())
    for path, told in ((EXTRAS_PATH, OFFER.cockpit_extras()), (SERVICE_PATH, OFFER.register_service())):
        file = files.at(path)
        assert file is not None
        assert file.shared
        assert json.loads(file.body) == told
    assert OFFER.cockpit_extras()["widgets"][0]["name"] == "A widget"
    assert OFFER.register_service()["name"] == "A page"


@pytest.mark.parametrize(
    "address", ["/page/../gate.py", "/page/%2e%2e/gate.py", "/gate.py", "/page/", "/page/a/theme.js", ""]
)
def test_no_address_leads_out_of_the_pages_folders(address: str, tmp_path: Path) -> None:
    """What every page has is there beside its own; anything else is not."""
    (tmp_path / "own.js").write_text("own", encoding="utf-8")
    (tmp_path / "secret.txt").write_text("secret", encoding="utf-8")
    files = StaticFiles(folder=tmp_path)
    assert files.at("/page/own.js") is not None
    assert files.at("/page/theme.js?v=1") is not None
    assert files.at("/page/secret.txt") is None
    assert files.at(address) is None


def test_a_page_may_be_framed_by_its_own_computers_other_pages() -> None:
    """Under the name that it was asked for by; a name that is none adds nothing to the rules."""
    assert "http://10.0.0.5:*" in page_headers("10.0.0.5:8765")["Content-Security-Policy"]
    for host in ("evil; script-src *", "a b", "[::1]:80", ""):
        rules = page_headers(host)["Content-Security-Policy"].partition("frame-ancestors")[2]
        assert rules == page_headers("")["Content-Security-Policy"].partition("frame-ancestors")[2]
