"""A few photographs with known poses, a camera with distortion, a small cloud."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.geometry import quat_from_rotvec
from wakewise.experiments.exports import Photographs, SparsePoints, Trajectory

RNG = np.random.default_rng(18)


@pytest.fixture
def track() -> Trajectory:
    """Four poses, turned in all ways."""
    q = np.array([quat_from_rotvec(v) for v in RNG.uniform(-2.0, 2.0, (4, 3))])
    return Trajectory(times_s=np.array([0.0, 0.1, 1.25, 2.0000001]), p_W_m=RNG.normal(size=(4, 3)), q=q)


@pytest.fixture
def photographs(track: Trajectory, tmp_path: Path) -> Photographs:
    """Photographs of 64 x 48 px; what is in the files is of no concern here."""
    (tmp_path / "photos").mkdir()
    files = tuple(tmp_path / "photos" / f"{k:03}.jpg" for k in range(4))
    for k, file in enumerate(files):
        file.write_bytes(b"\xff\xd8 photograph " + bytes([k]))
    params = np.array([51.0, 52.0, 31.7, 24.2, -0.11, 0.02, 1e-3, -2e-3])
    return Photographs(files=files, track=track, width=64, height=48, params=params)


@pytest.fixture
def cloud() -> SparsePoints:
    """Five points."""
    return SparsePoints(
        points_W_m=RNG.normal(size=(5, 3)),
        colours=RNG.integers(0, 256, (5, 3), np.uint8),
        errors_px=RNG.uniform(0.1, 1.0, 5),
    )
