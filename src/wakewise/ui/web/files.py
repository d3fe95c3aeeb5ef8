"""A page's own files, and the few other addresses that are served beside them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

SHARED = Path(__file__).with_name("page")
"""What every page has: colours, theme, drawing, numbers, icon."""
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".webmanifest": "application/manifest+json",
}


@dataclass(frozen=True, kw_only=True)
class StaticFile:
    """What is answered at one address; `shared`: pages of other sites may read it, too."""

    body: bytes
    kind: str
    shared: bool = False


@dataclass(frozen=True, kw_only=True)
class StaticFiles:
    """What lies in the page's folder and in the one that all pages share, and `more`, by address, made when asked for.

    Only names that a folder itself lists are read, so that no address leads out of it.
    """

    folder: Path
    more: Mapping[str, Callable[[], StaticFile]] = field(default_factory=dict)

    def at(self, address: str) -> StaticFile | None:
        """The file at an address such as /page/cockpit.js; None where there is none."""
        path = address.partition("?")[0]
        if path in self.more:
            return self.more[path]()
        name = "index.html" if path == "/" else path.removeprefix("/page/") if path.startswith("/page/") else ""
        for folder in (self.folder, SHARED):
            for found in folder.iterdir() if folder.is_dir() else ():
                if found.name == name and found.suffix in _TYPES and found.is_file():
                    return StaticFile(body=found.read_bytes(), kind=_TYPES[found.suffix])
        return None
