"""What other ground stations are told of the cockpit: a widget, and no action, since nothing moves without the helm."""

from __future__ import annotations

from pathlib import Path

from wakewise.ui.web.blueos import ServiceDescription
from wakewise.ui.web.files import StaticFiles

PAGE = Path(__file__).with_name("page")
SERVICE = ServiceDescription(
    name="Wakewise",
    description="Fly an underwater vehicle by hand while its wash leaves the target still.",
    widget="Wakewise: gentle flight",
)


def page_files() -> StaticFiles:
    """The page, and what ground stations ask for."""
    return StaticFiles(folder=PAGE, more=SERVICE.files())
