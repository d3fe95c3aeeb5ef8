"""What a server needs of what it shows: words, numbers, pictures, and a seat for the hands."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from wakewise.ui.cockpit.control_mailbox import ControlMailbox


@dataclass(frozen=True, kw_only=True)
class CameraPicture:
    """What the camera sees: a JPEG, its number, and the time of the flight that it shows."""

    number: int
    time_s: float
    jpeg: bytes

    def message(self) -> bytes:
        """As it goes over the wire: number and flight's time in ms, little-endian, then the JPEG."""
        return struct.pack("<II", self.number % 2**32, max(0, round(1e3 * self.time_s)) % 2**32) + self.jpeg


@dataclass(frozen=True, kw_only=True)
class StatusMessage:
    """A line for everybody: what has just changed."""

    text: str
    level: str = "info"
    time_s: float = 0.0

    def message(self) -> str:
        """As it goes over the wire."""
        return as_json({"type": "note", "level": self.level, "text": self.text, "time_s": round(self.time_s, 2)})


class ViewModel(Protocol):
    """What is shown, and what may be changed; called from the server's thread, and never for long."""

    @property
    def mailbox(self) -> ControlMailbox:
        """The helm, and where the flight reads its sticks."""
        ...

    @property
    def edition(self) -> int:
        """Grows when `welcome` has something new to say, which all are then told."""
        ...

    def welcome(self) -> dict[str, Any]:
        """What a client needs once: vehicle, target, desk."""
        ...

    def state(self) -> dict[str, Any] | None:
        """What is so now; None before there is anything."""
        ...

    def notes(self) -> Sequence[StatusMessage]:
        """What has happened since the last call."""
        ...

    def change_settings(self, changes: dict[str, Any]) -> None:
        """Change settings of the desk; raises InputError where a value is out of range."""
        ...

    def picture(self) -> CameraPicture | None:
        """What the camera sees now; called in another thread, where it may wait for the picture for a while."""
        ...


def as_json(told: dict[str, Any]) -> str:
    """One message; numbers must be finite, which JSON's are."""
    return json.dumps(told, allow_nan=False, separators=(",", ":"))
