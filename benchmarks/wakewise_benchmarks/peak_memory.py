"""Most memory that a process has held."""

from __future__ import annotations

import re
import resource
from pathlib import Path


def peak_memory_MB() -> float:
    """Most memory that this process has held. Linux's own record is preferred: getrusage's counts the parent's too."""
    status = Path("/proc/self/status")
    if status.exists():
        found = re.search(r"VmHWM:\s+(\d+) kB", status.read_text(encoding="ascii"))
        if found:
            return int(found.group(1)) * 1024 / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
