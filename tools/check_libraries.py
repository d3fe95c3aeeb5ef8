"""Import every compiled dependency once, extras too; if a system library is missing, say which package holds it."""

from __future__ import annotations

import importlib
import re
import sys

MODULES = (
    *("numpy", "scipy", "numba", "polars", "skimage", "daqp", "piqp", "osqp"),
    *("cv2", "embreex", "pycolmap", "small_gicp", "matplotlib", "foxglove", "pygame", "onnxruntime"),
)
# Debian's package for a shared library that a wheel may expect on the system.
PACKAGES = {
    "libGL.so.1": "libgl1",
    "libgomp.so.1": "libgomp1",
    "libglib-2.0.so.0": "libglib2.0-0",
    "libstdc++.so.6": "libstdc++6",
    "libatomic.so.1": "libatomic1",
    "libX11.so.6": "libx11-6",
}


def main() -> int:
    """Return 0 if all import, else 2 after one line per missing library."""
    wanted = set()
    for name in MODULES:
        try:
            importlib.import_module(name)
        except ImportError as fault:
            found = re.search(r"(lib[\w.+-]+\.so[\w.]*)", str(fault))
            if not found:
                print(f"wakewise: {name} cannot be imported: {fault}", file=sys.stderr)
                return 2
            wanted.add(PACKAGES.get(found.group(1), f"the package that holds {found.group(1)}"))
    if wanted:
        print(f"wakewise: system libraries are missing: apt-get install {' '.join(sorted(wanted))}", file=sys.stderr)
    return 2 if wanted else 0


if __name__ == "__main__":
    sys.exit(main())
