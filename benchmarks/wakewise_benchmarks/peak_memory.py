"""Most memory that a process has held."""

from __future__ import annotations

import re
import resource
from contextlib import suppress
from pathlib import Path


def peak_memory_MB() -> float:
    """Most memory that this process has held. Linux's own record is preferred: getrusage's counts the parent's too."""
    status = Path("/proc/self/status")
    if status.exists():
        found = re.search(r"VmHWM:\s+(\d+) kB", status.read_text(encoding="ascii"))
        if found:
            return int(found.group(1)) * 1024 / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def forget_peak() -> None:
    """Let the peak begin anew from what is held now, where the system allows it (Linux)."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
