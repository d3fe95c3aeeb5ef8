"""What ground stations are told follows the schema that they read: keys, types, and addresses that are served."""

from __future__ import annotations

import json
from typing import Any

from wakewise.cockpit.extras import cockpit_extras, extras_files, register_service
from wakewise.cockpit.files import Files

# Required and optional keys of each object, as Cockpit's "External Integrations" lists them.
EXTRAS = ({"targetSystem": str, "targetCockpitApiVersion": str, "widgets": list, "actions": list}, {"joystickSuggestions": list})
WIDGET = (
    {"name": str, "iframeUrl": str},
    {"iconUrl": str, "iframeIcon": str, "collapsibleContainerName": str, "version": str, "startCollapsed": bool,
     "useExtensionPathAsBaseUrl": bool},
)  # fmt: skip
# BlueOS' ServiceMetadata: what has no default there must be there.
SERVICE = (
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
    told = cockpit_extras()
    fits(told, EXTRAS)
    assert told["targetSystem"] == "Cockpit"
    assert told["actions"] == []
    for widget in told["widgets"]:
        fits(widget, WIDGET)
        assert {"iconUrl", "iframeIcon"} & set(widget)


def test_the_service_is_what_blueos_reads() -> None:
    """Registered with its extras, at paths that also hold behind BlueOS' own proxy."""
    told = register_service()
    fits(told, SERVICE)
    assert told["extras"] == {"cockpit": "/cockpit_extras.json"}
    assert told["works_in_relative_paths"]


def test_every_address_that_is_named_is_served() -> None:
    """Widget, icon and both JSON files."""
    files = Files(more=extras_files())
    widget = cockpit_extras()["widgets"][0]
    for address in (widget["iframeUrl"], widget["iframeIcon"], register_service()["icon"]):
        assert files.at(address) is not None, address
    found = files.at(register_service()["extras"]["cockpit"])
    assert found is not None
    assert json.loads(found.body) == cockpit_extras()
