"""How much memory a process and those that it started have, as the system tells it."""

from __future__ import annotations

import os
from pathlib import Path

_PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


def memory_MB(pid: int) -> float:
    """Resident memory of a process and its descendants, 10^6 bytes; 0 where the system does not say (no /proc).

    Pages that they share count in each.
    """
    total, waiting = 0, [pid]
    while waiting:
        one = waiting.pop()
        place = Path("/proc", str(one))
        try:
            total += int((place / "statm").read_text().split()[1]) * _PAGE
            for thread in (place / "task").iterdir():
                waiting += map(int, (thread / "children").read_text().split())
        except (OSError, ValueError, IndexError):  # it has ended meanwhile
            continue
    return total / 1e6
