"""Parts of a page that are made before the others, while what the others show is still being made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


class PageParts:
    """Keeps each part of a page by name, so that it is made once: early if that can be, else with the page.

    A draft belongs to one page. Whoever asks for a part before the page is written must know that nothing which the
    part shows is still to come.
    """

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}

    def once(self, name: str, make: Callable[[], T]) -> T:
        """The part of this name, made now if it has not been made."""
        if name not in self._made:
            self._made[name] = make()
        part: T = self._made[name]
        return part
