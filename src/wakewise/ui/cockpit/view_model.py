"""Interface between a server and the flight that it shows: texts, numbers, pictures, and the pilot's controls."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from wakewise.ui.cockpit.control_mailbox import ControlMailbox


@dataclass(frozen=True, kw_only=True)
class CameraPicture:
    """A camera picture: JPEG, number, and time of the flight."""

    number: int
    time_s: float
    jpeg: bytes

    def message(self) -> bytes:
        """Encoded: number and flight's time in ms, little-endian, then the JPEG."""
        return struct.pack("<II", self.number % 2**32, max(0, round(1e3 * self.time_s)) % 2**32) + self.jpeg


@dataclass(frozen=True, kw_only=True)
class StatusMessage:
    """A note for all pages."""

    text: str
    level: str = "info"
    time_s: float = 0.0

    def message(self) -> str:
        """Encoded as JSON."""
        return as_json({"type": "note", "level": self.level, "text": self.text, "time_s": round(self.time_s, 2)})


class ViewModel(Protocol):
    """Shown data and settings; called from the server's thread, and returns quickly."""

    @property
    def mailbox(self) -> ControlMailbox:
        """The controls, and the source of the flight's sticks."""
        ...

    @property
    def edition(self) -> int:
        """Increases when `welcome` changes, which is then sent to all."""
        ...

    def welcome(self) -> dict[str, Any]:
        """Static data for a client: vehicle, target, settings."""
        ...

    def state(self) -> dict[str, Any] | None:
        """The state now; None before the first."""
        ...

    def notes(self) -> Sequence[StatusMessage]:
        """Notes since the last call."""
        ...

    def change_settings(self, changes: dict[str, Any]) -> None:
        """Change the operator's settings; raises InputError if a value is out of range."""
        ...

    def designate(self, box: tuple[float, float, float, float] | None, frame: int) -> None:
        """Designate what lies in a box of picture `frame` as the target; None: the scenario's own target again.

        The box is (left, top, right, bottom) in shares of the picture. Raises InputError if there are no pictures.
        """
        ...

    def propose(self, what: str) -> None:
        """Ask for a proposed target, accept or refuse it; raises InputError if there is none, or no pictures."""
        ...

    def picture(self) -> CameraPicture | None:
        """The camera picture now; called in another thread, where it may wait."""
        ...


def as_json(told: dict[str, Any]) -> str:
    """One message; numbers must be finite, which JSON's are."""
    return json.dumps(told, allow_nan=False, separators=(",", ":"))
