"""A trajectory as text lines `timestamp tx ty tz qx qy qz qw`, which evo and the TUM RGB-D tools read.

Format: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wakewise.core.files import write_text
from wakewise.experiments.exports.records import Trajectory


def write_tum(path: Path, track: Trajectory, note: str) -> None:
    """Write a trajectory; the format states no axes, so they stay ours (NED), and the first line says so.

    Parameters
    ----------
    path : Path
    track : Trajectory
    note : str
        What moved, and its axes; goes into the first line.
    """
    rows = np.column_stack([track.times_s, track.p_W_m, track.q[:, [1, 2, 3, 0]]])
    lines = [" ".join(f"{value:.17g}" for value in row) for row in rows.tolist()]
    head = f"# {note}, in a world north-east-down\n# timestamp tx ty tz qx qy qz qw\n"
    write_text(path, head + "\n".join(lines) + "\n")
