"""Splat files as trainers write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def write_splats(
    path: Path,
    centres: np.ndarray,
    opacity: np.ndarray,
    sigmas: np.ndarray,
    turns: np.ndarray | None = None,
    scales: int = 3,
) -> Path:
    """A PLY of 3D Gaussian splatting: opacities as logits, standard deviations as logarithms, turns (w, x, y, z)."""
    n = len(centres)
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)) if turns is None else turns
    columns = {axis: centres[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"f_dc_{k}": np.zeros(n) for k in range(3)}
    columns["opacity"] = np.log(opacity / (1.0 - opacity))
    columns |= {f"scale_{k}": np.log(sigmas[:, k]) for k in range(scales)}
    columns |= {f"rot_{k}": turns[:, k] for k in range(4)}
    rows = np.empty(n, dtype=[(name, "<f4") for name in columns])
    for name, values in columns.items():
        rows[name] = values
    head = "".join(f"property float {name}\n" for name in columns)
    text = f"ply\nformat binary_little_endian 1.0\nelement vertex {n}\n{head}end_header\n"
    path.write_bytes(text.encode("ascii") + rows.tobytes())
    return path
