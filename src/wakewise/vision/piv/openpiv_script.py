"""Stand-alone program: image pairs in an npz file to displacements in another, computed by OpenPIV.

It runs in a process of its own, with files as its only link: OpenPIV is licensed GPL-3 and no part of Wakewise imports
it. Usage: python openpiv_script.py PAIRS.npz VECTORS.npz. PAIRS holds `first` and `second`, shape (k, rows, columns),
uint8, and `windows`, shape (p,). VECTORS receives `columns`, `rows` in pixels (centres at +0.5), `right`, `down`, shape
(k, n, m), in pixels, and `valid`, shape (k, n, m).
"""

import importlib
import sys
from typing import Any

import numpy as np


def process(first: Any, second: Any, windows: list[int]) -> tuple[Any, Any, Any, Any, Any]:
    """Displacements of one pair by window deformation in as many passes as there are windows."""
    windef = importlib.import_module("openpiv.windef")
    settings = windef.PIVSettings(
        windowsizes=tuple(windows), overlap=tuple(w // 2 for w in windows), num_iterations=len(windows)
    )
    settings.correlation_method = "circular"
    settings.subpixel_method = "gaussian"
    settings.deformation_method = "symmetric"
    settings.interpolation_order = 3
    settings.sig2noise_validate = False
    settings.sig2noise_method = None
    settings.median_normalized = True
    settings.median_threshold = 2
    x, y, u, v, _ = windef.first_pass(first, second, settings)
    u, v = np.ma.masked_invalid(u), np.ma.masked_invalid(v)
    validation = importlib.import_module("openpiv.validation")
    filters = importlib.import_module("openpiv.filters")
    flags = validation.typical_validation(u, v, np.ones(u.shape), settings)
    u, v = filters.replace_outliers(u, v, flags)
    for i in range(1, len(windows)):
        x, y, u, v, _, flags = windef.multipass_img_deform(
            first, second, i, x, y, np.ma.masked_invalid(u), np.ma.masked_invalid(v), settings
        )
    return x, y, np.ma.filled(u, np.nan), np.ma.filled(v, np.nan), np.asarray(flags) == 0


def main(source: str, out: str) -> None:
    """Process every pair of a file."""
    data = np.load(source)
    windows = [int(w) for w in data["windows"]]
    found = [process(a, b, windows) for a, b in zip(data["first"], data["second"], strict=True)]
    x, y = found[0][:2]
    np.savez(
        out,
        # Its frames are bent as if window centres lay half a pixel further on: that is where its field holds.
        columns=x[0] + 0.5,
        rows=y[:, 0] + 0.5,
        right=np.stack([f[2] for f in found]),
        down=np.stack([f[3] for f in found]),
        valid=np.stack([f[4] for f in found]),
    )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
