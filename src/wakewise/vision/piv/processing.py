"""Image pairs to displacements: OpenPIV in a process of its own where it is installed, else the correlation here."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from wakewise.core.errors import InputError, StageError
from wakewise.core.optional_dependencies import how_to_install
from wakewise.vision.piv.correlation import Displacements, correlate
from wakewise.vision.piv.images import Picture

Engine = Literal["auto", "openpiv", "in-house"]
OPENPIV_WINDOWS_PX = (64, 32, 16)
_LIMIT_S = 300.0


def has_openpiv() -> bool:
    """Whether the optional extra `piv` (OpenPIV, GPL-3) is installed; it is looked for, never imported."""
    return importlib.util.find_spec("openpiv") is not None


def displacements(pairs: Sequence[tuple[Picture, Picture]], engine: Engine = "auto") -> list[Displacements]:
    """Displacements of every pair of frames, each of shape (rows, columns).

    Parameters
    ----------
    pairs : sequence of two uint8 pictures
    engine : {"auto", "openpiv", "in-house"}
        "auto" takes OpenPIV if it is installed.

    Raises
    ------
    InputError
        If there are no pairs, their shapes differ, or OpenPIV is asked for and not installed.
    StageError
        If OpenPIV fails.
    """
    if not pairs:
        raise InputError("image pairs: none, needs at least one")
    shapes = {picture.shape for pair in pairs for picture in pair}
    if len(shapes) > 1:
        raise InputError(f"image pairs: pictures of {len(shapes)} sizes, all must have the same")
    if min(pairs[0][0].shape) < 2 * OPENPIV_WINDOWS_PX[0]:
        raise InputError(
            f"image pairs: {pairs[0][0].shape} px, each side must have {2 * OPENPIV_WINDOWS_PX[0]} or more"
        )
    if engine == "openpiv" and not has_openpiv():
        raise InputError(f"engine 'openpiv': not installed; {how_to_install('piv')}, or choose 'in-house'")
    if engine == "openpiv" or (engine == "auto" and has_openpiv()):
        return _openpiv(pairs)
    return [correlate(first, second) for first, second in pairs]


def _openpiv(pairs: Sequence[tuple[Picture, Picture]]) -> list[Displacements]:
    script = Path(__file__).with_name("openpiv_script.py")
    with tempfile.TemporaryDirectory(prefix="wakewise-piv-") as folder:
        source, out = Path(folder) / "pairs.npz", Path(folder) / "vectors.npz"
        np.savez(
            source,
            first=np.stack([first for first, _ in pairs]),
            second=np.stack([second for _, second in pairs]),
            windows=np.array(OPENPIV_WINDOWS_PX),
        )
        command = [sys.executable, "-W", "ignore", str(script), str(source), str(out)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=_LIMIT_S * len(pairs), check=False)
        except subprocess.TimeoutExpired as slow:
            raise StageError(f"OpenPIV: no answer within {slow.timeout:g} s") from None
        if done.returncode != 0 or not out.is_file():
            lines = done.stderr.strip().splitlines() or ["no message"]
            raise StageError(f"OpenPIV failed: {lines[-1]}")
        with np.load(out) as found:
            return [
                Displacements(
                    columns_px=found["columns"],
                    rows_px=found["rows"],
                    right_px=right,
                    down_px=down,
                    valid=valid & np.isfinite(right) & np.isfinite(down),
                    engine="OpenPIV",
                )
                for right, down, valid in zip(found["right"], found["down"], found["valid"], strict=True)
            ]
