"""What one method can go on with where another one left off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from wakewise.control.tracker import TrackerState
from wakewise.core.arrays import Array, freeze


@dataclass(frozen=True, kw_only=True, eq=False)
class Carried:
    """The tracker's integral, and the thrusts last sent, shape (n,)."""

    tracker: TrackerState
    thrusts_N: Array

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(None,))


@runtime_checkable
class HandsOver(Protocol):
    """A controller whose memory can go to another one, and come from one."""

    def carried(self, state: Any) -> Carried:
        """What another method can go on with."""
        ...

    def resumed(self, carried: Carried) -> Any:
        """State before the first step after another method's."""
        ...
