"""What other ground stations ask for: BlueRobotics Cockpit's `cockpit_extras.json` and BlueOS' `register_service`.

The page is offered as a widget, and nothing else: Cockpit's actions are requests that anybody on the network could
send, while here nothing moves without the lease of the helm. Schema: Cockpit's documentation "External Integrations"
(2026-05-07) and BlueOS' "Web Interface (HTTP Server)".
"""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

from wakewise.cockpit.files import File

EXTRAS_PATH, SERVICE_PATH = "/cockpit_extras.json", "/register_service"
WIDGET_PATH, ICON_PATH = "/?widget=1", "/page/icon.svg"
API_VERSION = "1.0.0"


def cockpit_extras() -> dict[str, Any]:
    """What BlueRobotics Cockpit is told: one widget, from addresses that it completes with this server's own."""
    return {
        "targetSystem": "Cockpit",
        "targetCockpitApiVersion": API_VERSION,
        "widgets": [
            {
                "name": "Wakewise: gentle flight",
                "iframeUrl": WIDGET_PATH,
                "iframeIcon": ICON_PATH,
                "version": version("wakewise"),
            }
        ],
        "actions": [],
        "joystickSuggestions": [],
    }


def register_service() -> dict[str, Any]:
    """What BlueOS is told of this server, so that it lists it and hands its extras on."""
    return {
        "name": "Wakewise",
        "description": "Fly an underwater vehicle by hand while its wash leaves the target still.",
        "icon": ICON_PATH,
        "company": "Wakewise",
        "version": version("wakewise"),
        "webpage": "",
        "api": "",
        "new_page": False,
        # The page asks for its parts beside itself, so that a proxy may put it under any path.
        "works_in_relative_paths": True,
        "extras": {"cockpit": EXTRAS_PATH},
    }


def extras_files() -> dict[str, Callable[[], File]]:
    """Both, by address, for `Files.more`."""
    return {EXTRAS_PATH: lambda: _json(cockpit_extras()), SERVICE_PATH: lambda: _json(register_service())}


def _json(told: dict[str, Any]) -> File:
    # Cockpit reads them from its own page, which a browser counts as another site.
    return File(body=json.dumps(told, indent=1).encode(), kind="application/json", shared=True)
