"""What other ground stations ask for: BlueRobotics Cockpit's `cockpit_extras.json` and BlueOS' `register_service`.

A page is offered as a widget, and nothing else: Cockpit's actions are requests that anybody on the network could send.
Schema: Cockpit's documentation "External Integrations" (2026-05-07) and BlueOS' "Web Interface (HTTP Server)".
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from wakewise.ui.web.files import StaticFile

EXTRAS_PATH, SERVICE_PATH = "/cockpit_extras.json", "/register_service"
WIDGET_PATH, ICON_PATH = "/?widget=1", "/page/icon.svg"
API_VERSION = "1.0.0"


@dataclass(frozen=True, kw_only=True)
class ServiceDescription:
    """A page as ground stations list it: what the service is called and does, and what its widget is called."""

    name: str
    description: str
    widget: str

    def cockpit_extras(self) -> dict[str, Any]:
        """What BlueRobotics Cockpit is told: one widget, from addresses that it completes with this server's own."""
        return {
            "targetSystem": "Cockpit",
            "targetCockpitApiVersion": API_VERSION,
            "widgets": [
                {"name": self.widget, "iframeUrl": WIDGET_PATH, "iframeIcon": ICON_PATH, "version": version("wakewise")}
            ],
            "actions": [],
            "joystickSuggestions": [],
        }

    def register_service(self) -> dict[str, Any]:
        """What BlueOS is told of this server, so that it lists it and hands its extras on."""
        return {
            "name": self.name,
            "description": self.description,
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

    def files(self) -> dict[str, Callable[[], StaticFile]]:
        """Both, by address, for `Files.more`."""
        return {
            EXTRAS_PATH: lambda: as_json(self.cockpit_extras(), shared=True),
            SERVICE_PATH: lambda: as_json(self.register_service(), shared=True),
        }


def as_json(told: dict[str, Any], *, shared: bool = False) -> StaticFile:
    """A file of JSON; `shared` lets a page of another site read it, as Cockpit's does."""
    return StaticFile(body=json.dumps(told, indent=1).encode(), kind="application/json", shared=shared)
