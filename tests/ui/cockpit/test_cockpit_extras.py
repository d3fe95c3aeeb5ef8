"""What ground stations are told follows the schema that they read: keys, types, and addresses that are served."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from typing import Any

import pytest
from rehearsal import Rehearsal

from wakewise.ui.cockpit.server import SERVICE, CockpitServer, page_files

# Required and optional keys of each object, as Cockpit's "External Integrations" lists them.
EXTRAS = (
    {"targetSystem": str, "targetCockpitApiVersion": str, "widgets": list, "actions": list},
    {"joystickSuggestions": list},
)
WIDGET = (
    {"name": str, "iframeUrl": str},
    {"iconUrl": str, "iframeIcon": str, "collapsibleContainerName": str, "version": str, "startCollapsed": bool,
     "useExtensionPathAsBaseUrl": bool},
)  # fmt: skip
# BlueOS' ServiceMetadata: what has no default there must be there.
SERVICE_KEYS = (
    {"name": str, "description": str, "icon": str, "company": str, "version": str, "webpage": str, "api": str},
    {"route": str, "new_page": bool, "extra_query": str, "avoid_iframes": bool, "sanitized_name": str,
     "works_in_relative_paths": bool, "extras": dict},
)  # fmt: skip


def fits(told: dict[str, Any], schema: tuple[dict[str, type], dict[str, type]]) -> None:
    required, optional = schema
    assert set(required) <= set(told) <= set(required) | set(optional)
    for name, value in told.items():
        assert isinstance(value, (required | optional)[name]), name


def test_the_extras_are_what_cockpit_reads() -> None:
    """One widget with an icon; no action, since what is sent to a bare address has no helm."""
    told = SERVICE.cockpit_extras()
    fits(told, EXTRAS)
    assert told["targetSystem"] == "Cockpit"
    assert told["actions"] == []
    for widget in told["widgets"]:
        fits(widget, WIDGET)
        assert {"iconUrl", "iframeIcon"} & set(widget)


def test_the_service_is_what_blueos_reads() -> None:
    """Registered with its extras, at paths that also hold behind BlueOS' own proxy."""
    told = SERVICE.register_service()
    fits(told, SERVICE_KEYS)
    assert told["extras"] == {"cockpit": "/cockpit_extras.json"}
    assert told["works_in_relative_paths"]


def test_every_address_that_is_named_is_served() -> None:
    """Widget, icon and both JSON files."""
    files = page_files()
    widget = SERVICE.cockpit_extras()["widgets"][0]
    for address in (widget["iframeUrl"], widget["iframeIcon"], SERVICE.register_service()["icon"]):
        assert files.at(address) is not None, address
    found = files.at(SERVICE.register_service()["extras"]["cockpit"])
    assert found is not None
    assert json.loads(found.body) == SERVICE.cockpit_extras()


def test_another_sites_page_reads_the_extras_and_nothing_else() -> None:
    """Cockpit asks from a page of its own; a foreign host name is refused all the same."""
    show = Rehearsal()
    server = CockpitServer(show)
    server.start()
    try:
        answer = ask(server, "/cockpit_extras.json", Origin="http://blueos.local")
        assert answer.headers["Access-Control-Allow-Origin"] == "*"
        assert json.loads(answer.read()) == SERVICE.cockpit_extras()
        answer.close()
        for path, headers in (
            ("/", {"Origin": "http://blueos.local"}),
            ("/register_service", {"Host": "evil.example"}),
        ):
            with pytest.raises(urllib.error.HTTPError) as refusal:
                ask(server, path, **headers)
            assert refusal.value.code == 403
            refusal.value.close()
    finally:
        server.stop()
        show.close()


def ask(server: CockpitServer, path: str, **headers: str) -> Any:
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", headers=headers)
    return urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=10)
